/* SPDX-License-Identifier: MIT */
#include "survey_judge.h"

#include "notes.h"
#include "pose.h"
#include "vec3.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    FEW_FEATURES = 50 /* with fewer features in a picture, few matches are
                       * no evidence */
};

/* Limits of the judgements; each is an estimate from the captures that we
 * have. */
/* In degrees between neighbouring views. Views further apart rarely show the
 * same primitives. */
#define FAR_APART 25.0
#define FEW_VIEWS 6
#define LITTLE_OVERLAP 0.25
#define OFF_PIXELS 2.0
#define OFF_STOPS 0.2
/* The refinement changes one camera most if it moves what this one sees by this
 * factor more than what any other sees, and than LEAST_CHANGE pixels. A single
 * wrong camera of four appears as 3/4 of its error, and each other as 1/4. */
#define CHANGES 1.5
#define LEAST_CHANGE 0.5
#define FOCAL_CHANGE 0.03 /* mean change of the logarithm of focal lengths */
/* Largest distance of cameras at the same place, which should see the same, as
 * a part of that to the scene: half a degree. Cameras are not placed that close
 * on purpose; a step towards the scene leaves the direction, but not the
 * place. */
#define ONE_PLACE 0.0087
/* Matches of such cameras are at one place within this number of times the
 * tolerance of a fit, since half a degree is 2 to 4 of 480 pixels. */
#define APART_PIXELS 5.0
/* Cosine of the angle between their axes, 10 degrees. */
#define ONE_WAY 0.98

static int count_training(const saga_capture *c)
{
    int n = 0;
    for (int v = 0; v < c->n_views; v++)
        n += !c->views[v].held_out;
    return n;
}

static void judge_rig(saga_survey *s, const saga_capture *c)
{
    const int n = count_training(c);
    const bool points = c->n_points >= SAGA_FEW_PLACES;
    if (c->moves)
        saga_note(s->notes,
                  "A single moving camera sees each moment from one "
                  "side only; other views of moving things are guesses.");
    /* Free views need more than six cameras, or at least three close ones with
     * points. */
    s->free_views = n > FEW_VIEWS ||
                    (n > 2 && points && s->typical_angle < FAR_APART);
    if (n == 1 && !s->free_views)
        saga_note(s->notes,
                  "One camera%s does not allow free views: the file "
                  "shows only what this camera saw. More cameras%s help.",
                  points ? "" : " without points",
                  points ? ""
                         : ", or a "
                           "COLMAP model with points,");
    else if (!s->free_views)
        saga_note(s->notes,
                  "%d cameras that stand %.0f degrees apart%s do not "
                  "allow free views: the file shows what these cameras saw, "
                  "and views between them are poor. More cameras%s help.",
                  n, s->typical_angle, points ? "" : " without points",
                  points ? "" : ", or a COLMAP model with points,");
    else if (s->typical_angle > FAR_APART)
        saga_note(s->notes,
                  "Cameras are %.0f degrees apart: views between "
                  "them are poor.",
                  s->typical_angle);
    if (!points && s->free_views)
        saga_note(s->notes, "There are no points: training begins with guesses "
                            "of depth. A COLMAP model or ply_file_path helps.");
}

/* Adds a part of a list to a text. */
static void add_part(char *text, size_t nbytes, const char *part)
{
    const size_t n = strlen(text);
    if (part[0])
        (void)snprintf(text + n, nbytes - n, "%s%s", n ? ", and " : "", part);
}

/* Describes a mistake in the poses that all cameras share. */
static void describe_poses(char *text, size_t nbytes, const saga_mistake *m)
{
    static const char *const to_world[SAGA_POSE_FORMS] = {
        "", "matrices are world to camera", "rotations are transposed",
        "translations are those of world to camera"
    };
    static const char *const to_camera[SAGA_POSE_FORMS] = {
        "", "poses are camera to world", "rotations are transposed",
        "translations are the positions of the cameras"
    };
    static const char *const reversed[SAGA_AXES] = {
        "",
        "camera axes have x reversed",
        "camera axes have y reversed",
        "camera axes have x and y reversed",
        "camera axes have z reversed",
        "camera axes have x and z reversed",
        "camera axes have y and z reversed",
        "camera axes have x, y and z reversed"
    };
    const bool opengl = m->poses == SAGA_POSES_OPENGL;
    const int between = SAGA_AXIS_Y + SAGA_AXIS_Z;
    /* The form of a file with OpenGL's axes is undone in these axes, so that
     * OpenCV's must follow; if not, the file's axes are really OpenCV's. */
    const int axes = m->form == SAGA_POSE_RIGHT || !opengl
                         ? m->reversed
                         : m->reversed ^ between;
    add_part(
        text, nbytes,
        (m->poses == SAGA_POSES_TO_CAMERA ? to_camera : to_world)[m->form]);
    add_part(text, nbytes,
             opengl && axes == between
                 ? "camera axes are OpenCV's (y down, z forward)"
                 : reversed[axes]);
    add_part(text, nbytes,
             m->mirrored ? "the world is a mirror image (left-handed axes)"
                         : "");
}

/* Describes the mistake that, once undone, makes the pictures fit. */
static void judge_mistake(saga_survey *s, const saga_capture *c)
{
    const saga_calibration *const fit = &s->calibration;
    const saga_mistake *const m = &fit->mistake;
    char what[240] = "", lens[100] = "";
    if (m->swapped[0] >= 0)
        (void)snprintf(
            what, sizeof what, "the pictures of %.60s and %.60s are exchanged",
            c->views[m->swapped[0]].name, c->views[m->swapped[1]].name);
    else
        describe_poses(what, sizeof what, m);
    if (m->focal != 1.0)
        (void)snprintf(lens, sizeof lens, "%s %s by about %.2g",
                       m->centre ? "focal lengths and centres, as of another "
                                   "size of picture,"
                                 : "focal lengths",
                       m->focal < 1.0 ? "are too long" : "are too short",
                       m->focal < 1.0 ? 1.0 / m->focal : m->focal);
    add_part(what, sizeof what, lens);
    /* The cameras of a mirrored world fit the pictures as they are. */
    saga_note(s->notes,
              "%s: of %d pairs of cameras with matches, %d fit. After the "
              "correction of one mistake, %d fit: %s. --fix FILE writes the "
              "corrected cameras.",
              saga_pose_is_mirrored(c->views[0].rotation)
                  ? "The poses are mirror images"
                  : "The cameras do not fit the pictures",
              fit->n_pairs, fit->n_fit, fit->n_fit_then, what);
}

/* Notes whether poses and lenses fit the matches. */
static void judge_calibration(saga_survey *s, const saga_capture *c)
{
    static const saga_note_kind odd = {
        "A pose, a lens or a file is wrong: ",
        ", while the other cameras fit "
        "each other. Correct it, or hold it out."
    };
    const saga_calibration *const fit = &s->calibration;
    int n_odd = 0;
    for (int v = 0; v < c->n_views; v++)
        n_odd += fit->odd[v];
    /* A mistake of all cameras comes first; single ones follow. */
    if (fit->found)
        judge_mistake(s, c);
    else if (fit->bad && n_odd == 0)
        saga_note(s->notes,
                  "The cameras do not fit the pictures: of %d pairs "
                  "of cameras with matches, %d fit; the others are off by %.1f "
                  "pixels or more, and none of the usual mistakes explains it. "
                  "Calibrate again.",
                  fit->n_pairs, fit->n_fit, fit->within);
    for (int v = 0; v < c->n_views; v++)
        if (fit->odd[v])
            saga_note_each(s->notes, &odd,
                           "%s does not fit the other cameras "
                           "(off by %.1f pixels)",
                           c->views[v].name, fit->off[v]);
}

/* Returns the view that the refinement changes most; -1 if none stands out. */
static int find_changed(const saga_refinement *r, const saga_capture *c)
{
    int most = -1;
    double second = 0.0;
    for (int v = 0; v < c->n_views; v++)
        if (most < 0 || r->moved[v] > r->moved[most])
            most = isnan(r->moved[v]) ? most : v;
    for (int v = 0; v < c->n_views; v++)
        if (v != most && r->moved[v] > second)
            second = r->moved[v];
    return most >= 0 && r->moved[most] > CHANGES * fmax(second, LEAST_CHANGE)
               ? most
               : -1;
}

/* Notes by how much refinement can reduce small errors of poses and lenses, and
 * which camera or what of all has most of them. */
static void judge_refinement(saga_survey *s, const saga_capture *c)
{
    const saga_refinement *const r = &s->calibration.refinement;
    char camera[120] = "", focal[80] = "";
    double sum = 0.0;
    if (!r->helps)
        return;
    const int most = find_changed(r, c);
    if (most >= 0)
        (void)snprintf(camera, sizeof camera,
                       " %.60s changes most, by %.1f "
                       "pixels.",
                       c->views[most].name, r->moved[most]);
    /* The mean ratio of focal lengths, in logarithms. */
    for (int v = 0; v < c->n_views; v++)
        sum += log(r->cameras[v].lens[0] / c->views[v].fx) / c->n_views;
    if (fabs(sum) > FOCAL_CHANGE)
        (void)snprintf(focal, sizeof focal,
                       " Focal lengths are %.0f %% too "
                       "%s.",
                       100.0 * fabs(expm1(-sum)), sum < 0.0 ? "long" : "short");
    saga_note(s->notes,
              "Poses and lenses can be refined: if all cameras are "
              "adjusted to a part of the matches, the error of the other "
              "matches falls from %.2f to %.2f pixels.%s%s `saga encode` does "
              "this; --fix FILE writes the refined cameras.",
              r->before, r->after, camera, focal);
}

/* Notes if two cameras at one place with the same direction do not see the
 * same. */
static void judge_twin(saga_survey *s, const saga_capture *c, int v)
{
    static const saga_note_kind twin = {
        "", ": one of the poses or files belongs to another camera."
    };
    const saga_survey_view *const one = &s->views[v];
    const saga_calibration *const fit = &s->calibration;
    const int w = one->nearest;
    if (w < v || !(one->step < ONE_PLACE))
        return;
    const double *const a = c->views[v].rotation + 6;
    const double *const b = c->views[w].rotation + 6;
    const bool apart = fit->turned[v * c->n_views + w] >
                       APART_PIXELS * fit->within;
    if (dot3(a, b) > ONE_WAY &&
        (apart || (fit->shared[v * c->n_views + w] == 0 &&
                   fit->n_features[v] >= FEW_FEATURES &&
                   fit->n_features[w] >= FEW_FEATURES)))
        saga_note_each(s->notes, &twin,
                       "%s and %s have the same pose, but see "
                       "different things",
                       c->views[v].name, c->views[w].name);
}

/* Notes what makes a view worth less than others. */
static void judge_view(saga_survey *s, const saga_capture *c, int v)
{
    static const saga_note_kind shares = {
        "The depth of what no second camera sees is unknown: ", "."
    };
    static const saga_note_kind reprojects = {
        "A pose, a lens or a size is wrong: half of the model's features are "
        "far from their points in ",
        "."
    };
    static const saga_note_kind exposure = {
        "Exposure differs from that of the other cameras: ",
        "; `saga encode` compensates for this, except where colours are "
        "clipped."
    };
    static const saga_note_kind missing = { "Pictures are missing: ", "." };
    const saga_survey_view *const one = &s->views[v];
    const saga_source_view *const view = &c->views[v];
    /* Each of these may be so without the others. */
    if (one->overlap < LITTLE_OVERLAP)
        saga_note_each(s->notes, &shares, "%s shares only %.0f %% of its view",
                       view->name, 100.0 * one->overlap);
    if (view->n_observations > 0 && view->reprojection_median > OFF_PIXELS)
        saga_note_each(s->notes, &reprojects, "%s (%.1f pixels)", view->name,
                       view->reprojection_median);
    if (fabs(one->stops) > OFF_STOPS)
        saga_note_each(s->notes, &exposure, "%s is %.2f stops %s", view->name,
                       fabs(one->stops),
                       one->stops > 0.0 ? "brighter" : "darker");
    judge_twin(s, c, v);
    if (view->n_missing > 0 && !c->moves)
        saga_note_each(s->notes, &missing, "%s lacks %d of %d pictures",
                       view->name, view->n_missing, c->n_frames);
}

static bool is_late(const saga_lateness *late)
{
    return fabs(late->frames) > late->tolerance;
}

/* Notes which cameras are not synchronous. */
static void judge_late(saga_survey *s, const saga_capture *c)
{
    char after[SAGA_NAME_NBYTES + 60] = "";
    saga_note_kind kind = { "", after };
    /* The remedy depends on whether one camera is late or several. */
    for (int v = 0; v < c->n_views; v++) {
        const saga_lateness *const late = &s->views[v].late;
        if (!is_late(late))
            continue;
        if (!after[0])
            (void)snprintf(after, sizeof after,
                           ": give --late %s=%.3g, or "
                           "hold it out.",
                           c->views[v].name, saga_lateness_likely(late));
        else
            kind.after = ": give `saga encode` --late auto, or hold them out.";
    }
    for (int v = 0; v < c->n_views; v++) {
        const saga_lateness *const late = &s->views[v].late;
        if (is_late(late))
            saga_note_each(s->notes, &kind,
                           "%s seems to run %.1f frames "
                           "(+-%.1f) %s the others",
                           c->views[v].name, fabs(late->frames),
                           late->tolerance,
                           late->frames > 0.0 ? "behind" : "before");
    }
}

void saga_survey_judge(saga_survey *survey, const saga_capture *capture)
{
    judge_calibration(survey, capture);
    judge_refinement(survey, capture);
    judge_rig(survey, capture);
    for (int v = 0; v < capture->n_views; v++)
        judge_view(survey, capture, v);
    judge_late(survey, capture);
}
