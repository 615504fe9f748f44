/* SPDX-License-Identifier: MIT
 *
 * PLY has the layout of the first Gaussian splatting: x y z nx ny nz f_dc
 * f_rest opacity scale rot, all floats; normals are zeros. It is exact.
 */
#include "cloud_files.h"

#include "output.h"
#include "ply.h"
#include "put.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_FLOATS = 14 + 3 * SAGA_MAX_HARMONICS };

static void write_header(FILE *f, const saga_cloud *cloud)
{
    const int n_rest = 3 * (saga_n_harmonics(cloud->degree) - 1);

    fprintf(f,
            "ply\nformat binary_little_endian 1.0\nelement vertex %zu\n"
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

/* Writes splat i and returns the number of bytes. f_rest lists all coefficients
 * of red first, then of green, then of blue. */
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

static bool write_ply(const char *path, saga_cloud *cloud, saga_error *error)
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

/* --- Reading ------------------------------------------------------------- */

enum {
    X,
    Y,
    Z,
    DC,
    OPACITY = DC + 3,
    SCALE,
    ROT = SCALE + 3,
    REST = ROT + 4,
    MOST_REST = 3 * (SAGA_MAX_HARMONICS - 1),
    MOVES = REST + MOST_REST, /* only files of moving splats have it */
    N_COLUMNS
};

/* Sets the names of the columns above. */
static void name_columns(char text[N_COLUMNS][16], const char *name[N_COLUMNS])
{
    static const struct {
        const char *stem;
        int first, n;
    } numbered[] = { { "f_dc_", DC, 3 },
                     { "scale_", SCALE, 3 },
                     { "rot_", ROT, 4 },
                     { "f_rest_", REST, MOST_REST } };

    (void)snprintf(text[X], sizeof text[X], "x");
    (void)snprintf(text[Y], sizeof text[Y], "y");
    (void)snprintf(text[Z], sizeof text[Z], "z");
    (void)snprintf(text[OPACITY], sizeof text[OPACITY], "opacity");
    (void)snprintf(text[MOVES], sizeof text[MOVES], "velocity_0");
    for (size_t k = 0; k < sizeof numbered / sizeof numbered[0]; k++)
        for (int i = 0; i < numbered[k].n; i++)
            (void)snprintf(text[numbered[k].first + i], sizeof text[0], "%s%d",
                           numbered[k].stem, i);
    for (int i = 0; i < N_COLUMNS; i++)
        name[i] = text[i];
}

/* Finds the degree by the columns that the file has. */
static bool find_degree(int *degree, const saga_ply *ply, saga_error *error)
{
    int n = 0;

    for (int i = 0; i < REST; i++)
        if (ply->field[i] < 0)
            return saga_fail(error, ply->path,
                             "export the splats as a PLY "
                             "with x y z, f_dc_*, opacity, scale_* and rot_*",
                             "its vertices have no %s", ply->names[i]);
    while (n < MOST_REST && ply->field[REST + n] >= 0)
        n++;
    *degree = saga_degree_of_rest(n);
    return *degree >= 0 || saga_fail(error, ply->path, "take 0, 9, 24 or 45",
                                     "has %d values "
                                     "of f_rest",
                                     n);
}

/* FreeTimeGS writes the splats of all times into one PLY (.ftgs.ply), each with
 * a time and a velocity. Together they are the cloud of no moment. */
static bool is_moment(const saga_ply *ply, saga_error *error)
{
    return ply->field[MOVES] < 0 ||
           saga_fail(error, ply->path,
                     "export every frame as a PLY of its own, into one folder",
                     "has splats that move, with their %s, which is not read",
                     ply->names[MOVES]);
}

static void take_splat(saga_cloud *cloud, size_t i, const float *row)
{
    const int n = saga_n_harmonics(cloud->degree);
    float *const colour = cloud->colour + 3 * (size_t)n * i;

    memcpy(cloud->mean + 3 * i, row + X, 3 * sizeof *row);
    memcpy(cloud->log_scale + 3 * i, row + SCALE, 3 * sizeof *row);
    memcpy(cloud->quat + 4 * i, row + ROT, 4 * sizeof *row);
    memcpy(colour, row + DC, 3 * sizeof *row);
    cloud->logit[i] = row[OPACITY];
    /* f_rest lists red first, then green, then blue. */
    for (int c = 0; c < 3; c++)
        for (int k = 1; k < n; k++)
            colour[3 * k + c] = row[REST + c * (n - 1) + k - 1];
}

static bool read_ply(saga_cloud *cloud, const saga_bytes *bytes,
                     const char *path, saga_error *error)
{
    char text[N_COLUMNS][16];
    const char *name[N_COLUMNS];
    saga_ply ply = { .path = path, .names = name, .n_fields = N_COLUMNS };
    float row[N_COLUMNS];
    int degree;
    bool ok;

    name_columns(text, name);
    ok = saga_ply_open(&ply, bytes, error) &&
         find_degree(&degree, &ply, error) && is_moment(&ply, error) &&
         saga_cloud_admit(cloud, (size_t)ply.count, degree, path, error);
    for (size_t i = 0; i < cloud->n && ok; i++) {
        ok = saga_ply_next(row, &ply, i, error);
        if (ok)
            take_splat(cloud, i, row);
    }
    cloud->form = SAGA_FORM_LOG;
    if (!ok)
        saga_cloud_free(cloud);
    return ok;
}

static bool is_ply(const saga_bytes *bytes)
{
    return bytes->nbytes > 4 && memcmp(bytes->data, "ply", 3) == 0 &&
           (bytes->data[3] == '\n' || bytes->data[3] == '\r');
}

const saga_cloud_format saga_ply_format = { "PLY",
                                            ".ply",
                                            "floats, as trainers write them",
                                            is_ply,
                                            read_ply,
                                            write_ply,
                                            { .log_scale = { 0 } } };
