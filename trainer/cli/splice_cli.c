/* SPDX-License-Identifier: MIT
 *
 * saga cut copies some of a file's frames, and saga join concatenates files.
 * Nothing is trained or decoded.
 */
#include "cli.h"
#include "commands.h"
#include "container.h"
#include "error.h"
#include "file.h"
#include "output.h"
#include "part_record.h"
#include "saga.h"
#include "splice.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST_PARTS = SAGA_CLI_MOST_ARGUMENTS };

typedef struct {
    const char *out;
    int n_layers;    /* layers that cut keeps; 0: all */
    bool allow_gaps; /* join films although parts are missing */
} options;

static bool has_sound(const uint8_t *bytes, size_t n)
{
    saga_sound sound;

    return saga_find_sound(&sound, bytes, n) == SAGA_OK;
}

/* Warns if a part has sound but the whole file has none. */
static void report_sound(const uint8_t *bytes, size_t n,
                         const saga_splice_part *part, int n_parts)
{
    bool had = false;

    for (int i = 0; i < n_parts && !had; i++)
        had = has_sound(part[i].bytes, part[i].nbytes);
    if (had && !has_sound(bytes, n))
        printf("The sound is left out; `saga mux` can add it again.\n");
}

/* Sorts parts that were trained apart, and refuses a film with gaps. Sets *all
 * to what the film is recorded to hold; its count is 0 if it is a whole film,
 * or of unknown segments. */
static int arrange(saga_part_record *all, const options *o,
                   saga_splice_part *part, int n_parts)
{
    saga_error error = { "" };
    char missing[200];
    bool inside;

    if (!saga_part_arrange(all, missing, sizeof missing, &inside, part, n_parts,
                           &error))
        return saga_cli_error(SAGA_EXIT_DATA, "join: %s", error.message);
    if (missing[0] && !o->allow_gaps)
        return saga_cli_error(SAGA_EXIT_DATA,
                              "join: of %" PRIu32 " segments, "
                              "numbered from 0, these are missing: %s; give "
                              "their parts too, or --allow-gaps",
                              all->count, missing);
    if (missing[0])
        saga_cli_error(0,
                       "join: of %" PRIu32 " segments, numbered from 0, "
                       "these are missing: %s",
                       all->count, missing);
    /* A film with a gap inside holds no run of segments, and can be no part of
     * a later join. */
    if (!missing[0] || inside)
        all->count = 0;
    return SAGA_EXIT_OK;
}

static int write_splice(const char *command, const char *path,
                        const saga_splice_part *part, int n_parts,
                        const saga_part_record *record)
{
    saga_error error = { "" };
    uint8_t *bytes;
    size_t n;
    int status = SAGA_EXIT_OK;

    if (!saga_splice(&bytes, &n, part, n_parts, &error))
        status = SAGA_EXIT_DATA;
    else if ((record->count &&
              !saga_part_write(path, bytes, n, record, &error)) ||
             !saga_output_write(path, bytes, n, &error))
        status = SAGA_EXIT_USAGE;
    if (status) {
        saga_cli_error(status, "%s: %s", command, error.message);
    } else {
        /* A file of this name may have been a part. */
        if (!record->count)
            saga_part_forget(path);
        saga_cli_print("%s: %zu bytes", path, n);
        report_sound(bytes, n, part, n_parts);
    }
    free(bytes);
    return status;
}

/* Reads the files part[].name, splices them, and frees them. */
static int splice_files(const char *command, const options *o,
                        saga_splice_part *part, int n_parts)
{
    saga_part_record record = { 0, 0, 0, 0 };
    saga_bytes file[MOST_PARTS] = { { NULL, 0 } };
    saga_error error = { "" };
    int status = SAGA_EXIT_OK;

    if (!o->out)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "%s: -o OUT is missing; see "
                              "`saga help %s`",
                              command, command);
    /* All files stay in memory, because the parts point into them. */
    for (int i = 0; i < n_parts && !status; i++) {
        if (!saga_read_file(&file[i], part[i].name, &error))
            status = saga_cli_error(SAGA_EXIT_USAGE, "%s: %s", command,
                                    error.message);
        part[i].bytes = file[i].data;
        part[i].nbytes = file[i].nbytes;
    }
    if (!status && n_parts > 1)
        status = arrange(&record, o, part, n_parts);
    if (!status)
        status = write_splice(command, o->out, part, n_parts, &record);
    for (int i = 0; i < n_parts; i++)
        saga_bytes_free(&file[i]);
    return status;
}

static int run_cut(int argc, char **argv)
{
    static const saga_cli_option frames = { .min = 0, .max = INT32_MAX };
    options o = { .out = NULL };
    const char *argument[2];
    saga_cli_pair range = { 0, 0 };
    saga_splice_part part = { .name = NULL };
    int status = saga_cli_parse(&saga_command_cut, &o, argument, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (!saga_cli_range(&range, argument[1], &frames))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "cut: '%s' is not a range of "
                              "frames; give A:B, like 0:24, for frames A to B "
                              "- 1",
                              argument[1]);
    part.name = argument[0];
    part.first = (uint32_t)range.a;
    part.end = (uint32_t)range.b;
    part.n_layers = (uint32_t)o.n_layers;
    return splice_files("cut", &o, &part, 1);
}

static int run_join(int argc, char **argv)
{
    options o = { .out = NULL };
    const char *name[MOST_PARTS + 1] = { NULL };
    saga_splice_part part[MOST_PARTS];
    int n = 0;
    int status = saga_cli_parse(&saga_command_join, &o, name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    for (; name[n]; n++)
        part[n] = (saga_splice_part){ .name = name[n] };
    return splice_files("join", &o, part, n);
}

static const saga_cli_option option_list[] = {
    { "-o", "OUT", "the file to write", saga_cli_text, offsetof(options, out),
      0, 0 },
    { "--layers", "K", "keep only the first K layers of each segment",
      saga_cli_int, offsetof(options, n_layers), 1, SAGA_MAX_LAYERS }
};

static const saga_cli_option join_list[] = {
    { "-o", "OUT", "the file to write", saga_cli_text, offsetof(options, out),
      0, 0 },
    { "--allow-gaps", NULL,
      "join parts of `saga encode --only` although some are\n"
      "missing, and say which",
      saga_cli_flag, offsetof(options, allow_gaps), 0, 0 }
};

const saga_command saga_command_cut = {
    "cut",
    "FILE A:B",
    2,
    "copies some frames into a new file",
    "Writes frames A to B - 1 of a .saga file as a new file, without decoding\n"
    "them; bytes and pixels stay the same. A missing A is the first frame, a\n"
    "missing B the end, so that 24: means all from frame 24 on. Segments can\n"
    "only be copied whole, so the range must begin and end where segments do;\n"
    "`saga info` lists them.\n"
    "\n"
    "If a file was made with `saga encode --layers`, --layers drops the last\n"
    "layers, which saves bytes and makes the picture coarser: `saga cut FILE\n"
    ": --layers 1` keeps the first layer of all frames. Sound is kept only if\n"
    "all frames are kept.\n",
    option_list,
    2,
    run_cut,
    NULL
};

const saga_command saga_command_join = {
    "join",
    "A B...",
    2,
    "appends files to each other",
    "Writes a .saga file that shows A, then B and so on, without decoding.\n"
    "The files must have the same networks, model, cameras and frame rate.\n"
    "This is so if `saga cut` cut them from one file, or if `saga encode\n"
    "--only` made them for one capture. Files of separate encodings have\n"
    "different networks, and are refused. Sound is left out. At most 1,024\n"
    "files are joined at once; join more in several steps.\n"
    "\n"
    "Pieces of `saga cut` may be given in any order, and more than once.\n"
    "Parts of `saga encode --only` have a record, FILE.part, beside them.\n"
    "They are joined in the order of their segments, and a segment that is\n"
    "missing or there twice is an error.\n",
    join_list,
    2,
    run_join,
    NULL
};
