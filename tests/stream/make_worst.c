/* SPDX-License-Identifier: MIT
 *
 * make_worst DIR [LEVEL]: writes the worst files of each level, DIR/LEVEL_KIND,
 * for the measurement of a device (docs/levels.md), and prints a row of a table
 * for each: its bytes, the shares of the level's work, anchors and cover, and
 * the CPU seconds that this machine takes to open and decode it, to prepare a
 * view, and to draw it.
 */
#include "gen_slow.h"
#include "saga.h"
#include "vectors.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double cpu_seconds(void)
{
    struct timespec t;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void must(int ok, const char *what)
{
    if (!ok) {
        fprintf(stderr, "make_worst: %s\n", what);
        exit(2);
    }
}

/* Draws a view; returns the seconds. */
static double draw(const saga_decoder *dec, const saga_camera *c)
{
    const size_t n = 3u * c->width * (size_t)c->height;
    const saga_picture picture = { malloc(n), 3u * c->width, n, 8 };
    const double start = cpu_seconds();

    must(picture.rgb && saga_draw_whole(dec, c, &picture) == SAGA_OK,
         "a view cannot be drawn");
    free(picture.rgb);
    return cpu_seconds() - start;
}

/* Prepares and draws a view of camera 0 if there is one. */
static void look(saga_decoder *dec, const saga_info *info, const uint8_t *bytes,
                 size_t n)
{
    saga_camera c;
    saga_report report;
    uint32_t number;
    double start;

    if (info->n_cameras == 0) {
        printf(" | | | |\n");
        return;
    }
    must(saga_rig(&c, &number, bytes, n, 0) == SAGA_OK, "no camera");
    start = cpu_seconds();
    must(saga_view(dec, &c, 0) == SAGA_OK, "no view");
    start = cpu_seconds() - start;
    saga_tell(&report, dec);
    printf(" | %.1f %% | %.3f",
           100. * (double)report.box_pixels /
               (65536. * SAGA_COVER_MAX(info->level)),
           start);
    printf(" | %.3f |\n", draw(dec, &c));
}

/* Decodes a file and prints its row. */
static void measure(const char *name, const uint8_t *bytes, size_t n)
{
    static const double work[] = { 1u << 28, 4294967296., 34359738368.,
                                   549755813888. };
    static const double anchors[] = { 5120, 160000, 1600000, 8388608 };
    saga_info info;
    saga_segment seg;
    saga_decoder *dec;
    void *block;
    double start;

    must(saga_probe(&info, bytes, n) == SAGA_OK &&
             saga_find(&seg, bytes, n, 0, 1) == SAGA_OK,
         "not a valid file");
    block = aligned_alloc(SAGA_WORK_ALIGN, info.work_nbytes);
    must(block != NULL, "out of memory");
    start = cpu_seconds();
    must(saga_open(&dec, block, info.work_nbytes, bytes, n, NULL) == SAGA_OK &&
             saga_decode(dec, &seg, bytes + seg.offset, seg.nbytes, NULL) ==
                 SAGA_OK,
         "a file cannot be decoded");
    printf("| %s | %zu | %.1f %% | %.1f %% | %.3f", name, n,
           100. * (double)info.work / work[info.level],
           100. * (double)info.n_layers *
               ((double)info.max_coarse + info.max_fine) / anchors[info.level],
           cpu_seconds() - start);
    look(dec, &info, bytes, n);
    fflush(stdout);
    free(block);
}

static void make(const char *dir, int level, const char *kind, gen_stream *g)
{
    char name[64], path[1024];
    uint8_t *bytes;
    size_t n;
    FILE *f;

    snprintf(name, sizeof name, "%d_%s.saga", level, kind);
    snprintf(path, sizeof path, "%s/%s", dir, name);
    gen_stream_encode(g, &bytes, &n);
    f = fopen(path, "wb");
    must(f && fwrite(bytes, 1, n, f) == n && !fclose(f), "cannot write");
    measure(name, bytes, n);
    free(bytes);
    gen_stream_free(g);
}

int main(int argc, char **argv)
{
    static const char *const kinds[GEN_N_SLOW] = { "wide", "narrow",
                                                   "anchors" };
    gen_stream g;

    if (argc < 2 || argc > 3) {
        fprintf(stderr, "usage: make_worst DIR [LEVEL]\n");
        return 2;
    }
    printf("| file | bytes | work | anchors | decode, s | cover | view, s | "
           "draw, s |\n|---|---|---|---|---|---|---|---|\n");
    for (int level = 0; level < 4; level++) {
        if (argc > 2 && atoi(argv[2]) != level)
            continue;
        for (int kind = 0; kind < GEN_N_SLOW; kind++) {
            gen_slow_make(&g, level, kind, 1);
            make(argv[1], level, kinds[kind], &g);
        }
        gen_slow_make(&g, level, GEN_SLOW_ANCHORS, 1);
        gen_slow_search(&g);
        make(argv[1], level, "search", &g);
        gen_slow_crowd(&g, level);
        make(argv[1], level, "crowd", &g);
        gen_slow_wall(&g, level, SAGA_COVER_MAX(level));
        make(argv[1], level, "wall", &g);
    }
    return 0;
}
