/* SPDX-License-Identifier: MIT */
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

/* --- Reading ------------------------------------------------------------- */

enum { X, Y, Z, DC, OPACITY = DC + 3, SCALE, ROT = SCALE + 3, REST = ROT + 4,
       MOST_REST = 3 * (SAGA_MAX_HARMONICS - 1), N_COLUMNS = REST + MOST_REST };

/* Sets the names of the columns above. */
static void name_columns(char text[N_COLUMNS][16],
                         const char *name[N_COLUMNS])
{
    static const struct {
        const char *stem;
        int first, n;
    } numbered[] = {
        { "f_dc_", DC, 3 }, { "scale_", SCALE, 3 }, { "rot_", ROT, 4 },
        { "f_rest_", REST, MOST_REST }
    };

    (void)snprintf(text[X], sizeof text[X], "x");
    (void)snprintf(text[Y], sizeof text[Y], "y");
    (void)snprintf(text[Z], sizeof text[Z], "z");
    (void)snprintf(text[OPACITY], sizeof text[OPACITY], "opacity");
    for (size_t k = 0; k < sizeof numbered / sizeof numbered[0]; k++)
        for (int i = 0; i < numbered[k].n; i++)
            (void)snprintf(text[numbered[k].first + i], sizeof text[0],
                           "%s%d", numbered[k].stem, i);
    for (int i = 0; i < N_COLUMNS; i++)
        name[i] = text[i];
}

/* Returns the degree that n values of f_rest make, -1 if none. */
static int degree_of(int n)
{
    for (int degree = 0; degree <= SAGA_MAX_DEGREE; degree++)
        if (n == 3 * (saga_n_harmonics(degree) - 1))
            return degree;
    return -1;
}

/* Finds the degree by the columns that are there; a first row tells. */
static bool find_degree(int *degree, const char *path,
                        const char *const *name, const float *row,
                        saga_error *error)
{
    int n = 0;

    /* saga_ply_columns gives NaN where the file lacks a column. */
    for (int i = 0; i < REST; i++)
        if (isnan(row[i]))
            return saga_fail(error, path, "export the splats as a PLY with x y "
                             "z, f_dc_*, opacity, scale_* and rot_*",
                             "its first splat has no %s", name[i]);
    while (n < MOST_REST && !isnan(row[REST + n]))
        n++;
    *degree = degree_of(n);
    return *degree >= 0 ||
           saga_fail(error, path, "take 0, 9, 24 or 45", "has %d values of "
                     "f_rest", n);
}

/* Splats that are wholly opaque may have an infinite logit. */
#define MOST_LOGIT 16.0f

/* Below the decoder's cut of 1/256 nothing is drawn. */
#define LEAST_LOGIT (-5.54f)

static bool is_sound(const float *row, int degree)
{
    const int n = REST + 3 * (saga_n_harmonics(degree) - 1);

    /* Both comparisons are so written that NaN fails them. */
    for (int i = 0; i < n; i++)
        if (i != OPACITY && !(fabsf(row[i]) <= 1e6f))
            return false;
    return row[OPACITY] >= LEAST_LOGIT;
}

static void take_splat(saga_cloud *cloud, const float *row)
{
    const size_t i = cloud->n++;
    const int n = saga_n_harmonics(cloud->degree);
    float *const colour = cloud->colour + 3 * (size_t)n * i;
    double length = 0.0;

    memcpy(cloud->mean + 3 * i, row + X, 3 * sizeof *row);
    memcpy(cloud->log_scale + 3 * i, row + SCALE, 3 * sizeof *row);
    memcpy(colour, row + DC, 3 * sizeof *row);
    cloud->logit[i] = fminf(row[OPACITY], MOST_LOGIT);
    /* Quaternions may come in any length; one of length 0 is no rotation. */
    for (int k = 0; k < 4; k++)
        length += (double)row[ROT + k] * (double)row[ROT + k];
    for (int k = 0; k < 4; k++)
        cloud->quat[4 * i + (size_t)k] = length > 0.0
            ? (float)((double)row[ROT + k] / sqrt(length)) : k == 0;
    /* f_rest has all of red first, then green, then blue. */
    for (int c = 0; c < 3; c++)
        for (int k = 1; k < n; k++)
            colour[3 * k + c] = row[REST + c * (n - 1) + k - 1];
}

bool saga_cloud_read_ply(saga_cloud *cloud, const char *path,
                         saga_error *error)
{
    char text[N_COLUMNS][16];
    const char *name[N_COLUMNS];
    float *rows;
    size_t n;
    int degree;
    bool ok;

    *cloud = (saga_cloud){ .n = 0 };
    name_columns(text, name);
    if (!saga_ply_columns(path, name, N_COLUMNS, &rows, &n, error))
        return false;
    ok = (n > 0 || saga_fail(error, path, "leave it out", "has no splats")) &&
         find_degree(&degree, path, name, rows, error) &&
         saga_cloud_alloc(cloud, n, degree, error);
    /* There is room for every row; from here n counts those that are taken. */
    cloud->n = 0;
    for (size_t i = 0; i < n && ok; i++)
        if (is_sound(rows + N_COLUMNS * i, degree))
            take_splat(cloud, rows + N_COLUMNS * i);
    free(rows);
    if (ok && !cloud->n)
        ok = saga_fail(error, path, "train it again", "has no splat whose "
                       "numbers are finite and that can be seen");
    if (!ok)
        saga_cloud_free(cloud);
    return ok;
}
