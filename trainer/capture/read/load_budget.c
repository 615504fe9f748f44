/* SPDX-License-Identifier: MIT
 *
 * Computes what memory and disk a capture takes before any picture is decoded.
 */
#include "load_job.h"

#include "error.h"
#include "picture.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

bool saga_load_has_opacity(const saga_load_job *job, const saga_source *s)
{
    const saga_capture_options *const o = job->options;
    return (o->alpha_masks || (o->subject && !o->keyed)) &&
           (s->pictures || s->info.alpha);
}

bool saga_load_has_masks(const saga_load_job *job, const saga_source *s)
{
    if (job->options->uncut)
        return false;
    bool any = saga_load_has_opacity(job, s) || job->options->keyed;
    for (int k = 0; s->masks && !any && k < job->capture->n_frames; k++)
        any = s->masks[job->capture->first_frame + k] != NULL;
    return any;
}

bool saga_load_is_single(const saga_load_job *job, const saga_source *s)
{
    int n = 0;
    for (int k = 0; !s->video && k < job->capture->n_frames; k++)
        n += s->pictures[job->capture->first_frame + k] != NULL;
    return !s->video && n < 2 && job->capture->n_frames > 1;
}

static double pixels_of(const saga_load_job *job, int v, double scale)
{
    const saga_remap *const m = &job->remaps[v];
    return floor(m->full_width / scale) * floor(m->full_height / scale);
}

/* Returns the bytes of the pictures and masks of all views. */
static double pictures_nbytes(const saga_load_job *job, double scale)
{
    double n = 0.0;
    for (int v = 0; v < job->listing->n_sources; v++) {
        const saga_source *const s = &job->listing->sources[v];
        /* Pictures take 3 bytes per pixel, and masks one more. */
        n += (saga_load_has_masks(job, s) ? 4.0 : 3.0) *
             pixels_of(job, v, scale) *
             (saga_load_is_single(job, s) ? 1 : job->capture->n_frames);
    }
    return n;
}

/* Depth takes 4 bytes per pixel, for each frame that has it, even in a view
 * with a single picture. */
static double depths_nbytes(const saga_load_job *job, double scale)
{
    const int first = job->capture->first_frame;
    double n = 0.0;
    for (int v = 0; job->options->want_depth && v < job->listing->n_sources;
         v++) {
        char **const depths = job->listing->sources[v].depths;
        for (int k = 0; depths && k < job->capture->n_frames; k++)
            if (depths[first + k])
                n += 4.0 * pixels_of(job, v, scale);
    }
    return n;
}

uint64_t saga_load_picture_nbytes(const saga_load_job *job)
{
    return (uint64_t)pictures_nbytes(job, job->options->scale);
}

bool saga_load_uses_scratch(const saga_load_job *job)
{
    return job->options->scratch &&
           saga_load_picture_nbytes(job) > job->options->little_nbytes;
}

/* Returns how many bytes a pixel reading any of the wanted files takes besides
 * its result. */
static int most_scratch(const saga_load_job *job, char *const *files)
{
    const int first = job->capture->first_frame;
    int most = 0;
    for (int k = 0; files && k < job->capture->n_frames; k++) {
        const int n = files[first + k] ? saga_picture_scratch(files[first + k])
                                       : 0;
        most = n > most ? n : most;
    }
    return most;
}

/* Returns the working memory of a thread that decodes a picture of view v: the
 * picture, its remapping table, its depth and its mask. */
static double thread_nbytes(const saga_load_job *job, int v)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_remap *const m = &job->remaps[v];
    /* Each pixel of the file takes 3 bytes of colour and 4 of depth, and what
     * its format needs while it is decoded. */
    double each = 7.0 + fmax(most_scratch(job, s->pictures),
                             most_scratch(job, s->masks));
    double n = (double)saga_remap_nbytes(m, &s->lens);
    /* Opacity is read as RGBA, and the mask is scaled as an RGB picture. A
     * picture that is turned takes a copy. */
    if (s->upright)
        each += 4.0;
    if (saga_load_has_masks(job, s)) {
        each += 4.0;
        n += 3.0 * m->width * m->height;
    }
    return n + each * s->width * s->height;
}

static double threads_nbytes(const saga_load_job *job)
{
    double most = 0.0;
    for (int v = 0; v < job->listing->n_sources; v++)
        most = fmax(most, thread_nbytes(job, v));
    return most * job->n_threads;
}

/* Returns the memory that is needed, without the file's. */
static double forecast(const saga_load_job *job, double scale)
{
    return threads_nbytes(job) + depths_nbytes(job, scale) +
           (saga_load_uses_scratch(job) ? 0.0 : pictures_nbytes(job, scale));
}

static void say_remedy(const saga_load_job *job, double need, char *text,
                       size_t n)
{
    const double budget = (double)job->options->memory_nbytes;
    const double frames = need - threads_nbytes(job);
    int scale = job->options->scale;
    /* Find the largest picture size, 1/scale, that fits. */
    while (scale < SAGA_MAX_SCALE && forecast(job, scale) > budget)
        scale++;
    /* fit is the number of frames that fit at the wanted scale, after the
     * threads' memory, which does not depend on the number of frames. */
    const int fit = frames > 0.0 ? (int)floor((budget - threads_nbytes(job)) /
                                              frames * job->capture->n_frames)
                                 : 0;
    size_t used = (size_t)snprintf(text, n, "use ");
    if (forecast(job, scale) <= budget)
        used += (size_t)snprintf(text + used, n - used, "--scale 1/%d, ",
                                 scale);
    if (fit > 0)
        used += (size_t)snprintf(text + used, n - used, "--frames %d:%d, ",
                                 job->capture->first_frame,
                                 job->capture->first_frame + fit);
    (void)snprintf(text + used, n - used, "%s--memory %.0f (GiB)",
                   used > strlen("use ") ? "or " : "",
                   ceil(need / 1073741824.0));
}

bool saga_load_check_budget(const saga_load_job *job)
{
    const double need = forecast(job, job->options->scale);
    if (need <= (double)job->options->memory_nbytes && need < 9e15)
        return true;
    const saga_source *const s = &job->listing->sources[0];
    char remedy[200];
    say_remedy(job, need, remedy, sizeof remedy);
    return saga_fail(job->error, job->listing->path, remedy,
                     "%d cameras x %d "
                     "frames of %d x %d pixels at 1/%d need %.1f MiB, the "
                     "budget is %.1f MiB",
                     job->listing->n_sources, job->capture->n_frames, s->width,
                     s->height, job->options->scale, need / 1048576.0,
                     (double)job->options->memory_nbytes / 1048576.0);
}
