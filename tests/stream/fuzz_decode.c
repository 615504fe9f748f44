/* SPDX-License-Identifier: MIT
 *
 * Fuzzes the functions of saga.h. The input is a file. Its checksum determines
 * how it is played. In seven of eight cases its CRCs are computed anew
 * ("signed"), so that changes reach the code behind the CRC checks.
 *
 * With libFuzzer:
 *     clang -fsanitize=fuzzer,address,undefined -DSAGA_CHECK ... fuzz_decode.c
 * Without: -DSAGA_FUZZ_MAIN makes a program of it that plays files, or writes
 * small streams to begin with, or files as they are played, signed:
 *     fuzz_decode FILE...
 *     fuzz_decode --seeds DIR N
 *     fuzz_decode --signed DIR FILE...
 * What it prints for the same files must be the same on every machine.
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

/* The checksum of all pictures and statuses so far. */
static uint32_t total;

/* Number of inputs that were played, of those that entered a segment, and of
 * those that drew a picture. */
static unsigned long n_played, n_entered, n_drawn;

static void tell(void)
{
    printf("fuzz_decode: %lu played, %lu entered a segment, %lu drew\n",
           n_played, n_entered, n_drawn);
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

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    uint8_t *const copy = signed_copy(data, n);
    uint64_t r = saga_crc32c(0, data, n);
    mutate_result result;

    mutate_play(&result, copy, n, &r);
    free(copy);
    if (n_played++ == 0)
        atexit(tell);
    n_entered += result.n_segments > 0 || result.stage > MUTATE_AT_SEGMENT;
    n_drawn += result.stage == MUTATE_DRAWN;
    total = total * 31u + result.crc;
    if (result.broken) {
        fprintf(stderr, "fuzz_decode: not so: %s\n", result.broken);
        abort();
    }
    return 0;
}

#ifndef SAGA_FUZZ_MAIN

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

#else

static uint8_t *read_file(const char *path, size_t *n)
{
    FILE *const f = fopen(path, "rb");
    size_t cap = 1 << 16, got;
    uint8_t *p;

    if (!f)
        return NULL;
    p = mutate_must(malloc(cap));
    *n = 0;
    while ((got = fread(p + *n, 1, cap - *n, f)) > 0) {
        *n += got;
        if (*n == cap) {
            cap *= 2;
            p = mutate_must(realloc(p, cap));
        }
    }
    fclose(f);
    return p;
}

static int play_file(const char *path)
{
    size_t n = 0;
    uint8_t *const p = read_file(path, &n);

    if (!p) {
        fprintf(stderr, "fuzz_decode: %s: cannot read\n", path);
        return 2;
    }
    (void)LLVMFuzzerTestOneInput(p, n);
    free(p);
    return 0;
}

static int write_file(const char *path, const uint8_t *p, size_t n)
{
    FILE *const f = fopen(path, "wb");

    if (!f || fwrite(p, 1, n, f) != n || fclose(f)) {
        fprintf(stderr, "fuzz_decode: %s: cannot write\n", path);
        return 2;
    }
    return 0;
}

/* Writes the smallest of several random streams, since networks are most of a
 * file. */
static int write_seed(const char *dir, uint32_t number)
{
    uint8_t *best = NULL;
    size_t n_best = 0;
    char path[1024];
    int rc;

    for (uint32_t i = 0; i < 50; i++) {
        gen_options o;
        gen_stream g;
        uint64_t r = i;
        uint8_t *bytes;
        size_t n;

        memset(&o, 0, sizeof o);
        o.seed = 50u * number + i;
        o.n_coarse = 3;
        o.bank = (int)(number % 3);
        g = gen_stream_make(&o);
        if (number & 1)
            mutate_extreme_nets(&g, &r);
        gen_stream_encode(&g, &bytes, &n);
        gen_stream_free(&g);
        if (best && n >= n_best) {
            free(bytes);
            continue;
        }
        free(best);
        best = bytes;
        n_best = n;
    }
    snprintf(path, sizeof path, "%s/%u.saga", dir, (unsigned)number);
    rc = write_file(path, best, n_best);
    free(best);
    return rc;
}

static int write_signed(const char *dir, const char *path, int number)
{
    char to[1024];
    size_t n = 0;
    uint8_t *const p = read_file(path, &n);
    uint8_t *copy;
    int rc;

    if (!p) {
        fprintf(stderr, "fuzz_decode: %s: cannot read\n", path);
        return 2;
    }
    copy = signed_copy(p, n);
    snprintf(to, sizeof to, "%s/%03d.saga", dir, number);
    rc = write_file(to, copy, n);
    free(copy);
    free(p);
    return rc;
}

int main(int argc, char **argv)
{
    int rc = 0;

    if (argc == 4 && strcmp(argv[1], "--seeds") == 0) {
        const uint32_t n = (uint32_t)strtoul(argv[3], NULL, 0);

        for (uint32_t k = 0; k < n && rc == 0; k++)
            rc = write_seed(argv[2], k);
        return rc;
    }
    if (argc > 3 && strcmp(argv[1], "--signed") == 0) {
        for (int i = 3; i < argc && rc == 0; i++)
            rc = write_signed(argv[2], argv[i], i - 3);
        return rc;
    }
    if (argc < 2) {
        fprintf(stderr, "usage: fuzz_decode FILE... | --seeds DIR N | "
                        "--signed DIR FILE...\n");
        return 2;
    }
    for (int i = 1; i < argc && rc == 0; i++)
        rc = play_file(argv[i]);
    if (rc == 0)
        printf("%d files played, %08lx\n", argc - 1, (unsigned long)total);
    return rc;
}

#endif
