/* SPDX-License-Identifier: MIT */
#include "preset.h"

#include "level_room.h"
#include "model.h"
#include "motion.h"
#include "policy.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* With "fast", studio (docs/results/training.md) takes 2.7 CPU minutes; by
 * their primitives and iterations the others should take some 9 and 40. The
 * names stand only here; other code asks for a row of the table. */
static const saga_preset presets[] = {
    { .name = "fast",
      .primitives = 0.7,
      .iterations = 8000,
      .visits = 10,
      .still_minutes = 0.35,
      .still_visits = 30,
      .better = "best",
      .plus = "all stages and tools; large pictures of a still capture are "
              "made smaller if the time is too short for all visits" },
    { .name = "balanced",
      .primitives = 1,
      .iterations = 20000,
      .visits = 25,
      .still_visits = 25,
      .teachers = 2,
      .better = "best",
      .plus = "the default: as fast, with 1.4 times the primitives and 2.5 "
              "times the visits; pictures of a still capture keep their "
              "size; two teachers, which are extra models that draw views "
              "between cameras, if cameras stand far apart" },
    { .name = "best",
      .primitives = 1.4,
      .iterations = 60000,
      .visits = 75,
      .still_visits = 75,
      .teachers = 2,
      .plus = "as balanced, with 1.4 times the primitives and 3 times the "
              "visits" }
};

enum { N_PRESETS = sizeof presets / sizeof presets[0] };

/* One primitive for this number of pixels of a moment. The built-in scene,
 * studio and person4 did well with about one for a hundred, chosen by hand
 * (docs/results/training.md). */
#define PIXELS_OF_ONE 120

/* Views that together have more pixels than studio's show the same things
 * larger or once more, rather than more things. Beyond that, the number grows
 * with this power of the pixels (docs/lab/size.md). */
#define MANY_PIXELS 1.7e6
#define MANY_POWER 0.4

/* Moving things need more primitives: for each second, a pixel that changes
 * counts two more times. */
#define MOTION_PART 2

/* The seconds of a segment, if it fits in memory. Long segments save bytes,
 * because what stays in the scene is coded once for each segment: at equal
 * PSNR, one segment of ten seconds takes half the bytes of ten segments of a
 * second with their base (docs/lab/segments.md). The drawback is that a jump
 * must read a whole segment. */
#define MOST_SECONDS 10

/* A segment has at least this number of frames. At low frame rates, such as a
 * picture every few seconds, ten seconds would be next to nothing. */
#define LEAST_FRAMES 24

/* Of a still, only this number of views counts for the number of primitives,
 * because further views mostly show the same things again. The pictures of a
 * moving camera count likewise. */
#define STILL_VIEWS 10

/* A picture of a still is made smaller only as far as needed for this number of
 * iterations, and keeps this number of pixels. */
#define LEAST_ITERATIONS 500
#define LEAST_PIXELS 1e5

/* Bytes of the networks and header, and of a primitive if a size is wanted. At
 * equal size, somewhat fewer primitives with a finer step lose nothing; more of
 * them with a coarser step do (docs/lab/size.md). */
#define FIXED_NBYTES 4000
#define PRIMITIVE_NBYTES 11

/* Bytes of a film's networks and of what does not grow, of a camera, and of a
 * primitive at the lambda that the rule gives. The last grow by some 0.4 for
 * each dB that a file reaches, from 10 at 27 dB to 17 at 43, and the dB are not
 * known before the training. A primitive of a film of more than SAGA_SHORT_FILM
 * frames takes fewer, by this power of the frames: the film reaches fewer dB,
 * and its features learn more slowly (docs/lab/films.md). */
#define FILM_NBYTES 2800
#define CAMERA_NBYTES 90
#define FILM_PRIMITIVE 12.85
#define FILM_POWER 0.18

/* Bytes of memory of a training: without a scene, for a primitive, and for a
 * pixel of the largest picture. tests/train/test_preset.c lists what trainings
 * took. */
#define FIXED_MEMORY 1e7
#define PRIMITIVE_MEMORY 14000.0
#define PIXEL_MEMORY 120.0

/* Bytes for a primitive in files so small that networks are most of them. */
#define SMALL_NBYTES 20

enum { LEAST_PRIMITIVES = 100, MOST_ITERATIONS = 10000000 };

const saga_preset *saga_preset_at(int number)
{
    return number >= 0 && number < N_PRESETS ? &presets[number] : NULL;
}

const saga_preset *saga_preset_called(const char *name)
{
    for (int i = 0; i < N_PRESETS; i++)
        if (!strcmp(presets[i].name, name))
            return &presets[i];
    return NULL;
}

/* A segment has at least two frames, the fewest in which anything can move. */
int saga_plan_segments(const saga_capture *capture, int frames)
{
    const int all = capture->n_frames;
    int n;

    /* A moving camera films each place at another moment: a shorter segment
     * would lack views, so there is only one. */
    if (!frames && capture->moves)
        frames = all;
    if (!frames)
        frames = (int)fmin(
            rint(fmax(MOST_SECONDS * capture->fps, LEAST_FRAMES)),
            SAGA_PLAN_MOST_FRAMES);
    /* The number is rounded, so that segments of equal length come close to
     * `frames`, and limited, so that none has fewer than two. */
    n = (all + frames / 2) / frames;
    n = n > all / 2 ? all / 2 : n;
    return n < 1 ? 1 : n;
}

double saga_plan_primitives(double pixels, double changing, double seconds)
{
    const double few = fmin(pixels, MANY_PIXELS);

    return few * pow(pixels / few, MANY_POWER) / PIXELS_OF_ONE *
           (1 + MOTION_PART * changing * fmax(seconds, 1));
}

double saga_plan_primitives_of_size(double n_bytes)
{
    return fmax((n_bytes - FIXED_NBYTES) / PRIMITIVE_NBYTES,
                n_bytes / SMALL_NBYTES);
}

/* 12,000 iterations take 0.27 to 0.4 CPU minutes for 1,000 primitives, which
 * cover more pixels in larger pictures, and 0.44 for pictures of 100,000 pixels
 * (tests/train/test_preset.c lists the times). */
double saga_plan_minutes(double n_primitives, double n_iterations,
                         double pixels)
{
    return n_iterations / 12000 *
           ((0.27 + 0.05 * fmin(pixels / 100000, 2.5)) * n_primitives / 1000 +
            0.44 * pixels / 100000);
}

double saga_plan_memory(double n_primitives, double largest)
{
    return FIXED_MEMORY + PRIMITIVE_MEMORY * n_primitives +
           PIXEL_MEMORY * largest;
}

/* The detail that is learned about a primitive of a still grows with the
 * logarithm of the number of iterations per primitive. The formula was fitted
 * to stills with 0.02 to 8 iterations per primitive, which
 * tests/train/test_preset.c lists, as it does films. */
void saga_plan_nbytes(double *least, double *most, double n_primitives,
                      double n_iterations, int n_frames, int n_views)
{
    const double each = log(n_iterations / n_primitives);
    const double film = FILM_NBYTES + CAMERA_NBYTES * n_views +
                        FILM_PRIMITIVE * n_primitives *
                            pow(fmin(SAGA_SHORT_FILM / n_frames, 1),
                                FILM_POWER);

    if (n_frames == 1) {
        *least = FIXED_NBYTES +
                 n_primitives * fmin(9, fmax(4, 7.5 + 0.75 * each));
        *most = FIXED_NBYTES +
                n_primitives * fmin(14, fmax(7, 10.5 + 0.7 * each));
    } else {
        *least = film / 1.25;
        *most = film / 0.75;
    }
}

/* --- The capture --------------------------------------------------------- */

/* Sums over the training views. */
typedef struct {
    double pixels;  /* pixels of all views at one moment */
    double largest; /* pixels of the largest view */
    double pictures;
    int n_views;
} extent;

static extent extent_of(const saga_capture *c)
{
    extent e = { 0, 0, 0, 0 };

    for (int i = 0; i < c->n_views; i++) {
        const saga_source_view *const v = &c->views[i];

        if (v->held_out)
            continue;
        e.n_views++;
        e.pixels += (double)v->width * v->height;
        e.largest = fmax(e.largest, (double)v->width * v->height);
        /* A moment of which the view has no picture is not trained. */
        e.pictures += c->n_frames - v->n_missing;
    }
    return e;
}

/* --- The plan ------------------------------------------------------------ */

/* Returns the number of primitives, within what the level has room for. */
static uint32_t within_level(const saga_train_options *o, double n)
{
    return saga_room_sure(
        o, (uint32_t)fmin(fmax(rint(n), LEAST_PRIMITIVES), UINT32_MAX));
}

/* Sets the number of primitives, and says so if the level is what limits it.
 * Returns whether it does. */
static bool limit(saga_train_options *o, saga_plan_reasons *why, double wanted)
{
    const bool higher = o->level < SAGA_N_PROFILES - 1;

    o->n_primitives = within_level(o, wanted);
    if (o->n_primitives >= rint(wanted))
        return false;
    snprintf(why->primitives, sizeof why->primitives,
             "%u primitives: level "
             "%d has room for no more of the %.0f that suit the capture%s",
             o->n_primitives, o->level, wanted,
             higher ? "; a higher --level has" : "");
    why->wanted = wanted;
    return true;
}

/* Returns the number of pixels of a still that count for its primitives. */
static double of_still(double pixels, double largest)
{
    return fmin(pixels, STILL_VIEWS * largest);
}

static void plan_primitives(saga_train_options *o, saga_plan_reasons *reasons,
                            const saga_capture *c, const saga_preset *p)
{
    char *const why = reasons->primitives;
    const size_t n = sizeof reasons->primitives;
    const extent e = extent_of(c);
    const double pixels = c->n_frames == 1 || c->moves
                              ? of_still(e.pixels, e.largest)
                              : e.pixels;
    const double changing = saga_plan_change(c);
    const double seconds = saga_capture_seconds(c);
    int k;

    /* If a file size is given, it alone determines the number of primitives,
     * which the segments share equally. */
    if (o->n_bytes) {
        if (!limit(o, reasons,
                   saga_plan_primitives_of_size((double)o->n_bytes) /
                       o->n_segments))
            snprintf(why, n, "%u primitives, chosen for the size",
                     o->n_primitives);
        return;
    }
    if (limit(o, reasons,
              p->primitives * saga_plan_primitives(pixels, changing, seconds)))
        return;
    /* k is the length of the sentence so far, if it was not cut. */
    k = snprintf(why, n,
                 "%u primitives: one for every %.0f of the %.0f pixels "
                 "of %s views at a time",
                 o->n_primitives, pixels / o->n_primitives, pixels,
                 pixels < e.pixels ? "ten of the" : "all");
    if (c->n_frames > 1 && k > 0 && (size_t)k < n)
        snprintf(why + k, n - (size_t)k, ", of which %.0f %% change in %.1f s",
                 100 * changing, seconds);
}

static void plan_iterations(saga_train_options *o, char *why, size_t n,
                            const saga_capture *c, const saga_preset *p)
{
    const extent e = extent_of(c);
    /* CPU minutes of an iteration, for a picture of mean size. */
    const double each = saga_plan_minutes(o->n_primitives, 1,
                                          e.pixels / e.n_views);
    const double visits = e.pictures *
                          (c->n_frames == 1 ? p->still_visits : p->visits);
    double most = MOST_ITERATIONS;

    /* The least number of visits overrides the time limit: pictures with fewer
     * look bad. */
    if (c->n_frames == 1 && p->still_minutes > 0)
        most = fmax(p->still_minutes / each, visits);
    o->n_iterations = (int)fmin(fmax(p->iterations, visits), most);
    snprintf(why, n, "%d iterations: preset %s, %.0f visits to each picture",
             o->n_iterations, p->name, o->n_iterations / e.pictures);
}

uint32_t saga_plan_least(const saga_train_options *o, const saga_capture *c,
                         const saga_preset *p)
{
    const double pixels = c->n_frames == 1 || c->moves
                              ? of_still(c->learned_pixels, c->largest_pixels)
                              : c->learned_pixels;

    if (o->n_primitives)
        return o->n_primitives;
    return within_level(
        o, o->n_bytes ? saga_plan_primitives_of_size((double)o->n_bytes) /
                            o->n_segments
                      : p->primitives * saga_plan_primitives(pixels, 0, 0));
}

/* Returns the number of iterations that a still can do within the preset's
 * minutes, with its pictures at 1/scale of their size. */
static double still_iterations(const saga_train_options *o,
                               const saga_capture *c, const saga_preset *p,
                               int scale)
{
    const double part = 1.0 / ((double)scale * scale);
    double n = o->n_primitives;

    /* The number of primitives follows the smaller pictures, unless it or the
     * size was given. */
    if (o->n_primitives == 0)
        n = within_level(
            o, o->n_bytes
                   ? saga_plan_primitives_of_size((double)o->n_bytes)
                   : p->primitives * saga_plan_primitives(
                                         part * of_still(c->learned_pixels,
                                                         c->largest_pixels),
                                         0, 0));
    return p->still_minutes /
           saga_plan_minutes(n, 1, part * c->learned_pixels / c->n_learned);
}

int saga_plan_scale(const saga_train_options *o, const saga_capture *c,
                    const saga_preset *p)
{
    const double visits = (double)p->still_visits * c->n_learned;
    const double wanted = fmax(visits, LEAST_ITERATIONS);
    const double pixels = c->learned_pixels / c->n_learned;
    int n = 1;

    /* Pictures are made smaller only to save time, and a user who gave
     * iterations or minutes has decided on the time. */
    if (c->n_frames != 1 || !(p->still_minutes > 0) || o->n_iterations ||
        o->minutes > 0 || still_iterations(o, c, p, 1) >= visits)
        return 1;
    /* The loop also stops at the least number of pixels, even if the time is
     * still short. */
    while (still_iterations(o, c, p, n) < wanted && n < SAGA_MAX_SCALE &&
           pixels / ((n + 1.0) * (n + 1.0)) >= LEAST_PIXELS)
        n++;
    return n;
}

void saga_plan(saga_train_options *o, saga_plan_reasons *why,
               const saga_capture *capture, const saga_preset *preset)
{
    memset(why, 0, sizeof *why);
    if (o->n_primitives == 0)
        plan_primitives(o, why, capture, preset);
    if (o->n_iterations == 0 && !(o->minutes > 0))
        plan_iterations(o, why->iterations, sizeof why->iterations, capture,
                        preset);
}
