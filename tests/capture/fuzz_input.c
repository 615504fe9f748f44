/* SPDX-License-Identifier: MIT
 *
 * This program fuzzes the readers of captures. The first byte of an input
 * selects the kind of file; the rest is the file. With libFuzzer, and what
 * test_input_damage links:
 *     clang -fsanitize=fuzzer,address,undefined ... fuzz_input.c
 * Without libFuzzer, -DSAGA_FUZZ_MAIN makes a program that plays such inputs,
 * or writes one of each kind to begin with:
 *     fuzz_input FILE...
 *     fuzz_input --seeds DIR
 */
#include "gen_input.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    static int begun;

    if (!begun) {
        begun = 1;
        input_begin();
        atexit(input_end);
    }
    if (n > 0)
        (void)input_play((input_kind)(data[0] % INPUT_N_KINDS), data + 1,
                         n - 1);
    return 0;
}

#ifdef SAGA_FUZZ_MAIN

static int play(const char *path)
{
    static uint8_t data[1 << 20];
    FILE *const f = fopen(path, "rb");

    if (!f) {
        fprintf(stderr, "fuzz_input: %s: cannot read\n", path);
        return 2;
    }
    (void)LLVMFuzzerTestOneInput(data, fread(data, 1, sizeof data, f));
    fclose(f);
    return 0;
}

static int write_seeds(const char *dir)
{
    int ok = 1;

    (void)LLVMFuzzerTestOneInput(NULL, 0);
    for (int k = 0; k < INPUT_N_KINDS && ok; k++) {
        char path[1024];
        size_t n;
        uint8_t *const p = input_seed((input_kind)k, &n);
        FILE *f;

        snprintf(path, sizeof path, "%s/%d", dir, k);
        f = fopen(path, "wb");
        ok = f && fputc(k, f) == k && fwrite(p, 1, n, f) == n;
        ok = f && fclose(f) == 0 && ok;
        free(p);
    }
    return ok ? 0 : 2;
}

int main(int argc, char **argv)
{
    int rc = 0;

    if (argc == 3 && strcmp(argv[1], "--seeds") == 0)
        return write_seeds(argv[2]);
    for (int i = 1; i < argc && rc == 0; i++)
        rc = play(argv[i]);
    return rc;
}

#endif
