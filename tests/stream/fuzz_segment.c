/* SPDX-License-Identifier: MIT
 *
 * Fuzzes saga_decode and what draws after it. Most inputs of fuzz_decode are
 * refused in the header or in the networks, and those that are not spend most
 * of their time there. Here all films of vectors/v1 with small segments are
 * opened once, and an input is a segment of one of them: a byte that selects
 * the film, then the segment, whose CRCs are computed anew. These films never
 * change, so that a byte always selects the same. With libFuzzer, in the root
 * of the source tree:
 *     clang -fsanitize=fuzzer,address,undefined -DSAGA_CHECK ... fuzz_segment.c
 */
#include "container.h"
#include "file.h"
#include "fx.h"
#include "gen_mutate.h"
#include "work_block.h"

#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t n, size_t most,
                               unsigned seed);
/* libFuzzer's own changes, which may change the length up to `most`. */
size_t LLVMFuzzerMutate(uint8_t *data, size_t n, size_t most);

enum {
    MAX_MACS = 1 << 21,
    MAX_SEGMENT = 8192, /* multiply-accumulates, bytes */
    MAX_FILMS = 256     /* that a byte selects */
};

/* A film that is open, and its first segment. */
typedef struct film {
    saga_bytes file;
    saga_info info;
    saga_decoder *dec;
    saga_segment segment;
} film;

static film films[MAX_FILMS];
static unsigned n_films;
static unsigned long n_played, n_entered, n_drawn;

static void tell(void)
{
    printf("fuzz_segment: %u films, %lu played, %lu entered a segment, "
           "%lu drew\n",
           n_films, n_played, n_entered, n_drawn);
}

/* Opens the film of a file; returns 0 if it is not small. */
static int open_film(film *f, const char *path)
{
    const uint8_t *bytes;
    saga_error error;
    void *work;

    if (!saga_read_file(&f->file, path, &error)) {
        fprintf(stderr, "fuzz_segment: cannot read %s\n", path);
        exit(2);
    }
    bytes = f->file.data;
    if (saga_probe(&f->info, bytes, f->file.nbytes) ||
        f->info.decode_macs > MAX_MACS ||
        saga_find(&f->segment, bytes, f->info.head_nbytes, 0, 1) ||
        f->segment.nbytes > MAX_SEGMENT)
        return 0;
    work = mutate_must(aligned_alloc(SAGA_WORK_ALIGN, f->info.work_nbytes));
    if (saga_open(&f->dec, work, f->info.work_nbytes, bytes,
                  f->info.head_nbytes, NULL) == SAGA_OK)
        return 1;
    free(work);
    return 0;
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    glob_t found;

    (void)argc;
    (void)argv;
    if (glob("vectors/v1/good/*.saga", 0, NULL, &found)) {
        fprintf(stderr, "fuzz_segment: no vectors/v1 in this folder\n");
        exit(2);
    }
    for (size_t i = 0; i < found.gl_pathc && n_films < MAX_FILMS; i++)
        if (open_film(&films[n_films], found.gl_pathv[i]))
            n_films++;
        else
            saga_bytes_free(&films[n_films].file);
    globfree(&found);
    atexit(tell);
    return 0;
}

static const film *film_of(uint8_t byte)
{
    return &films[byte % n_films];
}

/* Computes the CRCs of all chunks anew, as far as their lengths are plausible.
 */
static void sign(uint8_t *p, size_t n, uint32_t owner)
{
    size_t at = 0, k;

    while ((k = mutate_sign_chunk(p + at, n - at, owner)) > 0)
        at += k;
}

/* saga_decode calls this when it decodes the first symbol. */
static int note(void *user)
{
    *(int *)user = 1;
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    const film *const f = film_of(n ? data[0] : 0);
    const size_t nbytes = n ? n - 1 : 0;
    /* The copy has no spare bytes, so that ASan sees every read past its
     * end. */
    uint8_t *const copy = mutate_must(malloc(nbytes + (nbytes == 0)));
    uint64_t r = saga_crc32c(0, data, n);
    saga_segment segment = f->segment;
    mutate_result result = { .stage = MUTATE_DRAWN };
    int entered = 0;
    const saga_watch watch = { note, &entered };
    saga_status s;

    if (nbytes)
        memcpy(copy, data + 1, nbytes);
    sign(copy, nbytes, f->dec->owner);
    segment.nbytes = (uint32_t)nbytes;
    s = saga_decode(f->dec, &segment, copy, nbytes, &watch);
    free(copy);
    if (s == SAGA_OK)
        mutate_look(&result, f->dec, &f->info, f->file.data,
                    f->info.head_nbytes, &r);
    else if (s != SAGA_ERR_DATA && s != SAGA_ERR_TRUNCATED)
        result.broken = "saga_decode returns OK, DATA or TRUNCATED";
    if (result.broken) {
        fprintf(stderr, "fuzz_segment: not so: %s\n", result.broken);
        abort();
    }
    n_played++;
    n_entered += (unsigned long)entered;
    n_drawn += s == SAGA_OK && result.stage == MUTATE_DRAWN;
    return 0;
}

/* Draws one of a segment's chunks, as far as their lengths are plausible, and
 * sets its place and its length with its header. Returns the number of chunks,
 * which may be 0. */
static size_t find_chunk(size_t *at, size_t *nbytes, const uint8_t *p, size_t n,
                         uint64_t *r)
{
    size_t next = 0, n_chunks = 0;

    while (n - next >= SAGA_CHUNK_NBYTES) {
        const size_t all = SAGA_CHUNK_NBYTES +
                           (size_t)fx_load32_le(p + next + 4);

        if (all > n - next)
            break;
        n_chunks++;
        if (gen_random(r) % n_chunks == 0) {
            *at = next;
            *nbytes = all;
        }
        next += all;
    }
    return n_chunks;
}

/* Changes the last bytes of a chunk's payload, from one drawn by *r on, and
 * corrects its length, which may change by what fits in `most`. Symbols before
 * stay as they were, so that the chunk may still be valid. Returns the new
 * length of all. */
static size_t change_payload(uint8_t *data, size_t n, size_t most, size_t at,
                             size_t nbytes, uint64_t *r)
{
    const size_t payload = nbytes - SAGA_CHUNK_NBYTES;
    const size_t from = SAGA_CHUNK_NBYTES + (size_t)(gen_random(r) % payload);
    const size_t behind = n - at - nbytes, room = nbytes - from + most - n;
    uint8_t *const part = mutate_must(malloc(room));
    size_t k = nbytes - from;

    memcpy(part, data + at + from, k);
    k = LLVMFuzzerMutate(part, k, room);
    memmove(data + at + from + k, data + at + nbytes, behind);
    memcpy(data + at + from, part, k);
    free(part);
    fx_store32_le(data + at + 4, (uint32_t)(from + k - SAGA_CHUNK_NBYTES));
    return at + from + k + behind;
}

/* One of 16 inputs is a segment as its film has it, one is changed anywhere,
 * and the others in the payload of one chunk. */
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t n, size_t most,
                               unsigned seed)
{
    uint64_t r = seed;
    const unsigned how = (unsigned)(gen_random(&r) % 16);
    size_t at, nbytes;

    if (n < 2 || how == 0) {
        const uint8_t number = (uint8_t)gen_random(&r);
        const film *const f = film_of(number);

        if (f->segment.nbytes < most) {
            data[0] = number;
            memcpy(data + 1, f->file.data + f->segment.offset,
                   f->segment.nbytes);
            return 1 + (size_t)f->segment.nbytes;
        }
    }
    if (how == 1 || !find_chunk(&at, &nbytes, data + 1, n - 1, &r) ||
        nbytes == SAGA_CHUNK_NBYTES)
        return LLVMFuzzerMutate(data, n, most);
    return 1 + change_payload(data + 1, n - 1, most - 1, at, nbytes, &r);
}
