/* SPDX-License-Identifier: MIT
 *
 * This program fuzzes the readers of captures. The first byte of an input
 * selects the kind of file; the rest is the file. With libFuzzer, and what
 * test_input_damage links:
 *     clang -fsanitize=fuzzer,address,undefined ... fuzz_input.c
 */
#include "gen_input.h"

#include <stdlib.h>

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
