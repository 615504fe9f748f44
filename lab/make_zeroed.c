/* SPDX-License-Identifier: MIT
 *
 * make_zeroed IN.saga OUT.saga: writes a copy whose coarse features are zero
 * (lab/gen_zeroed.h). lab/floors.sh compares the two with `saga eval`.
 */
#include "gen_zeroed.h"

#include "error.h"
#include "file.h"
#include "output.h"

#include <stdio.h>
#include <stdlib.h>

static int fail(const char *why)
{
    fprintf(stderr, "make_zeroed: %s\n", why);
    return 1;
}

int main(int argc, char **argv)
{
    saga_error error = { "" };
    saga_bytes in;
    saga_output out;
    uint8_t *bytes;
    size_t n;
    const char *why;

    if (argc != 3) {
        fprintf(stderr, "usage: make_zeroed IN.saga OUT.saga\n");
        return 2;
    }
    if (!saga_read_file(&in, argv[1], &error))
        return fail(error.message);
    why = zeroed_make(&bytes, &n, in.data, in.nbytes, ZEROED_FEATURES);
    saga_bytes_free(&in);
    if (why)
        return fail(why);
    if (!saga_output_open(&out, argv[2], &error) ||
        !saga_output_close(&out, fwrite(bytes, 1, n, out.file) == n, &error))
        return fail(error.message);
    free(bytes);
    return 0;
}
