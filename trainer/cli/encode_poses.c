/* SPDX-License-Identifier: MIT
 *
 * Before the training, saga encode refines poses and lenses by the matches of
 * the first frame, if that also improves matches that were kept from it. All
 * segments are trained with the refined cameras, and the file stores them.
 * Cameras whose pictures are wrong are named on the way.
 */
#include "encode_session.h"

#include "alloc.h"
#include "survey.h"

#include <string.h>

/* Returns the options for loading the first frame at its full size. */
static saga_capture_options first_frame(saga_encode_session *s)
{
    saga_capture_options o = saga_encode_uncut_options(s);

    o.first_frame = s->whole.first_frame;
    o.end_frame = s->whole.first_frame + 1;
    o.scale = 1;
    return o;
}

/* Remembers how the cameras change, whatever the size of their pictures. */
static bool keep(saga_encode_session *s, const saga_capture *first,
                 const saga_refinement *found)
{
    s->poses.camera = saga_alloc((size_t)first->n_views,
                                 sizeof *s->poses.camera, s->capture_name,
                                 &s->error);
    for (int v = 0; s->poses.camera && v < first->n_views; v++) {
        const saga_pinhole was = saga_pinhole_of(&first->views[v]);
        const saga_pinhole *const now = &found->cameras[v];
        saga_encode_camera *const to = &s->poses.camera[v];

        memcpy(to->rotation, now->rotation, sizeof to->rotation);
        memcpy(to->translation, now->translation, sizeof to->translation);
        for (int k = 0; k < 2; k++) {
            to->focal[k] = now->lens[k] / was.lens[k];
            to->centre[k] = (now->lens[2 + k] - was.lens[2 + k]) / was.lens[k];
        }
    }
    return s->poses.camera != NULL;
}

static void tell(const saga_encode_session *s, const saga_calibration *fit)
{
    if (s->poses.camera)
        saga_cli_error(0,
                       "encode: poses and lenses are refined: the error of "
                       "matches that were not used for it falls from %.2f to "
                       "%.2f pixels; --no-refine leaves them as they are",
                       fit->refinement.before, fit->refinement.after);
    /* Refined cameras may still be wrong. */
    if (s->poses.camera ? fit->refinement.after > fit->within
                        : fit->found || fit->bad)
        saga_cli_error(0,
                       "encode: the cameras do not fit the pictures: of %d "
                       "pairs of cameras with matches, %d fit; `saga check` "
                       "says more",
                       fit->n_pairs, fit->n_fit);
}

static bool refine(saga_encode_session *s)
{
    saga_capture first = { .n_views = 0 };
    saga_survey survey = { .views = NULL };
    const saga_refinement *const found = &survey.calibration.refinement;
    const saga_capture_options from = first_frame(s);
    bool ok = saga_capture_load(&first, s->capture_name, &from, &s->error) &&
              saga_survey_make(&survey, &first, &s->error);

    saga_meter_end(&s->progress.meter);
    if (ok)
        saga_encode_print_notes(survey.notes, survey.wrong_nbytes);
    if (ok && !s->o->no_refine && found->helps) {
        s->poses.before = found->before;
        s->poses.after = found->after;
        ok = keep(s, &first, found);
    }
    if (ok)
        tell(s, &survey.calibration);
    saga_survey_free(&survey);
    saga_capture_free(&first);
    return ok;
}

int saga_encode_refine(saga_encode_session *s)
{
    s->progress.meter = (saga_meter){ .quiet = s->o->quiet };
    /* A single moving camera has no second picture of a moment. */
    return s->whole.moves || refine(s) ? SAGA_EXIT_OK
                                       : saga_encode_not_loaded(s);
}
