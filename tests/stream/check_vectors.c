/* SPDX-License-Identifier: MIT
 *
 * check_vectors DIR [PATH]: checks every stage of every line of DIR/MANIFEST;
 * bad files must give their exact status. PATH is plain, x4 or avx2
 * (common/cpu.h) instead of the best one of the machine. The program is plain C
 * without a test library, so that it runs on every target. A missing file is a
 * failure. Then every line of DIR/REFUSALS is checked, and of DIR/PICTURES,
 * DIR/BOXES and DIR/VALUES if they exist. Prints `N passed, N failed`.
 *
 * check_vectors --answer [LEVEL]: answers the questions of vectors/conform.py,
 * as a decoder that refuses files above a level.
 *
 * Symbols are read by ref_recorder.h and the shared traversal, everything else
 * through saga.h.
 */
/* The program chooses the SIMD path by this function, which it links instead of
 * the library's cpu.c. */
#define saga_cpu_best machine_best
#include "cpu.c"
#undef saga_cpu_best

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

enum { PIXELS_NBYTES = 3 * 640 * 480, LEVEL_AT = 12 };

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

static int same(const char *name, const char *stage, uint32_t got,
                uint32_t want)
{
    if (got == want)
        return 1;
    printf("FAIL %s: %s is %08" PRIx32 ", not %08" PRIx32 "\n", name, stage,
           got, want);
    return 0;
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
                                s, n_layers, h.model.features);
    for (uint32_t i = 0; i <= SAGA_MAX_LAYERS; i++)
        saga_net_symbols_free(&nets[i]);
    for (uint32_t i = 0; i < SAGA_MAX_LAYERS; i++)
        recorder_free_symbols(&s[i]);
    recorder_free_symbols(&base);
    return ok;
}

static int check_good(const char *name, const uint8_t *bytes, size_t n,
                      uint32_t number, int32_t t, uint32_t camera,
                      const saga_stages *want)
{
    saga_stages got;
    saga_status s;
    int ok;

    if (!read_symbols(&got.symbols, bytes, n, number)) {
        printf("FAIL %s: its symbols cannot be read\n", name);
        return 0;
    }
    s = saga_stages_of(&got, bytes, n, number, t, camera, pixels,
                       sizeof pixels);
    if (s) {
        printf("FAIL %s: %s\n", name, saga_status_text(s));
        return 0;
    }
    ok = same(name, "symbols", got.symbols, want->symbols);
    for (int i = 0; i < 3; i++)
        ok &= same(name, "final range", got.final_range[i],
                   want->final_range[i]);
    ok &= same(name, "primitives", got.primitives, want->primitives);
    ok &= same(name, "splats", got.splats, want->splats);
    ok &= same(name, "frame", got.frame, want->frame);
    return ok;
}

static int check_bad(const char *name, const uint8_t *bytes, size_t n, int want)
{
    saga_stages got;
    const saga_status s = saga_stages_of(&got, bytes, n, 0, 0, 0, pixels,
                                         sizeof pixels);

    if ((int)s == want)
        return 1;
    printf("FAIL %s: status %d, not %d\n", name, (int)s, want);
    return 0;
}

static int check_sound(const char *name, const uint8_t *bytes, size_t n,
                       int want)
{
    saga_sound sound;
    const saga_status s = saga_find_sound(&sound, bytes, n);

    if ((int)s == want)
        return 1;
    printf("FAIL %s: finding its sound has status %d, not %d\n", name, (int)s,
           want);
    return 0;
}

static int check_line(const char *dir, const char *line)
{
    char name[256];
    unsigned number, camera;
    int t, status, ok = 0;
    saga_stages w;
    uint8_t *bytes;
    size_t n = 0;
    const int is_bad = sscanf(line, "%255s status %d", name, &status) == 2;
    const int is_sound = !is_bad &&
                         sscanf(line, "%255s sound %d", name, &status) == 2;
    const int is_good = !is_bad && !is_sound &&
                        sscanf(line,
                               "%255s %u %" SCNx32 " %" SCNx32 " %" SCNx32
                               " %" SCNx32 " %d %u %" SCNx32 " %" SCNx32
                               " %" SCNx32,
                               name, &number, &w.symbols, &w.final_range[0],
                               &w.final_range[1], &w.final_range[2], &t,
                               &camera, &w.primitives, &w.splats,
                               &w.frame) == 11;

    if (!is_bad && !is_sound && !is_good) {
        printf("FAIL MANIFEST: cannot read the line: %s", line);
        return 0;
    }
    bytes = read_file(dir, name, &n);
    if (!bytes)
        printf("FAIL %s: missing\n", name);
    else
        ok = is_bad     ? check_bad(name, bytes, n, status)
             : is_sound ? check_sound(name, bytes, n, status)
                        : check_good(name, bytes, n, number, t, camera, &w);
    free(bytes);
    return ok;
}

/* --- PICTURES, BOXES ----------------------------------------------------- */

/* Returns the `bits` of a kind of picture or of the boxes, or 0. */
static int bits_of(const char *kind)
{
    for (int i = 0; i <= SAGA_N_PICTURE_KINDS; i++)
        if (strcmp(kind, saga_picture_kinds[i].name) == 0)
            return saga_picture_kinds[i].bits;
    return 0;
}

static int check_picture(const char *dir, const char *line)
{
    char name[256], kind[16];
    saga_stages_at at;
    uint32_t want, got = 0;
    uint8_t *bytes;
    size_t n = 0;
    int ok = 0;

    if (sscanf(line, "%255s %15s %" SCNu32 " %" SCNd32 " %" SCNu32 " %" SCNx32,
               name, kind, &at.segment, &at.t, &at.camera, &want) != 6 ||
        !bits_of(kind)) {
        printf("FAIL PICTURES or BOXES: cannot read the line: %s", line);
        return 0;
    }
    bytes = read_file(dir, name, &n);
    if (!bytes) {
        printf("FAIL %s: missing\n", name);
    } else {
        const saga_status s = saga_picture_crc(&got, bytes, n, &at,
                                               bits_of(kind));

        if (s)
            printf("FAIL %s: %s: %s\n", name, kind, saga_status_text(s));
        ok = s == SAGA_OK && same(name, kind, got, want);
    }
    free(bytes);
    return ok;
}

/* --- VALUES -------------------------------------------------------------- */

enum { VALUE = 256, MOST_ARGUMENTS = 3 };

/* A question of a line of VALUES: its kind, and the number of arguments. */
typedef struct {
    const char *kind;
    int n_arguments;
} value_kind;

static const value_kind value_kinds[] = {
    { "time", 2 }, { "name", 1 }, { "gains", 1 }, { "world", 3 }
};

/* Returns a kind by its name, or NULL. */
static const value_kind *value_kind_of(const char *name)
{
    for (size_t i = 0; i < sizeof value_kinds / sizeof *value_kinds; i++)
        if (strcmp(name, value_kinds[i].kind) == 0)
            return &value_kinds[i];
    return NULL;
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
    snprintf(text, VALUE, "%.9g %.9g %.9g", x[0], x[1], x[2]);
    return s;
}

/* Writes the answer to a question, which is the status if that is not 0. */
static void value_of(char *text, const value_kind *kind, const int64_t *a,
                     const uint8_t *bytes, size_t n)
{
    saga_segment seg;
    saga_exposure e;
    saga_status s = SAGA_OK;

    if (strcmp(kind->kind, "time") == 0) {
        s = saga_find(&seg, bytes, n, (uint32_t)a[0], (uint32_t)a[1]);
        if (!s)
            snprintf(text, VALUE, "%" PRIu32 " %" PRId32, seg.number, seg.t);
    } else if (strcmp(kind->kind, "gains") == 0) {
        s = saga_find_exposure(&e, bytes, n, (uint32_t)a[0]);
        if (!s)
            snprintf(text, VALUE, "%u %u %u", e.gain_q12[0], e.gain_q12[1],
                     e.gain_q12[2]);
    } else if (strcmp(kind->kind, "name") == 0) {
        s = name_in_hex(text, bytes, n, (uint32_t)a[0]);
    } else {
        s = world(text, bytes, n, a);
    }
    if (s)
        snprintf(text, VALUE, "%d", (int)s);
}

/* Reads the arguments of a kind. Returns where they end, or NULL. */
static const char *read_arguments(int64_t *a, const value_kind *kind,
                                  const char *text)
{
    for (int i = 0; i < kind->n_arguments; i++) {
        char *end;

        a[i] = strtoll(text, &end, 10);
        if (end == text || *end != ' ')
            return NULL;
        text = end + 1;
    }
    return text;
}

static int check_value(const char *dir, const char *line)
{
    char name[256], kind[16], got[VALUE];
    const char *want = NULL;
    const value_kind *k = NULL;
    int64_t a[MOST_ARGUMENTS];
    int used = 0, ok = 0;
    uint8_t *bytes;
    size_t n = 0;

    if (sscanf(line, "%255s %15s %n", name, kind, &used) == 2)
        k = value_kind_of(kind);
    if (k)
        want = read_arguments(a, k, line + used);
    if (!want) {
        printf("FAIL VALUES: cannot read the line: %s", line);
        return 0;
    }
    bytes = read_file(dir, name, &n);
    if (!bytes) {
        printf("FAIL %s: missing\n", name);
    } else {
        value_of(got, k, a, bytes, n);
        ok = strlen(got) == strcspn(want, "\n") &&
             strncmp(got, want, strlen(got)) == 0;
        if (!ok)
            printf("FAIL %s %s: %s, not %s", name, kind, got, want);
    }
    free(bytes);
    return ok;
}

/* --- REFUSALS ------------------------------------------------------------ */

enum { LINE = 1 << 16 };

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

    return strcmp(kind, "names") == 0   ? saga_name_camera(&naming, bytes, n, 0)
           : strcmp(kind, "sound") == 0 ? saga_find_sound(&sound, bytes, n)
           : strcmp(kind, "exposure") == 0
               ? saga_find_exposure(&exposure, bytes, n, 0)
           : strcmp(kind, "last") == 0
               ? find_last(bytes, n)
               : saga_stages_of(&stages, bytes, n, 0, 0, 0, pixels,
                                sizeof pixels);
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

/* --- Answers to vectors/conform.py ---------------------------------------- */

/* Answers `SEGMENT T CAMERA` by the CRCs of a good file, or the status that is
 * not 0. */
static void answer_good(const uint8_t *bytes, size_t n, unsigned number, int t,
                        unsigned camera)
{
    saga_stages got;
    const saga_status s = saga_stages_of(&got, bytes, n, number, t, camera,
                                         pixels, sizeof pixels);

    if (s || !read_symbols(&got.symbols, bytes, n, number))
        printf("%d\n", (int)s);
    else
        printf("%08" PRIx32 " %08" PRIx32 " %08" PRIx32 " %08" PRIx32
               " %08" PRIx32 " %08" PRIx32 " %08" PRIx32 "\n",
               got.symbols, got.final_range[0], got.final_range[1],
               got.final_range[2], got.primitives, got.splats, got.frame);
}

/* Answers `KIND SEGMENT T CAMERA` by the CRC of a picture, or the status that
 * is not 0. */
static void answer_picture(const uint8_t *bytes, size_t n, int bits,
                           const saga_stages_at *look)
{
    uint32_t crc = 0;
    const saga_status s = saga_picture_crc(&crc, bytes, n, look, bits);

    if (s)
        printf("%d\n", (int)s);
    else
        printf("%08" PRIx32 "\n", crc);
}

/* Returns whether a decoder of the levels up to `top` refuses a file for its
 * level, which is check 10 of opening. */
static int is_above(const uint8_t *bytes, size_t n, int top)
{
    saga_info info;
    const saga_status s = saga_probe(&info, bytes, n);

    return (s == SAGA_OK || s == SAGA_ERR_LEVEL) && bytes[LEVEL_AT] > top;
}

/* Answers a question about a file; its arguments and the file's name are in
 * `rest`. A number instead of a kind is the segment of a good file. Returns 0
 * if there is no such file. */
static int answer_line(const char *kind, const char *rest, int top)
{
    const value_kind *const of_value = value_kind_of(kind);
    const int is_good = kind[strspn(kind, "0123456789")] == '\0';
    const int is_picture = bits_of(kind) != 0;
    const value_kind shape = { kind, of_value  ? of_value->n_arguments
                                     : is_good ? 2
                                               : 3 * is_picture };
    int64_t a[MOST_ARGUMENTS];
    const char *const path = read_arguments(a, &shape, rest);
    size_t n = 0;
    uint8_t *const bytes = path ? read_file("", path, &n) : NULL;
    char text[VALUE];

    if (!bytes)
        return 0;
    if (is_above(bytes, n, top)) {
        printf("%d\n", (int)SAGA_ERR_LEVEL);
    } else if (of_value) {
        value_of(text, of_value, a, bytes, n);
        printf("%s\n", text);
    } else if (is_good) {
        answer_good(bytes, n, (unsigned)atoi(kind), (int)a[0], (unsigned)a[1]);
    } else if (is_picture) {
        answer_picture(
            bytes, n, bits_of(kind),
            &(saga_stages_at){ (uint32_t)a[0], (int32_t)a[1], (uint32_t)a[2] });
    } else {
        printf("%d\n", (int)refusal(kind, bytes, n));
    }
    free(bytes);
    return 1;
}

/* Answers every line of the standard input; returns 0 if one has no file. */
static int answer(int top)
{
    static char line[LINE];
    char kind[16];
    int at = 0;

    while (fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = '\0';
        if (sscanf(line, "%15s %n", kind, &at) != 1 ||
            !answer_line(kind, line + at, top))
            return 0;
    }
    return 1;
}

/* --- The lists ----------------------------------------------------------- */

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

/* Returns whether a folder has a list. */
static int has_list(const char *dir, const char *list)
{
    char path[1024];
    FILE *f;

    snprintf(path, sizeof path, "%s/%s", dir, list);
    f = fopen(path, "r");
    if (f)
        fclose(f);
    return f != NULL;
}

/* Checks every line of a list; returns 0 if there is none. */
static int check_list(const char *dir, const char *list,
                      int (*check)(const char *dir, const char *line))
{
    static char line[LINE];
    char path[1024];
    const int before = n_passed + n_failed;
    FILE *f;

    snprintf(path, sizeof path, "%s/%s", dir, list);
    f = fopen(path, "r");
    while (f && fgets(line, sizeof line, f)) {
        if (line[0] == '#' || line[0] == '\n')
            continue;
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
                  { "PICTURES", check_picture, 1 },
                  { "BOXES", check_picture, 1 },
                  { "VALUES", check_value, 1 },
                  { "REFUSALS", check_refusal, 0 } };
    const int answers = argc > 1 && strcmp(argv[1], "--answer") == 0;

    if (argc < 2 || argc > 3) {
        fprintf(stderr, "usage: check_vectors DIR [plain | x4 | avx2]\n"
                        "       check_vectors --answer [LEVEL]\n");
        return 2;
    }
    if (!choose_path(argc > 2 && !answers ? argv[2] : NULL)) {
        printf("FAIL %s: this machine has no such path\n", argv[2]);
        return 1;
    }
    if (answers)
        return !answer(argc > 2 ? atoi(argv[2]) : SAGA_N_PROFILES);
    for (size_t i = 0; i < sizeof lists / sizeof *lists; i++)
        if (!lists[i].may_lack || has_list(argv[1], lists[i].name))
            n_failed += !check_list(argv[1], lists[i].name, lists[i].check);
    printf("%d passed, %d failed\n", n_passed, n_failed);
    return n_failed != 0;
}
