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
#include "cube.h"
#include "error.h"
#include "file.h"
#include "import_cameras.h"
#include "level_room.h"
#include "model.h"
#include "output.h"
#include "policy.h"
#include "preset.h"
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
    int primitives, iterations, level, seed, threads, memory;
    double lambda, fps;
    bool quiet;
} options;

typedef struct {
    const options *o;
    const char *splats; /* a file, or a folder of a sequence */
    char **path;        /* (n_paths) */
    int n_paths;
    int n_frames;           /* as many, or those of a file of moving splats */
    saga_cloud first;       /* splats of the first frame */
    saga_cloud_facts facts; /* what was not as it should be, in all frames */
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
    char **const path = saga_realloc(s->path, (size_t)s->n_paths + 1,
                                     sizeof *path, "file names", &s->error);

    if (!path)
        return false;
    s->path = path;
    path[s->n_paths] = saga_path_join(folder, name, &s->error);
    return path[s->n_paths] && ++s->n_paths;
}

static bool is_splats(const char *name)
{
    return saga_cloud_format_of(name) != NULL;
}

/* Adds the files of a folder, of which all must have the same format, so that
 * other files in the folder do not become frames. */
static bool add_files(session *s, const saga_names *names)
{
    const saga_cloud_format *const first =
        names->n ? saga_cloud_format_of(names->at[0]) : NULL;
    char known[SAGA_SUFFIXES_NBYTES];

    saga_cloud_suffixes(known);
    if (!first)
        return saga_fail(&s->error, s->splats,
                         "give a folder with a file for "
                         "each frame",
                         "has no file of splats (%s)", known);
    if (names->n > MOST_FILES)
        return saga_fail(&s->error, s->splats, "take fewer",
                         "has more than %d "
                         "files of splats",
                         MOST_FILES);
    for (size_t i = 0; i < names->n; i++) {
        const saga_cloud_format *const f = saga_cloud_format_of(names->at[i]);

        if (f != first)
            return saga_fail(&s->error, s->splats,
                             "leave only one format in "
                             "the folder",
                             "has files of different formats "
                             "(%s, %s)",
                             first->suffix, f->suffix);
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

static uint64_t most_nbytes(const session *s)
{
    return (uint64_t)s->o->memory << 30;
}

static bool read_first(session *s)
{
    if (!saga_cloud_read(&s->first, s->path[0], most_nbytes(s), &s->error))
        return false;
    s->n_frames = s->n_paths == 1 && s->first.n_frames ? (int)s->first.n_frames
                                                       : s->n_paths;
    return true;
}

/* --- What it would need -------------------------------------------------- */

/* Returns the number of primitives of a still. */
static size_t n_wanted(const session *s)
{
    const size_t n = (size_t)s->o->primitives;

    return n && n < s->first.n ? n : s->first.n;
}

/* Returns the memory of training a still with n primitives, without the file
 * that the splats come from. */
static double train_nbytes(const session *s, size_t n)
{
    double largest = 0, pictures = 0;

    for (int v = 0; v < s->cameras.n_views; v++) {
        const double nbytes = (double)saga_view_frame_nbytes(
            &s->cameras.view[v]);

        pictures += nbytes;
        largest = fmax(largest, nbytes / 3);
    }
    return saga_plan_memory((double)n, largest) + pictures +
           (double)saga_cloud_nbytes(s->first.n, s->first.degree);
}

/* Returns how many of n primitives of a still fit a level. */
static uint32_t room_of(int level, size_t n)
{
    saga_train_options o = saga_train_defaults();

    o.level = level;
    o.motion = SAGA_TRAIN_STILL;
    return saga_room_sure(&o, n < UINT32_MAX ? (uint32_t)n : UINT32_MAX);
}

/* Refuses a still for which the level or the memory has no room, before
 * anything is drawn. */
static bool check_size(session *s)
{
    const int level = s->o->level, top = SAGA_N_PROFILES - 1;
    const size_t n = n_wanted(s), room = room_of(level, n);
    const double need = 0x1p-30 * train_nbytes(s, n);
    char remedy[128];

    if (s->n_frames > 1)
        return true;
    (void)snprintf(remedy, sizeof remedy,
                   "give %s--primitives %zu, which "
                   "keeps the most visible",
                   level < top && room_of(top, n) == n ? "--level 3, or " : "",
                   room);
    if (room < n)
        return saga_fail(&s->error, s->path[0], remedy,
                         "has %zu splats, level "
                         "%d has room for %zu",
                         n, level, room);
    (void)snprintf(remedy, sizeof remedy,
                   "give --memory %.0f, or fewer "
                   "--primitives, which keeps the most visible",
                   ceil(need));
    return need <= s->o->memory ||
           saga_fail(&s->error, s->path[0], remedy,
                     "takes %.1f GiB to train "
                     "with %zu splats; --memory allows %d",
                     need, n, s->o->memory);
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
static void set_options(saga_train_options *o, session *s)
{
    const options *const from = s->o;
    const bool still = s->n_frames == 1;
    const int n = from->iterations;

    *o = saga_train_defaults();
    o->n_primitives = still              ? (uint32_t)n_wanted(s)
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
                                             o->n_primitives)
                        : 0.0;
    o->n_iterations = n ? n : o->n_iterations;
    if (!still)
        return;
    /* The given splats replace the warm-up, which must nevertheless have one
     * iteration. */
    o->n_warm = 1;
    o->n_render = n ? n : 1500;
    o->given = &s->given;
}

static bool train(session *s)
{
    saga_train_options o;

    set_options(&o, s);
    s->train = saga_train_new(&s->capture, &o, &s->error);
    s->meter = (saga_meter){ .quiet = s->o->quiet };
    return s->train && saga_train_run(s->train, &s->error) == SAGA_DONE;
}

static bool draw(session *s)
{
    const saga_cloud_source source = { .path = s->path,
                                       .moves = s->n_frames != s->n_paths,
                                       .n_frames = s->n_frames,
                                       .first = &s->first,
                                       .most_nbytes = most_nbytes(s),
                                       .facts = &s->facts,
                                       .fps = s->o->fps,
                                       .view = s->cameras.view,
                                       .n_views = s->cameras.n_views,
                                       .progress = saga_meter_progress,
                                       .progress_user = &s->meter };

    s->meter = (saga_meter){ .quiet = s->o->quiet };
    return saga_cloud_capture(&s->capture, &source, &s->error);
}

/* --- What was not as it should be ---------------------------------------- */

/* Tells whether a number of a primitive, in half-cubes, will be clamped. */
static bool is_clamped(double x, int attr)
{
    return x < saga_attributes[attr].lo || x > saga_attributes[attr].hi;
}

/* Counts the primitives that training will clamp. */
static bool count_clamped(session *s)
{
    double *const range = saga_alloc((size_t)s->capture.n_views,
                                     2 * sizeof *range, "cameras", &s->error);
    saga_cube cube;
    const bool ok = range &&
                    saga_cube_fit(&cube, range, &s->capture, &s->error);

    for (size_t i = 0; i < s->first.n && ok; i++) {
        bool moved = false, resized = false;

        for (size_t a = 0; a < 3; a++) {
            const double x = (double)s->given.mean[3 * i + a];
            const double scale = (double)s->given.log2_scale[3 * i + a];

            moved |= is_clamped((x - cube.centre[a]) / cube.unit,
                                SAGA_ATTR_MEAN);
            resized |= is_clamped(scale - log2(cube.unit),
                                  SAGA_ATTR_LOG2_SCALE);
        }
        s->facts.count[SAGA_FACT_MOVED] += moved;
        s->facts.count[SAGA_FACT_RESIZED] += resized;
    }
    free(range);
    return ok;
}

/* Makes the primitives of a still, and tells what became of the splats. */
static bool prepare(session *s)
{
    char line[SAGA_FACTS_NBYTES];
    int from = 0;

    if (s->n_frames == 1 &&
        !(saga_cloud_thin(&s->first, n_wanted(s), &s->error) &&
          saga_cloud_params(&s->given, &s->first, s->cameras.view,
                            s->cameras.n_views, &s->error) &&
          count_clamped(s)))
        return false;
    saga_cloud_facts_add(&s->facts, &s->first.facts);
    saga_meter_end(&s->meter);
    while (saga_cloud_facts_line(line, &from, &s->facts))
        (void)saga_cli_error(SAGA_EXIT_OK, "import: %s: %s", s->splats, line);
    return true;
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

    saga_cli_print("%s: %zu bytes, level %" PRIu32 "; %d frame%s, %" PRIu32
                   " primitives, lambda %.4g",
                   s->o->out, r->sizes.total, r->info.level, s->n_frames,
                   s->n_frames == 1 ? "" : "s", r->n.prim, r->lambda);
    printf("%.2f dB against pictures of the original splats (%d pictures)\n",
           r->coded.training, r->coded.n_training);
}

static void free_session(session *s)
{
    saga_train_free(s->train);
    saga_params_free(&s->given);
    saga_capture_free(&s->capture);
    saga_cloud_free(&s->first);
    free(s->cameras.view);
    for (int i = 0; i < s->n_paths; i++)
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
        ok = list_files(s) && read_first(s) &&
             saga_import_find_cameras(&s->cameras) && check_size(s) &&
             draw(s) && prepare(s) && train(s);
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
    free_session(s);
    return status;
}

/* Reports a path that cannot be read. Returns whether that is so. */
static bool cannot_read(const char *path)
{
    if (access(path, R_OK) == 0)
        return false;
    saga_cli_error(SAGA_EXIT_USAGE,
                   "import: %s: cannot be opened (%s); check "
                   "the name and the permissions",
                   path, strerror(errno));
    return true;
}

static int run_import(int argc, char **argv)
{
    options o = { .level = 2, .seed = 1, .fps = 30, .memory = 4 };
    session s = { .o = &o,
                  .cameras = { .first = &s.first, .error = &s.error } };
    const int status = saga_cli_parse(&saga_command_import, &o, &s.splats, argc,
                                      argv);

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
    { "-o", "OUT", "the .saga file to write", saga_cli_text,
      offsetof(options, out), 0, 0 },
    { "--cameras", "FILE",
      "cameras to judge the result by: those of a .saga file, or\n"
      "a path as for `saga render --path` (default: 24 cameras\n"
      "all round that look inwards)",
      saga_cli_text, offsetof(options, cameras), 0, 0 },
    { "--size", "WxH",
      "size of their pictures (default 400x400, or the size in\n"
      "FILE)",
      saga_cli_size, offsetof(options, size), 8, SAGA_MAX_SIDE },
    { "--primitives", "N",
      "number of primitives of a sequence (default 5000); of a\n"
      "single file, the N most visible splats are kept\n"
      "(default: all)",
      saga_cli_int, offsetof(options, primitives), 1, 1 << 22 },
    { "--memory", "GIB",
      "most memory for splats, pictures and training, in "
      "GiB\n(default 4)",
      saga_cli_int, offsetof(options, memory), 1, 1 << 16 },
    { "--iterations", "N",
      "training steps (default 6000, for a single file 1500)", saga_cli_int,
      offsetof(options, iterations), 2, 10000000 },
    { "--lambda", "L", "price of a bit, as for `saga encode`", saga_cli_real,
      offsetof(options, lambda), 0, 0 },
    { "--level", "0|1|2|3",
      "limit on the memory of the decoder, as for `saga encode`\n"
      "(default 2)",
      saga_cli_int, offsetof(options, level), 0, 3 },
    { "--fps", "F", "frames per second of a sequence (default 30)",
      saga_cli_real, offsetof(options, fps), 0, 0 },
    { "--seed", "N", "seed of all random numbers (default 1)", saga_cli_int,
      offsetof(options, seed), 0, INT32_MAX },
    { "--threads", "N",
      "number of threads (default: all cores); the file does not\n"
      "depend on it",
      saga_cli_int, offsetof(options, threads), 1, 1024 },
    SAGA_CLI_QUIET(options, quiet)
};

const saga_command saga_command_import = {
    "import",
    "SPLATS",
    1,
    "makes a file of splats from any trainer (PLY, ...)",
    "Codes splats that another program trained; no pictures are needed.\n"
    "SPLATS is a file, or a folder with a file for each frame in the order of\n"
    "the names (f2 before f10), in one of the formats that `saga help export`\n"
    "lists. A single file keeps its splats: networks are fitted to them and\n"
    "then improved. A sequence is trained anew, as one segment, because files\n"
    "do not say which splats of two frames belong together. What is left out,\n"
    "clamped or read otherwise than the format says is counted in a line for\n"
    "each kind. A file of moving splats (FTGS PLY) is a sequence of as many\n"
    "frames as its header says, at --fps.\n"
    "\n"
    "The training compares pictures that are drawn from the splats, for\n"
    "cameras all round the scene. What none of these cameras sees comes out\n"
    "badly, so give cameras inside a room with --cameras.\n"
    "\n"
    "  saga import chair.spz -o chair.saga\n"
    "  saga import frames -o scene.saga --cameras old.saga\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_import,
    NULL
};
