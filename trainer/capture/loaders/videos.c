/* SPDX-License-Identifier: MIT
 *
 * What all layouts with a video for each camera share: videos are probed, what
 * is unusual about them is noted by camera, and their frames are paired by time
 * stamps. Videos of one constant rate that begin together are so paired by
 * count.
 */
#include "load.h"

#include "alloc.h"
#include "error.h"
#include "notes.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool saga_probe_video(saga_source *source, saga_error *error)
{
    saga_video_info *const info = &source->info;
    if (!saga_video_probe(info, source->video, error))
        return false;
    source->width = info->width;
    source->height = info->height;
    source->orientation = info->orientation;
    /* Players and the tools that calibrate videos turn them, so that this is
     * assumed unless the calibration shows otherwise. */
    source->upright = info->orientation > 1;
    if (source->upright && saga_turn_swaps(info->orientation)) {
        source->width = info->height;
        source->height = info->width;
    }
    return true;
}

int saga_source_frame(const saga_source *source, int moment)
{
    const int k = source->skip + moment;
    return source->frames ? source->frames[k] : k;
}

/* -------------------------------------------------------------------- facts */

static bool is_one_of(const char *value, const char *const *list)
{
    while (*list && strcmp(value, *list) != 0)
        list++;
    return *list != NULL;
}

static bool is_untagged(const saga_source *s)
{
    return s->info.untagged;
}

static bool is_hdr(const saga_source *s)
{
    static const char *const hdr[] = { "arib-std-b67", "smpte2084", NULL };
    return is_one_of(s->info.transfer, hdr);
}

static bool is_odd_transfer(const saga_source *s)
{
    static const char *const odd[] = { "linear",   "log100", "log316",
                                       "smpte428", "log",    "log_sqrt",
                                       NULL };
    return is_one_of(s->info.transfer, odd);
}

static bool is_wide(const saga_source *s)
{
    static const char *const wide[] = { "bt2020",   "smpte428", "smpte431",
                                        "smpte432", "film",     NULL };
    return !is_hdr(s) && is_one_of(s->info.primaries, wide);
}

static bool is_interlaced(const saga_source *s)
{
    return s->info.interlaced;
}

static bool has_alpha(const saga_source *s)
{
    return s->info.alpha;
}

/* Writes the names of the cameras of which something is so: all if there are
 * few, otherwise the first ones. Returns their number. */
static int name_those(const saga_listing *l, bool (*is)(const saga_source *),
                      char *text, size_t n)
{
    enum { MOST = 4 };
    size_t used = 0;
    int found = 0, n_all = 0;
    for (int i = 0; i < l->n_sources; i++)
        n_all += is(&l->sources[i]);
    for (int i = 0; i < l->n_sources && found < MOST && used < n; i++)
        if (is(&l->sources[i]))
            used += (size_t)snprintf(text + used, n - used, "%s%.60s",
                                     found++ ? ", " : "", l->sources[i].name);
    if (n_all > found && used < n)
        (void)snprintf(text + used, n - used, " and %d more", n_all - found);
    return n_all;
}

/* Notes what the videos' tags say that a film maker should know; alpha only if
 * it is not to be a mask. */
static void note_facts(saga_listing *l, bool alpha_counts)
{
    static const struct {
        bool (*is)(const saga_source *s);
        const char *text;
    } facts[] = {
        { is_untagged, "colour: video without a matrix tag is assumed to be "
                       "BT.709" },
        { is_hdr, "colour: HDR (HLG or PQ) is read as if it were SDR, so that "
                  "it is flat and differs from SDR cameras; convert it to "
                  "BT.709 first" },
        { is_odd_transfer, "colour: values are linear or logarithmic, but are "
                           "read as those of BT.709; convert them first" },
        { is_wide,
          "colour: wide primaries (BT.2020 or P3) are read as those of "
          "BT.709, so that colours are pale; convert them first" },
        { is_interlaced, "time: interlaced; each frame is deinterlaced (bwdif) "
                         "at the time of its first field" },
        { has_alpha, "alpha: transparent pixels lie over black; --alpha-masks "
                     "ignores them" },
    };
    const size_t n_facts = sizeof facts / sizeof facts[0];
    /* The last fact is about alpha. */
    for (size_t i = 0; i < n_facts - alpha_counts; i++) {
        char names[320];
        const int n = name_those(l, facts[i].is, names, sizeof names);
        if (n > 0)
            saga_note(l->notes, "%s: %s (%d of %d)", facts[i].text, names, n,
                      l->n_sources);
    }
}

/* --------------------------------------------------------------------- rate */

/* Refuses videos that drift apart by more than half a frame within n frames,
 * because a neighbouring picture would then be nearer in time, unless time
 * stamps tell which is nearest. After k frames the drift is k (1 / slow - 1 /
 * fast) in seconds, which is k (fast / slow - 1) in frames of the fast video.
 * Rates that differ by more than 0.2 % are a mistake whatever the length;
 * 30000/1001 and 30 differ by half of that. A video of variable rate has no
 * rate to compare but its mean, which may differ by a fifth. */
static bool match_rates(const saga_listing *listing, int n, saga_error *error)
{
    const saga_source *slow = &listing->sources[0], *fast = slow;
    bool timed = true, steady = true;
    for (int i = 0; i < listing->n_sources; i++) {
        const saga_source *const s = &listing->sources[i];
        slow = s->info.fps < slow->info.fps ? s : slow;
        fast = s->info.fps > fast->info.fps ? s : fast;
        timed = timed && s->info.stamps;
        steady = steady && (s->info.steady || !s->info.stamps);
    }
    const double rate = slow->info.fps, apart = fast->info.fps - rate;
    return (apart <= (steady ? 0.002 : 0.2) * rate &&
            (timed || apart * (n - 1) <= 0.5 * rate)) ||
           saga_fail(error, fast->video, "give all cameras one frame rate",
                     "has %.6g frames per second, %s has %.6g", fast->info.fps,
                     slow->name, slow->info.fps);
}

/* Returns the rate on whose grid frames are paired: that of the first video
 * that has one. */
static double rate_of(const saga_listing *l)
{
    for (int i = 0; i < l->n_sources; i++)
        if (l->sources[i].info.steady)
            return l->sources[i].info.fps;
    return l->sources[0].info.fps;
}

static void note_rate(saga_listing *l, double rate)
{
    if (l->fps == 0.0)
        l->fps = rate;
    if (rate > 0.0 && fabs(l->fps / rate - 1.0) > 0.002)
        saga_note(l->notes,
                  "time: \"fps\" says %.6g frames per second, the "
                  "videos have %.6g (%s); \"fps\" is used, which plays them "
                  "%.3g times as fast; remove it if that is not meant",
                  l->fps, rate, l->sources[0].name, l->fps / rate);
}

/* ------------------------------------------------------------------ pairing */

/* Returns the moment of frame j on the grid that begins with the first frame.
 * Its distance from the moment is less than half a step. */
static double moment_of(const saga_source *s, double rate, int j)
{
    const double *const t = s->info.stamps;
    return floor((t[j] - t[0]) * rate + 0.5);
}

/* Sets the frame of each moment, the nearest one, if that is not its number. A
 * moment near which there is none gets -1. Counts the moments without a frame
 * and the frames that are not used. */
static bool map_frames(saga_source *s, double rate, int *n_lost,
                       saga_error *error)
{
    const int n = s->info.n_frames;
    int j = 0;
    s->n_moments = n;
    while (j < n && s->info.stamps && rate > 0.0 && moment_of(s, rate, j) == j)
        j++;
    if (j == n || !s->info.stamps || !(rate > 0.0))
        return true;
    const double last = moment_of(s, rate, n - 1);
    if (last >= SAGA_MAX_FRAMES)
        return saga_fail(error, s->video,
                         "cut it, or copy it with new time "
                         "stamps",
                         "%d frames take %.0f moments by their time "
                         "stamps",
                         n, last + 1.0);
    s->n_moments = (int)last + 1;
    s->frames = saga_alloc((size_t)s->n_moments, sizeof *s->frames, s->video,
                           error);
    if (!s->frames)
        return false;
    for (int m = 0; m < s->n_moments; m++)
        s->frames[m] = -1;
    /* Of two frames near one moment the nearer one stays. */
    *n_lost += s->n_moments;
    for (j = 0; j < n; j++) {
        const double m = moment_of(s, rate, j);
        int *const at = &s->frames[(int)m];
        const double *const t = s->info.stamps;
        if (*at < 0)
            --*n_lost;
        if (*at < 0 ||
            fabs((t[j] - t[0]) * rate - m) < fabs((t[*at] - t[0]) * rate - m))
            *at = j;
    }
    return true;
}

static bool is_mapped(const saga_source *s)
{
    return s->frames != NULL;
}

static bool map_all(saga_listing *l, double rate, saga_error *error)
{
    char names[320];
    int n_lost = 0;
    for (int i = 0; i < l->n_sources; i++)
        if (!map_frames(&l->sources[i], rate, &n_lost, error))
            return false;
    const int n = name_those(l, is_mapped, names, sizeof names);
    if (n > 0)
        saga_note(l->notes,
                  "time: frames were dropped, or come at a variable "
                  "or another rate; they are paired by time stamp, and %d "
                  "moments lack a picture: %s (%d of %d)",
                  n_lost, names, n, l->n_sources);
    return true;
}

static bool is_behind(const saga_source *s)
{
    return s->behind > 0.0;
}

/* Tells whether all videos have a picture at some moment. */
static bool overlap(const saga_listing *l)
{
    for (int i = 0; i < l->n_sources; i++)
        if (ceil(l->sources[i].behind) >= l->sources[i].n_moments)
            return false;
    return true;
}

/* Sets by how many frames each video began before the last one that began. Less
 * than half a frame is no difference. */
static void compare_starts(saga_listing *l, double rate)
{
    char names[320];
    double first = INFINITY, last = -INFINITY;
    bool own_clock = false;
    for (int i = 0; i < l->n_sources; i++) {
        const saga_video_info *const info = &l->sources[i].info;
        if (!info->stamps)
            return;
        first = fmin(first, info->stamps[0]);
        last = fmax(last, info->stamps[0]);
        own_clock |= info->own_clock;
    }
    if (!((last - first) * rate >= 0.5))
        return;
    for (int i = 0; i < l->n_sources; i++)
        l->sources[i].behind = (last - l->sources[i].info.stamps[0]) * rate;
    if (!own_clock && overlap(l)) {
        (void)name_those(l, is_behind, names, sizeof names);
        saga_note(l->notes,
                  "time: by their time stamps videos begin up to "
                  "%.4g frames before the last one, and are paired so: %s; "
                  "--late shifts them further",
                  (last - first) * rate, names);
        return;
    }
    /* Clocks that were never set together say nothing. */
    for (int i = 0; i < l->n_sources; i++)
        l->sources[i].behind = 0.0;
    saga_note(l->notes,
              "time: time stamps begin up to %.6g s apart, which "
              "does not tell when cameras began; videos are paired from their "
              "first frames",
              last - first);
}

/* ------------------------------------------------------------------ lengths */

/* Returns the number of moments from the common start to the end of a video. */
static int length_of(const saga_source *s)
{
    return s->n_moments - (int)ceil(s->behind - 1e-6);
}

bool saga_listing_match_videos(saga_listing *listing,
                               const saga_capture_options *options,
                               saga_error *error)
{
    const int wanted = options->end_frame;
    int n = listing->sources[0].info.n_frames;
    double most = 0.0;
    note_facts(listing, options->alpha_masks || options->subject);
    for (int i = 1; i < listing->n_sources; i++)
        n = listing->sources[i].info.n_frames < n
                ? listing->sources[i].info.n_frames
                : n;
    if (!match_rates(listing, wanted > 0 && wanted < n ? wanted : n, error))
        return false;
    const double rate = rate_of(listing);
    note_rate(listing, rate);
    if (!map_all(listing, rate, error))
        return false;
    compare_starts(listing, rate);
    /* Moments count from the common start, where all videos have begun. */
    const saga_source *shortest = &listing->sources[0];
    const saga_source *longest = shortest;
    for (int i = 0; i < listing->n_sources; i++) {
        const saga_source *const s = &listing->sources[i];
        shortest = length_of(s) < length_of(shortest) ? s : shortest;
        longest = length_of(s) > length_of(longest) ? s : longest;
        most = fmax(most, ceil(s->behind - 1e-6));
    }
    const int least = length_of(shortest), greatest = length_of(longest);
    /* saga_listing_late takes the difference of the starts off again. */
    listing->n_frames = least + (int)most;
    /* Lengths may differ if the wanted frames end before the shortest video
     * does. */
    if (greatest == least || (wanted > 0 && wanted <= least))
        return true;
    /* They may also differ if time stamps or --late give the frames that belong
     * together, or if the caller accepts any length. */
    if (most > 0.0 || options->late || options->any_length) {
        saga_note(listing->notes,
                  "lengths: %s has %d frames, %s has %d; "
                  "frames after the end of the shortest are not used",
                  shortest->name, least, longest->name, greatest);
        return true;
    }
    char remedy[160];
    (void)snprintf(remedy, sizeof remedy,
                   "if `saga check` finds that they "
                   "start together, give --frames 0:%d, else give --late",
                   least);
    return saga_fail(error, shortest->video, remedy,
                     "unequal frame counts: "
                     "%s has %d frames, %s has %d",
                     shortest->name, least, longest->name, greatest);
}
