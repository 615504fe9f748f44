/* SPDX-License-Identifier: MIT
 *
 * saga export writes the splats of a file for other programs: a PLY for every
 * frame, or one frame as SPZ or glTF.
 */
#include "alloc.h"
#include "cli.h"
#include "cloud_files.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "film_cloud.h"
#include "model.h"
#include "output.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

typedef struct {
    const char *ply_seq, *spz, *glb;
    saga_cli_pair frames;
    int frame, camera, degree;
} options;

typedef struct {
    const options *o;
    saga_film film;
    saga_film_colours colours;
    bool unwritten;          /* the error is of what was to be written */
    saga_error error;
} session;

static bool make_cloud(saga_cloud *cloud, session *s, uint32_t frame)
{
    const saga_colouring how = { s->o->camera, s->o->degree };

    return saga_film_cloud(cloud, &s->colours, &s->film, frame, how,
                           &s->error);
}

/* Keeps in mind that it was an output that failed. */
static bool written(session *s, bool ok)
{
    s->unwritten = s->unwritten || !ok;
    return ok;
}

/* Says how far the fitted colours are off, where any are. */
static void tell_colours(const session *s)
{
    if (s->colours.rms > 0.0)
        printf("colours: harmonics of degree %d, off by %.1f of 255 (RMS) "
               "towards the rig's cameras\n", s->colours.degree,
               255.0 * s->colours.rms);
}

/* --- A file a frame ------------------------------------------------------ */

static bool write_ply(session *s, const char *folder, uint32_t frame,
                      size_t *n_splats)
{
    char name[32];
    char *path;
    saga_cloud cloud;
    bool ok;

    (void)snprintf(name, sizeof name, "frame_%05" PRIu32 ".ply", frame);
    path = saga_path_join(folder, name, &s->error);
    ok = path && make_cloud(&cloud, s, frame);
    if (ok) {
        *n_splats += cloud.n;
        ok = written(s, saga_cloud_write_ply(path, &cloud, &s->error));
        saga_cloud_free(&cloud);
    }
    free(path);
    return ok;
}

static bool fill_folder(session *s, const char *folder)
{
    const uint32_t first = (uint32_t)s->o->frames.a;
    const uint32_t end = s->o->frames.b ? (uint32_t)s->o->frames.b
                                        : s->film.info.n_frames;
    saga_meter meter = { .quiet = false };
    size_t n = 0;
    bool ok = true;

    for (uint32_t i = first; i < end && ok; i++) {
        char doing[64];

        ok = write_ply(s, folder, i, &n);
        (void)snprintf(doing, sizeof doing, "frame %" PRIu32 " of %" PRIu32,
                       i, s->film.info.n_frames);
        saga_meter_show(&meter, (i - first + 1.0) / (end - first), doing);
    }
    saga_meter_end(&meter);
    if (ok)
        printf("%s: %" PRIu32 " frames, %.0f splats a frame\n", s->o->ply_seq,
               end - first, (double)n / (end - first));
    return ok;
}

static bool write_ply_seq(session *s)
{
    const char *const path = s->o->ply_seq;
    char *folder;
    int lock;
    bool ok;

    if (s->film.info.n_frames <= (uint32_t)s->o->frames.a ||
        s->film.info.n_frames < (uint32_t)s->o->frames.b)
        return saga_fail(&s->error, s->film.name, "give a range inside them",
                         "--frames %d:%d goes beyond its %" PRIu32 " frames",
                         (int)s->o->frames.a, (int)s->o->frames.b,
                         s->film.info.n_frames);
    /* Frames are written under another name, which is given up for the wanted
     * one when all are there. */
    folder = saga_output_folder(path, &lock, &s->error);
    if (!written(s, folder != NULL))
        return false;
    ok = fill_folder(s, folder) &&
         written(s, rename(folder, path) == 0 || saga_fail_errno(
             &s->error, path, "remove it or choose another name",
             "is in the way"));
    /* The lock goes first: saga_output_sweep removes what nobody has locked. */
    close(lock);
    if (!ok)
        (void)saga_output_sweep(path);
    free(folder);
    return ok;
}

/* --- A frame ------------------------------------------------------------- */

static bool write_frame(session *s)
{
    const options *const o = s->o;
    saga_cloud cloud;
    bool ok;

    if (!o->spz && !o->glb)
        return true;
    if (!make_cloud(&cloud, s, (uint32_t)o->frame))
        return false;
    ok = written(s, (!o->spz || saga_cloud_write_spz(o->spz, &cloud,
                                                     &s->error)) &&
                    (!o->glb || saga_cloud_write_glb(o->glb, &cloud,
                                                     &s->error)));
    for (int i = 0; i < 2 && ok; i++) {
        const char *const name = i ? o->glb : o->spz;

        if (name)
            printf("%s: frame %d, %zu splats\n", name, o->frame, cloud.n);
    }
    saga_cloud_free(&cloud);
    return ok;
}

static int export_all(session *s, const char *name, const saga_bytes *bytes)
{
    int status = SAGA_EXIT_OK;

    if (saga_film_open(&s->film, name, bytes->data, bytes->nbytes, 1,
                       &s->error) &&
        (!s->o->ply_seq || write_ply_seq(s)) && write_frame(s))
        tell_colours(s);
    else
        status = s->unwritten ? SAGA_EXIT_USAGE : SAGA_EXIT_DATA;
    if (status)
        saga_cli_error(status, "export: %s", s->error.message);
    free(s->colours.harmonics);
    saga_film_close(&s->film);
    return status;
}

static int check_options(const options *o)
{
    if (!o->ply_seq && !o->spz && !o->glb)
        return saga_cli_error(SAGA_EXIT_USAGE, "export: give --ply-seq DIR, "
                              "--spz FILE or --glb FILE; `saga help export` "
                              "explains");
    if (o->ply_seq && access(o->ply_seq, F_OK) == 0)
        return saga_cli_error(SAGA_EXIT_USAGE, "export: %s: exists; remove it "
                              "or choose another name", o->ply_seq);
    return SAGA_EXIT_OK;
}

static int run(int argc, char **argv)
{
    options o = { .camera = -1, .degree = 1 };
    session s = { .o = &o, .colours = { .segment = -1 } };
    const char *name;
    saga_bytes bytes;
    int status = saga_cli_parse(&saga_command_export, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = check_options(&o);
    if (status)
        return status;
    if (!saga_read_file(&bytes, name, &s.error))
        return saga_cli_error(SAGA_EXIT_USAGE, "export: %s", s.error.message);
    status = export_all(&s, name, &bytes);
    saga_bytes_free(&bytes);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--ply-seq", "DIR", "a PLY for each frame, in a new folder",
      saga_cli_text, offsetof(options, ply_seq), 0, 0 },
    { "--frames", "A:B", "... of frames A to B - 1 alone", saga_cli_range,
      offsetof(options, frames), 0, INT32_MAX },
    { "--spz", "FILE", "one frame as SPZ (version 3)", saga_cli_text,
      offsetof(options, spz), 0, 0 },
    { "--glb", "FILE", "one frame as binary glTF (KHR_gaussian_splatting)",
      saga_cli_text, offsetof(options, glb), 0, 0 },
    { "--frame", "N", "... which (default 0)", saga_cli_int,
      offsetof(options, frame), 0, INT32_MAX },
    { "--sh", "0|1|2|3", "colours that depend on the view: spherical "
      "harmonics of\nthis degree, fitted to what the decoder shows the rig\n"
      "(default 1)",
      saga_cli_int, offsetof(options, degree), 0, SAGA_MAX_DEGREE },
    { "--camera", "N", "... or as camera N of the rig sees them",
      saga_cli_int, offsetof(options, camera), 0, 65535 }
};

const saga_command saga_command_export = {
    "export", "FILE", 1,
    "its splats for other programs: PLY, SPZ, glTF",
    "Writes the splats that frames of a .saga file show, for viewers and\n"
    "editors of Gaussian splatting. Positions are in the capture's own units.\n"
    "PLY has its axes, which viewers take as x right, y down, z forward; SPZ\n"
    "has half a turn around x, glTF around z, since y is up there. Opacity\n"
    "is what the moment leaves of it; splats below the decoder's cut of 1/256\n"
    "are left out.\n"
    "\n"
    "  saga export scene.saga --ply-seq scene-ply\n"
    "  saga export scene.saga --glb scene.glb --frame 12\n"
    "\n"
    "PLY and glTF hold all numbers as the decoder has them; SPZ rounds. A\n"
    "viewer's pictures still differ from `saga render`: colours that depend\n"
    "on the view are fitted; an opacity above 1, which makes a flat top,\n"
    "becomes a wider splat; most viewers widen splats by 0.3 square pixels,\n"
    "ours by 0.1; they round in float. docs/results/export.md tells what each\n"
    "does, and how near it comes.\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
