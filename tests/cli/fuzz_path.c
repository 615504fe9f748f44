/* SPDX-License-Identifier: MIT
 *
 * Fuzzes the reader of camera paths (render_path.h) with libFuzzer: the input
 * is a JSON file. Any file may be refused, with a message.
 */
#include "render_path.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static char path[] = "/tmp/saga_path.XXXXXX";

static void end(void)
{
    unlink(path);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    static int begun;
    saga_error error = { "" };
    saga_path read;
    FILE *f;

    if (!begun) {
        begun = 1;
        close(mkstemp(path));
        atexit(end);
    }
    f = fopen(path, "wb");
    if (!f || fwrite(data, 1, n, f) != n || fclose(f))
        abort();
    if (saga_path_read(&read, path, &error))
        saga_path_free(&read);
    else if (!saga_failed(&error))
        abort();
    return 0;
}
