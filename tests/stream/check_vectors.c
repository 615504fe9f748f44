/* SPDX-License-Identifier: MIT
 *
 * check_vectors DIR [PATH]: answers the question of every line of DIR/MANIFEST,
 * DIR/REFUSALS and, if they exist, DIR/PICTURES, DIR/BOXES and DIR/VALUES, and
 * compares with the line. PATH is plain, x4 or avx2 (common/cpu.h) instead of
 * the best one of the machine. The program is plain C without a test library,
 * so that it runs on every target. A missing file is a failure. Prints
 * `N passed, N failed`.
 *
 * check_vectors --answer [LEVEL]: answers the questions of vectors/conform.py,
 * which has their forms, as a decoder that refuses files above a level.
 *
 * check_vectors --init FILE...: see check_init.c.
 *
 * Symbols are read by ref_recorder.h and the shared traversal, everything else
 * through saga.h.
 */
/* The program chooses the SIMD path by this function, which it links instead of
 * the library's cpu.c. */
#define saga_cpu_best machine_best
#include "cpu.c"
#undef saga_cpu_best

#include "check_init.h"
#include "encode.h"
#include "head.h"
#include "plan.h"
#include "ref_recorder.h"
#include "vectors.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    PIXELS_NBYTES = 3 * 640 * 480,
    LEVEL_AT = 12,
    LINE = 1 << 16,
    ANSWER = 256,
    GOOD_LINE = 512,
    MOST_ARGUMENTS = 3,
    BOX_KINDS = SAGA_N_PICTURE_KINDS + 1
};

saga_cpu saga_cpu_best(void);

static saga_cpu cpu;

saga_cpu saga_cpu_best(void)
{
    return cpu;
}

static uint8_t pixels[PIXELS_NBYTES];
static int n_passed, n_failed;

static uint8_t *read_file(const char *dir, const char *name, size_t *n)
{
    char path[1024];
    FILE *f;
    uint8_t *p;
    long size;

    snprintf(path, sizeof path, "%s%s%s", dir, *dir ? "/" : "", name);
    f = fopen(path, "rb");
    if (!f)
        return NULL;
    fseek(f, 0, SEEK_END);
    size = ftell(f);
    fseek(f, 0, SEEK_SET);
    p = malloc((size_t)size + 1);
    *n = p ? fread(p, 1, (size_t)size, f) : 0;
    fclose(f);
    return p;
}

static int read_symbols(uint32_t *crc, const uint8_t *bytes, size_t n,
                        uint32_t number)
{
    saga_net_symbols nets[1 + SAGA_MAX_LAYERS];
    saga_symbols base, s[SAGA_MAX_LAYERS];
    saga_header h;
    saga_plan plan;
    uint32_t final_range[3], n_layers;
    int ok, has_base;

    memset(nets, 0, sizeof nets);
    memset(&base, 0, sizeof base);
    memset(s, 0, sizeof s);
    if (saga_head_read(&h, bytes, n) || saga_plan_make(&plan, &h, 0))
        return 0;
    has_base = (h.model.tools & SAGA_TOOL_BASE) != 0;
    /* A file may be cut behind a layer. */
    for (n_layers = 0; n_layers < saga_n_layers(&h); n_layers++)
        if (!recorder_read(&nets[n_layers], &s[n_layers],
                           RECORDER_LAYER(number, n_layers), final_range, bytes,
                           n))
            break;
    ok = n_layers > 0 &&
         (!has_base || recorder_read(&nets[SAGA_MAX_LAYERS], &base,
                                     RECORDER_BASE, final_range, bytes, n));
    if (ok)
        *crc = saga_symbols_crc(&nets[0], &plan.nets, has_base ? &base : NULL,
                                s, n_layers, &h.model);
    for (uint32_t i = 0; i <= SAGA_MAX_LAYERS; i++)
        saga_net_symbols_free(&nets[i]);
    for (uint32_t i = 0; i < SAGA_MAX_LAYERS; i++)
        recorder_free_symbols(&s[i]);
    recorder_free_symbols(&base);
    return ok;
}

/* --- Answers ------------------------------------------------------------- */

/* Returns the `bits` of a kind of picture or of the boxes, or 0. */
static int bits_of(const char *kind)
{
    for (int i = 0; i < BOX_KINDS; i++)
        if (strcmp(kind, saga_picture_kinds[i].name) == 0)
            return saga_picture_kinds[i].bits;
    return 0;
}

/* Returns whether a kind is the number of a good file's segment. */
static int is_good(const char *kind)
{
    return kind[strspn(kind, "0123456789")] == '\0';
}

/* Returns the number of arguments of a kind of question. */
static int n_arguments(const char *kind)
{
    return strcmp(kind, "name") == 0 || strcmp(kind, "gains") == 0 ? 1
           : strcmp(kind, "time") == 0 || is_good(kind)            ? 2
           : strcmp(kind, "world") == 0 || bits_of(kind)           ? 3
                                                                   : 0;
}

/* Reads the arguments of a kind. Returns where they end, or NULL. */
static const char *read_arguments(int64_t *a, const char *kind,
                                  const char *text)
{
    for (int i = 0; i < n_arguments(kind); i++) {
        char *end;

        a[i] = strtoll(text, &end, 10);
        if (end == text || *end != ' ')
            return NULL;
        text = end + 1;
    }
    return text;
}

static saga_status name_in_hex(char *text, const uint8_t *bytes, size_t n,
                               uint32_t camera)
{
    saga_naming naming;
    const saga_status s = saga_name_camera(&naming, bytes, n, camera);

    if (s)
        return s;
    strcpy(text, *naming.name ? "" : "-");
    for (size_t i = 0; naming.name[i]; i++)
        sprintf(text + 2 * i, "%02x", (uint8_t)naming.name[i]);
    return s;
}

/* Writes the place in the world of a point of the box. */
static saga_status world(char *text, const uint8_t *bytes, size_t n,
                         const int64_t *p)
{
    saga_info info;
    const saga_status s = saga_probe(&info, bytes, n);
    double x[3];

    if (s)
        return s;
    for (int i = 0; i < 3; i++)
        x[i] = ldexp(info.centre_mantissa[i], info.centre_exponent) +
               (double)p[i] * ldexp(info.unit_mantissa, info.unit_exponent);
    snprintf(text, ANSWER, "%.9g %.9g %.9g", x[0], x[1], x[2]);
    return s;
}

/* Writes the fields of the volume. */
static saga_status sector(char *text, const uint8_t *bytes, size_t n)
{
    saga_volume v;
    const saga_status s = saga_find_volume(&v, bytes, n);

    if (!s)
        snprintf(text, ANSWER,
                 "%" PRId32 " %" PRId32 " %" PRId32 " %" PRIu32 " %" PRIu32
                 " %" PRId32 " %d %d %d %d %d %d %u %d %d %u %u %u %u",
                 v.pivot[0], v.pivot[1], v.pivot[2], v.distance_min,
                 v.distance_max, v.floor, v.up[0], v.up[1], v.up[2], v.front[0],
                 v.front[1], v.front[2], v.azimuth, v.elevation_min,
                 v.elevation_max, v.turn, v.start, v.quality_q8[0],
                 v.quality_q8[1]);
    return s;
}

static saga_status stages(char *text, const saga_stages_at *at,
                          const uint8_t *bytes, size_t n)
{
    saga_stages got;
    const saga_status s = saga_stages_of(&got, bytes, n, at->segment, at->t,
                                         at->camera, pixels, sizeof pixels);

    if (!s && !read_symbols(&got.symbols, bytes, n, at->segment))
        snprintf(text, ANSWER, "symbols that cannot be read");
    else if (!s)
        snprintf(text, ANSWER,
                 "%08" PRIx32 " %08" PRIx32 " %08" PRIx32 " %08" PRIx32
                 " %08" PRIx32 " %08" PRIx32 " %08" PRIx32,
                 got.symbols, got.final_range[0], got.final_range[1],
                 got.final_range[2], got.primitives, got.splats, got.frame);
    return s;
}

/* Returns the status of finding the file's last frame. */
static saga_status find_last(const uint8_t *bytes, size_t n)
{
    saga_info info;
    saga_segment seg;
    const saga_status s = saga_probe(&info, bytes, n);

    return s ? s : saga_find(&seg, bytes, n, info.n_frames - 1, 1);
}

static saga_status refusal(const char *kind, const uint8_t *bytes, size_t n)
{
    saga_stages stages;
    saga_exposure exposure;
    saga_naming naming;
    saga_sound sound;
    saga_volume volume;

    return strcmp(kind, "names") == 0   ? saga_name_camera(&naming, bytes, n, 0)
           : strcmp(kind, "sound") == 0 ? saga_find_sound(&sound, bytes, n)
           : strcmp(kind, "volume") == 0 ? saga_find_volume(&volume, bytes, n)
           : strcmp(kind, "exposure") == 0
               ? saga_find_exposure(&exposure, bytes, n, 0)
           : strcmp(kind, "last") == 0
               ? find_last(bytes, n)
               : saga_stages_of(&stages, bytes, n, 0, 0, 0, pixels,
                                sizeof pixels);
}

/* Writes the answer to a question with the arguments a about a file, which is
 * the status if that is not 0. */
static void answer(char *text, const char *kind, const int64_t *a,
                   const uint8_t *bytes, size_t n)
{
    const saga_stages_at at = { (uint32_t)a[0], (int32_t)a[1], (uint32_t)a[2] };
    saga_segment seg;
    saga_exposure e;
    uint32_t crc = 0;
    saga_status s;

    strcpy(text, "0");
    if (is_good(kind)) {
        s = stages(text,
                   &(saga_stages_at){ (uint32_t)strtoul(kind, NULL, 10),
                                      (int32_t)a[0], (uint32_t)a[1] },
                   bytes, n);
    } else if (bits_of(kind)) {
        s = saga_picture_crc(&crc, bytes, n, &at, bits_of(kind));
        snprintf(text, ANSWER, "%08" PRIx32, crc);
    } else if (strcmp(kind, "time") == 0) {
        s = saga_find(&seg, bytes, n, (uint32_t)a[0], (uint32_t)a[1]);
        if (!s)
            snprintf(text, ANSWER, "%" PRIu32 " %" PRId32, seg.number, seg.t);
    } else if (strcmp(kind, "gains") == 0) {
        s = saga_find_exposure(&e, bytes, n, (uint32_t)a[0]);
        if (!s)
            snprintf(text, ANSWER, "%u %u %u", e.gain_q12[0], e.gain_q12[1],
                     e.gain_q12[2]);
    } else if (strcmp(kind, "name") == 0) {
        s = name_in_hex(text, bytes, n, (uint32_t)a[0]);
    } else if (strcmp(kind, "world") == 0) {
        s = world(text, bytes, n, a);
    } else if (strcmp(kind, "sector") == 0) {
        s = sector(text, bytes, n);
    } else {
        s = refusal(kind, bytes, n);
    }
    if (s)
        snprintf(text, ANSWER, "%d", (int)s);
}

/* Returns whether a decoder of the levels up to `top` refuses a file for its
 * level, which is check 10 of opening. */
static int is_above(const uint8_t *bytes, size_t n, int top)
{
    saga_info info;
    const saga_status s = saga_probe(&info, bytes, n);

    return (s == SAGA_OK || s == SAGA_ERR_LEVEL) && bytes[LEVEL_AT] > top;
}

/* Answers every line of the standard input; returns 0 if one has no file. */
static int answer_all(int top)
{
    static char line[LINE];
    char kind[16], text[ANSWER];
    int at = 0;

    while (fgets(line, sizeof line, stdin)) {
        int64_t a[MOST_ARGUMENTS] = { 0 };
        const char *path = NULL;
        uint8_t *bytes;
        size_t n = 0;

        line[strcspn(line, "\n")] = '\0';
        if (sscanf(line, "%15s %n", kind, &at) == 1)
            path = read_arguments(a, kind, line + at);
        bytes = path ? read_file("", path, &n) : NULL;
        if (!bytes)
            return 0;
        if (is_above(bytes, n, top))
            snprintf(text, sizeof text, "%d", (int)SAGA_ERR_LEVEL);
        else
            answer(text, kind, a, bytes, n);
        puts(text);
        free(bytes);
    }
    return 1;
}

/* --- The lists ----------------------------------------------------------- */

/* Reorders a line of a good file, whose question is between the columns:
 * FILE SEGMENT SYMBOLS RANGE RANGE RANGE T CAMERA PRIMITIVES SPLATS FRAME. */
static int reorder(char line[GOOD_LINE], const char *from)
{
    char w[11][40];

    if (sscanf(from, "%39s %39s %39s %39s %39s %39s %39s %39s %39s %39s %39s",
               w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7], w[8], w[9],
               w[10]) != 11)
        return 0;
    snprintf(line, GOOD_LINE, "%s %s %s %s %s %s %s %s %s %s %s\n", w[0], w[1],
             w[6], w[7], w[2], w[3], w[4], w[5], w[8], w[9], w[10]);
    return 1;
}

/* Checks a line FILE KIND ARGUMENTS... ANSWER. */
static int check_line(const char *dir, const char *line)
{
    char name[256], kind[16], ordered[GOOD_LINE], got[ANSWER];
    const char *want = NULL;
    int64_t a[MOST_ARGUMENTS] = { 0 };
    int used = 0, ok = 0;
    uint8_t *bytes;
    size_t n = 0;

    if (sscanf(line, "%255s %15s %n", name, kind, &used) == 2) {
        if (is_good(kind) && reorder(ordered, line))
            line = ordered;
        want = read_arguments(a, kind, line + used);
    }
    if (!want || *want == '\0') {
        printf("FAIL cannot read the line: %s", line);
        return 0;
    }
    bytes = read_file(dir, name, &n);
    if (!bytes) {
        printf("FAIL %s: missing\n", name);
        return 0;
    }
    answer(got, kind, a, bytes, n);
    ok = strlen(got) == strcspn(want, "\n") &&
         strncmp(got, want, strlen(got)) == 0;
    if (!ok)
        printf("FAIL %s %s: %s, not %s", name, kind, got, want);
    free(bytes);
    return ok;
}

/* Applies edits AT:N:HEX to a file, whose bytes become *bytes. Returns 0 if one
 * cannot be read. The text of an edit has at least two bytes for each of its
 * own. */
static int edit(uint8_t **bytes, size_t *n, const char *edits)
{
    const size_t room = *n + strlen(edits) + 1;
    uint8_t *const out = malloc(room);
    size_t from = 0, to = 0;
    unsigned long at, old;
    unsigned byte;
    int used = 0;

    if (!out)
        return 0;
    /* Bytes after the end of the file hold a pattern, so that they cannot be
     * mistaken for those of the previous file. */
    memset(out, 0x55, room);
    while (sscanf(edits, " %lu:%lu:%n", &at, &old, &used) == 2 && used) {
        if (at < from || at > *n || old > *n - at)
            break;
        memcpy(out + to, *bytes + from, at - from);
        to += at - from;
        from = at + old;
        for (edits += used; sscanf(edits, "%2x", &byte) == 1 && *edits != ' ' &&
                            *edits != '\n';
             edits += 2)
            out[to++] = (uint8_t)byte;
        used = 0;
    }
    memcpy(out + to, *bytes + from, *n - from);
    *n = to + *n - from;
    free(*bytes);
    *bytes = out;
    return *edits == '\n';
}

/* Returns whether a file needs an eighth of the addresses of a machine with 32
 * bits. It may not get them, and may be refused for lack of memory. */
static int needs_too_much(const uint8_t *bytes, size_t n)
{
    saga_info info;

    return saga_probe(&info, bytes, n) == SAGA_OK &&
           info.work_nbytes >= SIZE_MAX / 8;
}

static int check_refusal(const char *dir, const char *line)
{
    char rule[32], name[64], kind[16], file[64];
    int status, used = 0, ok = 0;
    uint8_t *bytes;
    size_t n = 0;

    if (sscanf(line, "%31s %63s %15s %d %63s%n", rule, name, kind, &status,
               file, &used) != 5 ||
        !used) {
        printf("FAIL REFUSALS: cannot read the line: %s", line);
        return 0;
    }
    bytes = read_file(dir, file, &n);
    if (!bytes || !edit(&bytes, &n, line + used)) {
        printf("FAIL %s %s: cannot be made from %s\n", rule, name, file);
    } else {
        const saga_status s = refusal(kind, bytes, n);

        ok = (int)s == status ||
             (s == SAGA_ERR_SPACE && needs_too_much(bytes, n));
        if (!ok)
            printf("FAIL %s %s: status %d, not %d\n", rule, name, (int)s,
                   status);
    }
    free(bytes);
    return ok;
}

/* Selects a path; returns 0 if the machine lacks it. */
static int choose_path(const char *name)
{
    static const char *const names[] = { "plain", "x4", "avx2" };
    const saga_cpu best = machine_best();

    cpu = best;
    if (name)
        for (cpu = SAGA_CPU_PLAIN; cpu <= best; cpu++)
            if (strcmp(name, names[cpu]) == 0)
                break;
    return cpu <= best;
}

/* Checks every line of a list; returns 0 if there is none. */
static int check_list(const char *dir, const char *list,
                      int (*check)(const char *dir, const char *line),
                      int may_lack)
{
    static char line[LINE];
    char path[1024];
    const int before = n_passed + n_failed;
    FILE *f;

    snprintf(path, sizeof path, "%s/%s", dir, list);
    f = fopen(path, "r");
    if (!f && may_lack)
        return 1;
    while (f && fgets(line, sizeof line, f))
        if (line[0] != '#' && line[0] != '\n') {
            if (check(dir, line))
                n_passed++;
            else
                n_failed++;
        }
    if (f)
        fclose(f);
    if (n_passed + n_failed > before)
        return 1;
    printf("FAIL %s: no vector\n", path);
    return 0;
}

int main(int argc, char **argv)
{
    static const struct {
        const char *name;
        int (*check)(const char *dir, const char *line);
        int may_lack;
    } lists[] = { { "MANIFEST", check_line, 0 },
                  { "PICTURES", check_line, 1 },
                  { "BOXES", check_line, 1 },
                  { "VALUES", check_line, 1 },
                  { "REFUSALS", check_refusal, 0 } };
    const int answers = argc > 1 && strcmp(argv[1], "--answer") == 0;

    if (argc > 2 && strcmp(argv[1], "--init") == 0)
        return check_init(&cpu, machine_best(), argv + 2, argc - 2);
    if (argc < 2 || argc > 3) {
        fprintf(stderr, "usage: check_vectors DIR [plain | x4 | avx2]\n"
                        "       check_vectors --answer [LEVEL]\n"
                        "       check_vectors --init FILE...\n");
        return 2;
    }
    if (!choose_path(argc > 2 && !answers ? argv[2] : NULL)) {
        printf("FAIL %s: this machine has no such path\n", argv[2]);
        return 1;
    }
    if (answers)
        return !answer_all(argc > 2 ? atoi(argv[2]) : SAGA_N_PROFILES);
    for (size_t i = 0; i < sizeof lists / sizeof *lists; i++)
        n_failed += !check_list(argv[1], lists[i].name, lists[i].check,
                                lists[i].may_lack);
    printf("%d passed, %d failed\n", n_passed, n_failed);
    return n_failed != 0;
}
