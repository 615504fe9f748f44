/* SPDX-License-Identifier: MIT */
#include "cloud_files.h"

#include "output.h"
#include "put.h"

enum { MOST_FLOATS = 14 + 3 * SAGA_MAX_HARMONICS };

static void write_header(FILE *f, const saga_cloud *cloud)
{
    const int n_rest = 3 * (saga_n_harmonics(cloud->degree) - 1);

    fprintf(f, "ply\nformat binary_little_endian 1.0\nelement vertex %zu\n"
            "property float x\nproperty float y\nproperty float z\n"
            "property float nx\nproperty float ny\nproperty float nz\n",
            cloud->n);
    for (int k = 0; k < 3; k++)
        fprintf(f, "property float f_dc_%d\n", k);
    for (int k = 0; k < n_rest; k++)
        fprintf(f, "property float f_rest_%d\n", k);
    fputs("property float opacity\n", f);
    for (int k = 0; k < 3; k++)
        fprintf(f, "property float scale_%d\n", k);
    for (int k = 0; k < 4; k++)
        fprintf(f, "property float rot_%d\n", k);
    fputs("end_header\n", f);
}

static void put_all(uint8_t **at, const float *v, int n)
{
    for (int k = 0; k < n; k++)
        saga_put_f32(at, v[k]);
}

/* Returns the bytes of splat i. f_rest has all of red first, then green. */
static size_t put_splat(uint8_t *record, const saga_cloud *cloud, size_t i)
{
    static const float normal[3] = { 0.0f, 0.0f, 0.0f };
    const int n = saga_n_harmonics(cloud->degree);
    const float *const colour = cloud->colour + 3 * (size_t)n * i;
    uint8_t *at = record;

    put_all(&at, cloud->mean + 3 * i, 3);
    put_all(&at, normal, 3);
    put_all(&at, colour, 3);
    for (int c = 0; c < 3; c++)
        for (int k = 1; k < n; k++)
            saga_put_f32(&at, colour[3 * k + c]);
    saga_put_f32(&at, cloud->logit[i]);
    put_all(&at, cloud->log_scale + 3 * i, 3);
    put_all(&at, cloud->quat + 4 * i, 4);
    return (size_t)(at - record);
}

bool saga_cloud_write_ply(const char *path, const saga_cloud *cloud,
                          saga_error *error)
{
    saga_output out;
    bool ok = true;

    if (!saga_output_open(&out, path, error))
        return false;
    write_header(out.file, cloud);
    for (size_t i = 0; i < cloud->n && ok; i++) {
        uint8_t record[4 * MOST_FLOATS];
        const size_t n = put_splat(record, cloud, i);

        ok = fwrite(record, 1, n, out.file) == n;
    }
    return saga_output_close(&out, ok, error);
}
