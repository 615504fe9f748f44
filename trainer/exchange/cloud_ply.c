/* SPDX-License-Identifier: MIT
 *
 * PLY has the layout of the first Gaussian splatting: x y z nx ny nz f_dc
 * f_rest opacity scale rot, all floats; normals are zeros. It is exact.
 *
 * "FTGS PLY, version 1" (.ftgs.ply), the layout of FreeTimeGS's splats, adds
 * time, log_duration and velocity, for which the film lasts from 0 to 1: frame
 * i of n is at i / max(n - 1, 1).
 */
#include "cloud_files.h"

#include "output.h"
#include "ply.h"
#include "put.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* `saga import` takes as many files as frames. */
enum { MOST_FRAMES = 65535 };
enum { MOST_FLOATS = 14 + 3 * SAGA_MAX_HARMONICS + SAGA_N_MOTION };

static void write_notes(FILE *f, const saga_cloud *cloud)
{
    fprintf(f,
            "comment ftgs_version 1\ncomment time_units normalized\n"
            "comment sh_degree %d\ncomment use_velocity 1\n"
            "comment opacity_floor 0.0001\ncomment n_frames %" PRIu32 "\n",
            cloud->degree, cloud->n_frames);
}

static void write_header(FILE *f, const saga_cloud *cloud)
{
    static const char *const motion[SAGA_N_MOTION] = {
        "time", "log_duration", "velocity_0", "velocity_1", "velocity_2"
    };
    const int n_rest = 3 * (saga_n_harmonics(cloud->degree) - 1);

    fputs("ply\nformat binary_little_endian 1.0\n", f);
    if (cloud->motion)
        write_notes(f, cloud);
    fprintf(f,
            "element vertex %zu\n"
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
    for (int k = 0; cloud->motion && k < SAGA_N_MOTION; k++)
        fprintf(f, "property float %s\n", motion[k]);
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
    if (cloud->motion)
        put_all(&at, cloud->motion + SAGA_N_MOTION * i, SAGA_N_MOTION);
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
    TIME = REST + MOST_REST, /* these only files of moving splats have */
    LOG_DURATION,
    VELOCITY,
    N_COLUMNS = VELOCITY + 3
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
                     { "f_rest_", REST, MOST_REST },
                     { "velocity_", VELOCITY, 3 } };

    (void)snprintf(text[X], sizeof text[X], "x");
    (void)snprintf(text[Y], sizeof text[Y], "y");
    (void)snprintf(text[Z], sizeof text[Z], "z");
    (void)snprintf(text[OPACITY], sizeof text[OPACITY], "opacity");
    (void)snprintf(text[TIME], sizeof text[TIME], "time");
    (void)snprintf(text[LOG_DURATION], sizeof text[0], "log_duration");
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

/* Properties of a file of moving splats, from the comments of its header. */
typedef struct {
    unsigned n_frames, use_velocity;
    bool normalized;
} notes;

static void read_notes(notes *to, const saga_bytes *bytes)
{
    saga_cursor c = { bytes->data, bytes->data + bytes->nbytes, false };
    char line[128];

    *to = (notes){ .use_velocity = 1 };
    while (saga_take_line(&c, line, sizeof line) &&
           strcmp(line, "end_header") != 0) {
        (void)sscanf(line, "comment n_frames %u", &to->n_frames);
        (void)sscanf(line, "comment use_velocity %u", &to->use_velocity);
        to->normalized |= !strcmp(line, "comment time_units normalized");
    }
}

/* Finds the moment of a file of moving splats; such a file has a velocity_0. */
static bool find_moment(notes *to, const saga_ply *ply, const saga_bytes *bytes,
                        saga_error *error)
{
    static const char remedy[] = "export every frame as a PLY of its own, into "
                                 "one folder";

    read_notes(to, bytes);
    for (int i = TIME; i < N_COLUMNS; i++)
        if (ply->field[i] < 0)
            return saga_fail(error, ply->path, remedy,
                             "has splats that move, but no %s", ply->names[i]);
    if (!to->normalized)
        return saga_fail(error, ply->path, remedy,
                         "has splats that move, without the comment "
                         "\"time_units normalized\", so that their unit of "
                         "time is unknown");
    if (to->n_frames < 1 || to->n_frames > MOST_FRAMES)
        return saga_fail(error, ply->path,
                         "write \"comment n_frames N\" into its header",
                         "has splats that move, but not the number of frames, "
                         "1 to %d",
                         MOST_FRAMES);
    return true;
}

/* Moves and fades a splat; returns whether it is seen at the moment. Opacities
 * that FreeTimeGS raises to 1e-4 are not. */
static bool animate(float *row, uint32_t frame, const notes *about)
{
    const double t = about->n_frames > 1 ? frame / (about->n_frames - 1.0) : 0;
    const double since = t - (double)row[TIME];
    const double u = since / exp((double)row[LOG_DURATION]);
    const double opacity = exp(-0.5 * u * u) /
                           (1.0 + exp(-(double)row[OPACITY]));

    for (int k = 0; k < 3 && about->use_velocity; k++)
        row[X + k] = (float)(row[X + k] + row[VELOCITY + k] * since);
    row[OPACITY] = saga_cloud_logit(opacity);
    return !(opacity < 1.0 / 256);
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
    const uint32_t frame = cloud->frame;
    notes about = { 0 };
    int degree;
    size_t n = 0;
    bool ok;

    name_columns(text, name);
    ok = saga_ply_open(&ply, bytes, error) &&
         find_degree(&degree, &ply, error) &&
         (ply.field[VELOCITY] < 0 || find_moment(&about, &ply, bytes, error)) &&
         saga_cloud_admit(cloud, (size_t)ply.count, degree, path, error);
    for (uint64_t i = 0; i < ply.count && ok; i++) {
        ok = saga_ply_next(row, &ply, i, error);
        if (ok && (!about.n_frames || animate(row, frame, &about)))
            take_splat(cloud, n++, row);
    }
    cloud->n = n;
    cloud->n_frames = about.n_frames;
    cloud->frame = frame; /* for messages */
    cloud->form = about.n_frames ? SAGA_FORM_SURE : SAGA_FORM_LOG;
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

static bool is_never(const saga_bytes *bytes)
{
    (void)bytes;
    return false;
}

/* Files of both kinds are recognised and read as PLY. */
const saga_cloud_format saga_moving_ply_format = {
    "FTGS PLY",
    ".ftgs.ply",
    "a film of one segment in one file: splats that move along lines and fade, "
    "as FreeTimeGS has them",
    is_never,
    read_ply,
    write_ply,
    { .log_scale = { 0 } }
};
