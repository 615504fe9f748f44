/* SPDX-License-Identifier: MIT
 *
 * Finds by how many frames cameras run late, as saga check does, and pairs
 * their frames accordingly: if --late is auto, or if videos have unequal
 * lengths and nothing says how they belong together.
 */
#include "encode_session.h"

#include "alloc.h"
#include "survey.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Most frames that are looked at. What moves within ten seconds suffices. */
enum { MOST_FRAMES = 300, NUMBER_NBYTES = 32 };

/* Appends NAME=FRAMES for each camera that is late. Sets *n_unknown to the
 * number of cameras of which that is unknown. Returns false if memory is
 * short. */
static bool write_late(saga_encode_session *s, const saga_capture *c,
                       const saga_survey *survey, int *n_unknown)
{
    const size_t most = (size_t)c->n_views * (SAGA_NAME_NBYTES + NUMBER_NBYTES);
    size_t n = 0;

    s->poses.late = saga_alloc(most + 1, 1, s->capture_name, &s->error);
    if (!s->poses.late)
        return false;
    s->poses.late[0] = '\0';
    *n_unknown = 0;
    for (int v = 0; v < c->n_views; v++) {
        const saga_lateness *const late = &survey->views[v].late;

        *n_unknown += isnan(late->frames);
        if (fabs(late->frames) > late->tolerance)
            n += (size_t)snprintf(s->poses.late + n, most + 1 - n, "%s%s=%.3g",
                                  n ? "," : "", c->views[v].name,
                                  saga_lateness_likely(late));
    }
    return true;
}

static void tell(const saga_encode_session *s, const saga_capture *c,
                 int n_unknown)
{
    if (s->poses.late[0])
        saga_cli_error(0,
                       "encode: by what moves, frames are paired as with "
                       "--late %s; give other commands the same option",
                       s->poses.late);
    else
        saga_cli_error(0, "encode: by what moves, no camera is late");
    if (n_unknown)
        saga_cli_error(0,
                       "encode: of %d of %d cameras what moves does not "
                       "tell whether they are late",
                       n_unknown, c->n_views);
}

/* Measures the cameras and sets s->poses.late. `unequal` has the error of
 * videos with unequal lengths; it is reported if a camera remains unknown. */
static int measure(saga_encode_session *s, saga_capture_options *with,
                   const saga_capture *look, const char *unequal)
{
    const int n = MOST_FRAMES < look->n_frames ? MOST_FRAMES : look->n_frames;
    saga_capture c = { .n_views = 0 };
    saga_survey survey = { .views = NULL };
    int n_unknown = 0, status = SAGA_EXIT_OK;
    bool ok;

    /* Pictures of full size tell more. */
    with->scale = 1;
    with->end_frame = look->first_frame + n;
    ok = saga_capture_load(&c, s->capture_name, with, &s->error) &&
         saga_survey_make(&survey, &c, &s->error) &&
         write_late(s, &c, &survey, &n_unknown);
    saga_meter_end(&s->progress.meter);
    if (!ok)
        status = saga_encode_not_loaded(s);
    else if (unequal[0] && n_unknown)
        status = saga_cli_error(SAGA_EXIT_DATA, "encode: %s", unequal);
    else
        tell(s, &c, n_unknown);
    saga_survey_free(&survey);
    saga_capture_free(&c);
    return status;
}

int saga_encode_synchronise(saga_encode_session *s)
{
    const char *const late = s->o->capture.late;
    const bool asked = late && strcmp(late, "auto") == 0;
    saga_capture_options with = saga_encode_uncut_options(s);
    saga_error unequal = { "" };
    saga_capture look;

    s->progress.meter = (saga_meter){ .quiet = s->o->quiet };
    if (late && !asked)
        return SAGA_EXIT_OK;
    with.late = NULL;
    if (saga_capture_look(&look, s->capture_name, &with, &unequal) && !asked)
        return SAGA_EXIT_OK;
    /* If the capture can be read with any lengths, these were the fault. */
    with.any_length = true;
    if (!saga_capture_look(&look, s->capture_name, &with, &s->error))
        return saga_cli_error(SAGA_EXIT_DATA, "encode: %s", s->error.message);
    return measure(s, &with, &look, unequal.message);
}
