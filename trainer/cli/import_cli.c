/* SPDX-License-Identifier: MIT
 *
 * saga import encodes splats that another program trained, without its
 * pictures. It draws the splats for cameras all around them, or for given
 * cameras, and trains with the pictures drawn.
 */
#include "alloc.h"
#include "cli.h"
#include "cloud_capture.h"
#include "cloud_files.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "import_cameras.h"
#include "output.h"
#include "policy.h"
#include "train.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MOST_FILES = 65535 };

/* Lambda is chosen for this mean squared error between the file's and the
 * splats' pictures, which is 40 dB. */
#define WANTED_MSE 1e-4

typedef struct {
    const char *out, *cameras;
    saga_cli_pair size;
    int primitives, iterations, level, seed, threads;
    double lambda, fps;      /* fps: NaN if it is not given */
    bool quiet;
} options;

typedef struct {
    const options *o;
    const char *splats;      /* a file, or a folder of a sequence */
    char **path;             /* (n_files) */
    int n_files, n_frames;
    saga_bytes bytes;        /* of the sequence */
    saga_cloud_sequence *sequence; /* or NULL: each frame is a file */
    saga_cloud first;        /* splats of the first frame */
    saga_import_cameras cameras;
    saga_capture capture;
    saga_splat_params given;
    saga_train *train;
    saga_output out;
    saga_meter meter;
    saga_error error;
} session;

/* --- Files --------------------------------------------------------------- */

static bool add_file(session *s, const char *folder, const char *name)
{
    char **const path = saga_realloc(s->path, (size_t)s->n_files + 1,
                                     sizeof *path, "file names", &s->error);

    if (!path)
        return false;
    s->path = path;
    path[s->n_files] = saga_path_join(folder, name, &s->error);
    return path[s->n_files] && ++s->n_files;
}

static bool is_splats(const char *name)
{
    return saga_cloud_format_of(name) != NULL;
}

/* Adds the files of a folder, of which all must have the same format, so that
 * other files in the folder do not become frames. */
static bool add_files(session *s, const saga_names *names)
{
    const saga_cloud_format *const first = names->n
        ? saga_cloud_format_of(names->at[0]) : NULL;
    char known[SAGA_SUFFIXES_NBYTES];

    saga_cloud_suffixes(known);
    if (!first)
        return saga_fail(&s->error, s->splats, "give a folder with a file for "
                         "each frame", "has no file of splats (%s)", known);
    if (names->n > MOST_FILES)
        return saga_fail(&s->error, s->splats, "take fewer", "has more than %d "
                         "files of splats", MOST_FILES);
    for (size_t i = 0; i < names->n; i++) {
        const saga_cloud_format *const f = saga_cloud_format_of(names->at[i]);

        if (f != first)
            return saga_fail(&s->error, s->splats, "leave only one format in "
                             "the folder", "has files of different formats "
                             "(%s, %s)", first->suffix, f->suffix);
        if (!add_file(s, s->splats, names->at[i]))
            return false;
    }
    return true;
}

static bool list_files(session *s)
{
    saga_names names;
    bool ok;

    if (!saga_path_is_folder(s->splats))
        return add_file(s, NULL, s->splats);
    /* A still as SOG may be a folder, too. */
    if (saga_folder_has(s->splats, "meta.json"))
        return add_file(s, s->splats, "meta.json");
    ok = saga_folder_list(&names, s->splats, is_splats, &s->error) &&
         add_files(s, &names);
    saga_names_free(&names);
    return ok;
}

static bool is_sequence(const char *path)
{
    uint8_t first[SAGA_SEQUENCE_HEAD_NBYTES];
    saga_bytes bytes = { first, 0 };
    FILE *const f = fopen(path, "rb");

    if (f) {
        bytes.nbytes = fread(first, 1, sizeof first, f);
        fclose(f);
    }
    return saga_is_sequence(&bytes);
}

/* Opens a sequence, if the only file is one. */
static bool open_sequence(session *s)
{
    s->n_frames = s->n_files;
    if (s->n_files > 1 || !is_sequence(s->path[0]))
        return true;
    if (!saga_read_file(&s->bytes, s->path[0], &s->error))
        return false;
    s->sequence = saga_sequence_open(&s->bytes, s->path[0], s->o->fps,
                                     &s->error);
    s->n_frames = s->sequence ? saga_sequence_n_frames(s->sequence) : 0;
    return s->sequence != NULL;
}

static bool read_first(session *s)
{
    return s->sequence
        ? saga_sequence_read(&s->first, s->sequence, 0, &s->error)
        : saga_cloud_read(&s->first, s->path[0], &s->error);
}

/* --- Training ------------------------------------------------------------ */

static bool progress(void *user, const saga_train_progress *p)
{
    session *const s = user;
    char doing[96];

    (void)snprintf(doing, sizeof doing, "%s %d of %d  %.1f dB", p->name,
                   p->iteration, p->n_iterations, p->psnr);
    saga_meter_show(&s->meter, p->done, doing);
    return true;
}

static double pixels_of(const saga_capture *c)
{
    double n = 0.0;

    for (int v = 0; v < c->n_views; v++)
        n += (double)c->views[v].width * c->views[v].height * c->n_frames;
    return n;
}

/* Sets the training's options. A still starts from its own splats; a sequence
 * is learned from nothing. */
static bool set_options(saga_train_options *o, session *s)
{
    const options *const from = s->o;
    const bool still = s->n_frames == 1;
    const int n = from->iterations;

    *o = saga_train_defaults();
    o->n_primitives = still ? (uint32_t)s->first.n
                    : from->primitives ? (uint32_t)from->primitives
                    : o->n_primitives;
    o->level = from->level;
    o->seed = (uint64_t)from->seed;
    o->progress = progress;
    o->progress_user = s;
    /* A sequence gets its lambda from the error after the warm-up. A still has
     * no warm-up, so its lambda follows from WANTED_MSE. */
    o->lambda = from->lambda > 0.0 ? from->lambda
              : still ? saga_policy_lambda(WANTED_MSE, pixels_of(&s->capture),
                                           o->n_primitives) : 0.0;
    o->n_iterations = n ? n : o->n_iterations;
    if (!still)
        return true;
    /* The given splats replace the warm-up, which must nevertheless have one
     * iteration. */
    o->n_warm = 1;
    o->n_render = n ? n : 1500;
    if (!saga_cloud_params(&s->given, &s->first, s->cameras.shot,
                           s->cameras.n_shots, &s->error))
        return false;
    o->given = &s->given;
    return true;
}

static bool train(session *s)
{
    saga_train_options o;

    if (!set_options(&o, s))
        return false;
    s->train = saga_train_new(&s->capture, &o, &s->error);
    s->meter = (saga_meter){ .quiet = s->o->quiet };
    return s->train && saga_train_run(s->train, &s->error) == SAGA_DONE;
}

static bool draw(session *s)
{
    const saga_cloud_source source = {
        .path = s->path, .sequence = s->sequence, .n_frames = s->n_frames,
        .fps = s->sequence ? saga_sequence_fps(s->sequence)
             : isnan(s->o->fps) ? 30.0 : s->o->fps,
        .shot = s->cameras.shot, .n_shots = s->cameras.n_shots,
        .progress = saga_meter_progress, .progress_user = &s->meter
    };

    s->meter = (saga_meter){ .quiet = s->o->quiet };
    return saga_cloud_capture(&s->capture, &source, &s->error);
}

static bool write_file(session *s)
{
    size_t n;
    const uint8_t *const bytes = saga_train_bytes(s->train, &n);

    return saga_output_close(&s->out, fwrite(bytes, 1, n, s->out.file) == n,
                             &s->error);
}

static void tell(const session *s)
{
    const saga_train_report *const r = saga_train_report_of(s->train);

    printf("%s: %zu bytes, level %" PRIu32 "; %d frame%s, %" PRIu32
           " primitives, lambda %.4g\n", s->o->out, r->sizes.total,
           r->info.level, s->n_frames, s->n_frames == 1 ? "" : "s", r->n.prim,
           r->lambda);
    printf("%.2f dB against pictures of the original splats (%d pictures)\n",
           r->coded.training, r->coded.n_training);
}

static void end(session *s)
{
    saga_train_free(s->train);
    saga_params_free(&s->given);
    saga_capture_free(&s->capture);
    saga_cloud_free(&s->first);
    saga_sequence_free(s->sequence);
    saga_bytes_free(&s->bytes);
    free(s->cameras.shot);
    for (int i = 0; i < s->n_files; i++)
        free(s->path[i]);
    free(s->path);
}

static int import(session *s)
{
    int status = SAGA_EXIT_USAGE;
    bool ok;

    /* The output is opened before the training, so that an unwritable name is
     * reported early. */
    if (saga_output_open_alone(&s->out, s->o->out, &s->error)) {
        status = SAGA_EXIT_DATA;
        ok = list_files(s) && open_sequence(s) && read_first(s) &&
             saga_import_find_cameras(&s->cameras) && draw(s) && train(s);
        saga_meter_end(&s->meter);
        if (!ok)
            saga_output_close(&s->out, false, &s->error);
        else
            status = write_file(s) ? SAGA_EXIT_OK : SAGA_EXIT_USAGE;
    }
    if (status)
        saga_cli_error(status, "import: %s", s->error.message);
    else
        tell(s);
    end(s);
    return status;
}

/* Reports a path that cannot be read. Returns whether that is so. */
static bool cannot_read(const char *path)
{
    if (access(path, R_OK) == 0)
        return false;
    saga_cli_error(SAGA_EXIT_USAGE, "import: %s: cannot be opened (%s); check "
                   "the name and the permissions", path, strerror(errno));
    return true;
}

static int run(int argc, char **argv)
{
    options o = { .level = 2, .seed = 1, .fps = NAN };
    session s = { .o = &o, .cameras = { .first = &s.first,
                                        .error = &s.error } };
    const int status = saga_cli_parse(&saga_command_import, &o, &s.splats,
                                      argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (!o.out)
        return saga_cli_error(SAGA_EXIT_USAGE, "import: -o OUT is missing; "
                              "see `saga help import`");
    if (cannot_read(s.splats) || (o.cameras && cannot_read(o.cameras)))
        return SAGA_EXIT_USAGE;
    if (o.fps <= 0.0)
        return saga_cli_error(SAGA_EXIT_USAGE, "import: --fps takes a number "
                              "above 0");
    if (saga_cli_threads("import", o.threads))
        return SAGA_EXIT_USAGE;
    s.cameras.file = o.cameras;
    s.cameras.size = o.size;
    return import(&s);
}

static const saga_cli_option option_list[] = {
    { "-o", "OUT", "the .saga file to write", saga_cli_text, offsetof(options,
      out), 0, 0 },
    { "--cameras", "FILE",
      "cameras to judge the result by: those of a .saga file, or\n"
      "a path as for `saga render --path` (default: 24 cameras\n"
      "all round that look inwards)", saga_cli_text, offsetof(options,
      cameras), 0, 0 },
    { "--size", "WxH",
      "size of their pictures (default 400x400, or the size in\n"
      "FILE)", saga_cli_size, offsetof(options, size), 8, SAGA_MAX_SIDE },
    { "--primitives", "N",
      "number of primitives of a sequence (default 5000); a\n"
      "single file keeps its own number", saga_cli_int, offsetof(options,
      primitives), 1, 1 << 22 },
    { "--iterations", "N",
      "training steps (default 6000, for a single file 1500)", saga_cli_int,
      offsetof(options, iterations), 2, 10000000 },
    { "--lambda", "L", "price of a bit, as for `saga encode`", saga_cli_real,
      offsetof(options, lambda), 0, 0 },
    { "--level", "0|1|2|3",
      "limit on the memory of the decoder, as for `saga encode`\n"
      "(default 2)", saga_cli_int, offsetof(options, level), 0, 3 },
    { "--fps", "F",
      "frames per second of a sequence (default 30, or that of\n"
      "the .splat4d file); a .4dgs file is sampled with it",
      saga_cli_real, offsetof(options, fps), 0, 0 },
    { "--seed", "N", "seed of all random numbers (default 1)", saga_cli_int,
      offsetof(options, seed), 0, INT32_MAX },
    { "--threads", "N",
      "number of threads (default: all cores); the file does not\n"
      "depend on it", saga_cli_int, offsetof(options, threads), 1, 1024 },
    SAGA_CLI_QUIET(options, quiet)
};

const saga_command saga_command_import = {
    "import", "SPLATS", 1,
    "makes a file of splats from any trainer (PLY, ...)",
    "Codes splats that another program trained; no pictures are needed.\n"
    "SPLATS is a file, or a folder with a file for each frame in the order of\n"
    "the names (f2 before f10), in one of the formats that `saga help export`\n"
    "lists, or a sequence in a file NAME.splat4d or NAME.4dgs of version 1. A\n"
    "single file of splats keeps them: networks are fitted to them and then\n"
    "improved. A sequence is trained anew, as one segment, because most files\n"
    "do not say which splats of two frames belong together.\n"
    "\n"
    "The training compares pictures that are drawn from the splats, for\n"
    "cameras all round the scene. What none of these cameras sees comes out\n"
    "badly, so give cameras inside a room with --cameras.\n"
    "\n"
    "  saga import chair.spz -o chair.saga\n"
    "  saga import frames -o scene.saga --cameras old.saga\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
