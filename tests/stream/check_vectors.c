/* SPDX-License-Identifier: MIT
 *
 * check_vectors DIR [PATH]: checks every stage of every line of DIR/MANIFEST;
 * bad files must give their exact status. PATH is plain, x4 or avx2
 * (common/cpu.h) instead of the best one of the machine. The program is plain C
 * without a test library, so that it runs on every target. A missing file is a
 * failure. Then every line of DIR/PICTURES, if that exists, and of DIR/REFUSALS
 * is checked. Prints `N passed, N failed`.
 *
 * check_vectors --answer: answers the questions of vectors/conform.py.
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
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PIXELS_NBYTES = 3 * 640 * 480 };

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
                           RECORDER_LAYER(number, n_layers), final_range,
                           bytes, n))
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

static int check_bad(const char *name, const uint8_t *bytes, size_t n,
                     int want)
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
        sscanf(line, "%255s %u %" SCNx32 " %" SCNx32 " %" SCNx32 " %" SCNx32
               " %d %u %" SCNx32 " %" SCNx32 " %" SCNx32, name, &number,
               &w.symbols, &w.final_range[0], &w.final_range[1],
               &w.final_range[2], &t, &camera, &w.primitives, &w.splats,
               &w.frame) == 11;

    if (!is_bad && !is_sound && !is_good) {
        printf("FAIL MANIFEST: cannot read the line: %s", line);
        return 0;
    }
    bytes = read_file(dir, name, &n);
    if (!bytes)
        printf("FAIL %s: missing\n", name);
    else
        ok = is_bad ? check_bad(name, bytes, n, status)
           : is_sound ? check_sound(name, bytes, n, status)
                    : check_good(name, bytes, n, number, t, camera, &w);
    free(bytes);
    return ok;
}

/* --- PICTURES ------------------------------------------------------------ */

/* Returns the `bits` of a kind of picture, or 0. */
static int bits_of(const char *kind)
{
    for (int i = 0; i < SAGA_N_PICTURE_KINDS; i++)
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
        printf("FAIL PICTURES: cannot read the line: %s", line);
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
        for (edits += used; sscanf(edits, "%2x", &byte) == 1 &&
                            *edits != ' ' && *edits != '\n'; edits += 2)
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

    return strcmp(kind, "names") == 0 ? saga_name_camera(&naming, bytes, n, 0)
         : strcmp(kind, "sound") == 0 ? saga_find_sound(&sound, bytes, n)
         : strcmp(kind, "exposure") == 0
           ? saga_find_exposure(&exposure, bytes, n, 0)
         : strcmp(kind, "last") == 0 ? find_last(bytes, n)
         : saga_stages_of(&stages, bytes, n, 0, 0, 0, pixels, sizeof pixels);
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
               file, &used) != 5 || !used) {
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
static void answer_good(const uint8_t *bytes, size_t n, unsigned number,
                        int t, unsigned camera)
{
    saga_stages got;
    const saga_status s = saga_stages_of(&got, bytes, n, number, t, camera,
                                         pixels, sizeof pixels);

    if (s || !read_symbols(&got.symbols, bytes, n, number))
        printf("%d\n", (int)s);
    else
        printf("%08" PRIx32 " %08" PRIx32 " %08" PRIx32 " %08" PRIx32
               " %08" PRIx32 " %08" PRIx32 " %08" PRIx32 "\n", got.symbols,
               got.final_range[0], got.final_range[1], got.final_range[2],
               got.primitives, got.splats, got.frame);
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

/* Answers every line of the standard input; returns 0 if one has no file. */
static int answer(void)
{
    static char line[LINE];
    char kind[16];
    unsigned number, camera;
    int t, at = 0;
    size_t n = 0;

    while (fgets(line, sizeof line, stdin)) {
        uint8_t *bytes;
        const int is_good =
            sscanf(line, "%u %d %u %n", &number, &t, &camera, &at) == 3;
        const int is_picture = !is_good &&
            sscanf(line, "%15s %u %d %u %n", kind, &number, &t, &camera,
                   &at) == 4;

        if (!is_good && !is_picture && sscanf(line, "%15s %n", kind, &at) != 1)
            return 0;
        line[strcspn(line, "\n")] = '\0';
        bytes = read_file("", line + at, &n);
        if (!bytes)
            return 0;
        if (is_good)
            answer_good(bytes, n, number, t, camera);
        else if (is_picture)
            answer_picture(bytes, n, bits_of(kind),
                           &(saga_stages_at){ number, t, camera });
        else
            printf("%d\n", (int)refusal(kind, bytes, n));
        free(bytes);
    }
    return 1;
}

/* --- Both lists ---------------------------------------------------------- */

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

/* Returns whether a folder has a list. One with refusals alone has no PICTURES.
 */
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
    int ok;

    if (argc < 2 || argc > 3) {
        fprintf(stderr, "usage: check_vectors DIR [plain | x4 | avx2]\n"
                        "       check_vectors --answer\n");
        return 2;
    }
    if (!choose_path(argc > 2 ? argv[2] : NULL)) {
        printf("FAIL %s: this machine has no such path\n", argv[2]);
        return 1;
    }
    if (strcmp(argv[1], "--answer") == 0)
        return !answer();
    ok = check_list(argv[1], "MANIFEST", check_line) &
         (!has_list(argv[1], "PICTURES") ||
          check_list(argv[1], "PICTURES", check_picture)) &
         check_list(argv[1], "REFUSALS", check_refusal);
    n_failed += !ok;
    printf("%d passed, %d failed\n", n_passed, n_failed);
    return n_failed != 0;
}
