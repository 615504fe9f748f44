/* SPDX-License-Identifier: MIT
 *
 * Fuzzes the functions of saga.h. The input is a file. Its checksum determines
 * how it is played. In seven of eight cases its CRCs are computed anew
 * ("signed"), so that changes reach the code behind the CRC checks.
 *
 * `SAGA_FUZZ_SIGNED=FILE fuzz_decode INPUT` also writes the input as it is
 * played, for tests/corpus.
 */
#include "fx.h"
#include "gen_mutate.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t n, size_t most,
                               unsigned seed);
/* libFuzzer's own changes, which may change the length up to `most`. */
size_t LLVMFuzzerMutate(uint8_t *data, size_t n, size_t most);

/* Number of inputs that were played, of those that had a valid segment, and of
 * those that drew a picture. */
static unsigned long n_played, n_decoded, n_drawn;

static void tell(void)
{
    printf("fuzz_decode: %lu played, %lu decoded a segment, %lu drew\n",
           n_played, n_decoded, n_drawn);
}

/* Returns a signed copy of an input, which the caller frees. */
static uint8_t *signed_copy(const uint8_t *data, size_t n)
{
    uint8_t *const copy = mutate_must(malloc(n + 1));

    if (n)
        memcpy(copy, data, n);
    if (saga_crc32c(0, data, n) % 8)
        mutate_sign(copy, n);
    return copy;
}

static void keep(const uint8_t *copy, size_t n)
{
    const char *const path = getenv("SAGA_FUZZ_SIGNED");
    FILE *const f = path ? fopen(path, "wb") : NULL;

    if (path && (!f || fwrite(copy, 1, n, f) != n || fclose(f)))
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    uint8_t *const copy = signed_copy(data, n);
    uint64_t r = saga_crc32c(0, data, n);
    mutate_result result;

    mutate_play(&result, copy, n, &r);
    keep(copy, n);
    free(copy);
    if (n_played++ == 0)
        atexit(tell);
    n_decoded += result.n_segments > 0;
    n_drawn += result.stage == MUTATE_DRAWN;
    if (result.broken) {
        fprintf(stderr, "fuzz_decode: not so: %s\n", result.broken);
        abort();
    }
    return 0;
}

/* Most changes keep the length and are within 16 bytes behind the cameras, so
 * that the file's structure remains. Two of three are in its last quarter,
 * because a change of the networks, which come before, is mostly refused. */
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t n, size_t most,
                               unsigned seed)
{
    uint64_t r = seed;
    uint8_t part[16];
    size_t head, at, k;

    if (n < 16 || seed % 4 == 0)
        return LLVMFuzzerMutate(data, n, most);
    head = fx_load32_le(data + 8);
    if (head >= n)
        return LLVMFuzzerMutate(data, n, most);
    if (seed % 4 < 3 && head < n - n / 4)
        head = n - n / 4;
    at = head + (size_t)(gen_random(&r) % (n - head));
    k = n - at < sizeof part ? n - at : sizeof part;
    memcpy(part, data + at, k);
    k = LLVMFuzzerMutate(part, k, k);
    memcpy(data + at, part, k);
    return n;
}
