/* SPDX-License-Identifier: MIT
 *
 * make_vectors DIR <streams.txt: writes DIR/good/NAME.saga for each line of its
 * input (tests/stream/streams.txt) and prints the lines of MANIFEST and of
 * PICTURES that these files need. The checksums are those of the decoder of
 * this build, so that a new line is right only if another decoder agrees.
 */
#include "freed.h"
#include "gen_stream.h"
#include "plan.h"
#include "vectors.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PIXELS_NBYTES = 3 * 640 * 480, LINE = 1024 };

/* The members of gen_options that a line may set. */
#define MEMBER(name)                                                       \
    {                                                                      \
#name, offsetof(gen_options, name), sizeof((gen_options *)0)->name \
    }
static const struct {
    const char *name;
    size_t at, nbytes;
} members[] = { MEMBER(seed),       MEMBER(level),
                MEMBER(n_coarse),   MEMBER(full),
                MEMBER(n_segments), MEMBER(picture),
                MEMBER(features),   MEMBER(tools),
                MEMBER(bank),       MEMBER(bank_slots),
                MEMBER(bank_width), MEMBER(bank_blocks),
                MEMBER(bank_alone), MEMBER(hash_levels),
                MEMBER(no_fuse),    MEMBER(hash_log2_entries),
                MEMBER(linear),     MEMBER(named),
                MEMBER(exposed),    MEMBER(sounds),
                MEMBER(base),       MEMBER(n_layers),
                MEMBER(classes),    MEMBER(bounded) };

static void fail(const char *name, const char *what)
{
    fprintf(stderr, "make_vectors: %s: %s\n", name, what);
    exit(2);
}

/* Sets the member that a word such as level=1 names. */
static void set_member(gen_options *o, const char *word)
{
    const char *const value = strchr(word, '=');
    const size_t n = value ? (size_t)(value - word) : 0;

    for (size_t i = 0; n && i < sizeof members / sizeof *members; i++)
        if (strlen(members[i].name) == n &&
            strncmp(members[i].name, word, n) == 0) {
            const uint64_t wide = strtoull(value + 1, NULL, 0);
            const uint32_t narrow = (uint32_t)wide;

            memcpy((char *)o + members[i].at,
                   members[i].nbytes == 8 ? (const void *)&wide : &narrow,
                   members[i].nbytes);
            o->tools_fixed |= strncmp(word, "tools", n) == 0;
            return;
        }
    fail(word, "no member of gen_options");
}

/* Prints the line of MANIFEST for a segment at a time and a camera. */
static void print_stages(const char *name, const gen_stream *g,
                         const uint8_t *bytes, size_t n,
                         const saga_stages_at *at)
{
    static uint8_t pixels[PIXELS_NBYTES];
    const uint32_t n_layers = saga_n_layers(&g->header);
    saga_stages st;
    saga_nets nets;
    saga_status s;

    saga_nets_layout(&nets, &g->header.model);
    st.symbols = saga_symbols_crc(
        &g->nets, &nets, g->has_base ? &g->base : NULL,
        &g->segment[at->segment * n_layers], n_layers, &g->header.model);
    s = saga_stages_of(&st, bytes, n, at->segment, at->t, at->camera, pixels,
                       sizeof pixels);
    if (s)
        fail(name, saga_status_text(s));
    printf("good/%s.saga %" PRIu32 " %08" PRIx32 " %08" PRIx32 " %08" PRIx32
           " %08" PRIx32 " %" PRId32 " %" PRIu32 " %08" PRIx32 " %08" PRIx32
           " %08" PRIx32 "\n",
           name, at->segment, st.symbols, st.final_range[0], st.final_range[1],
           st.final_range[2], at->t, at->camera, st.primitives, st.splats,
           st.frame);
}

/* Prints the lines of a file: two views of each segment, and all kinds of
 * pictures of its last view. */
static void print_lines(const char *name, const gen_stream *g,
                        const uint8_t *bytes, size_t n)
{
    saga_stages_at at = { 0, 0, 0 };

    for (uint32_t i = 0; i < g->n_segments; i++)
        for (uint32_t k = 0; k < 2; k++) {
            at = (saga_stages_at){ i, k ? 40000 : 0, k };
            print_stages(name, g, bytes, n, &at);
        }
    for (int i = 0; i < SAGA_N_PICTURE_KINDS; i++) {
        const saga_picture_kind *const kind = &saga_picture_kinds[i];
        uint32_t crc;
        const saga_status s = saga_picture_crc(&crc, bytes, n, &at, kind->bits);

        if (s)
            fail(name, saga_status_text(s));
        printf("good/%s.saga %s %" PRIu32 " %" PRId32 " %" PRIu32 " %08" PRIx32
               "\n",
               name, kind->name, at.segment, at.t, at.camera, crc);
    }
}

/* Makes the file of a line. */
static void make(const char *directory, char *line)
{
    const char *const name = strtok(line, " \n");
    gen_options o = { .seed = 0 };
    FREED_BY(gen_stream_free) gen_stream g;
    FREED uint8_t *bytes;
    char path[1024];
    size_t n;
    FILE *f;

    for (const char *word; (word = strtok(NULL, " \n"));)
        set_member(&o, word);
    g = gen_stream_make(&o);
    gen_stream_encode(&g, &bytes, &n);
    snprintf(path, sizeof path, "%s/good/%s.saga", directory, name);
    f = fopen(path, "wb");
    if (!f || fwrite(bytes, 1, n, f) != n || fclose(f))
        fail(path, "cannot write");
    print_lines(name, &g, bytes, n);
}

int main(int argc, char **argv)
{
    char line[LINE];

    if (argc != 2) {
        fprintf(stderr, "usage: make_vectors DIR <tests/stream/streams.txt\n");
        return 2;
    }
    while (fgets(line, sizeof line, stdin))
        if (*line != '#' && *line != '\n')
            make(argv[1], line);
    return 0;
}
