/* SPDX-License-Identifier: MIT */
#include "cloud_files.h"

#include <string.h>
#include <sys/stat.h>

extern const saga_cloud_format saga_packed_format, saga_moving_ply_format,
    saga_ply_format, saga_spz4_format, saga_spz_format, saga_glb_format,
    saga_sog_format;

/* The first matching format is taken. A format whose files look like another's
 * therefore comes before it, and so does a longer suffix. */
static const saga_cloud_format *const formats[] = {
    &saga_packed_format, &saga_moving_ply_format, &saga_ply_format,
    &saga_spz4_format,   &saga_spz_format,        &saga_glb_format,
    &saga_sog_format
};

enum { N_FORMATS = sizeof formats / sizeof formats[0] };

const saga_cloud_format *saga_cloud_format_at(int i)
{
    return i < N_FORMATS ? formats[i] : NULL;
}

const saga_cloud_format *saga_cloud_format_of(const char *name)
{
    for (int i = 0; i < N_FORMATS; i++)
        if (saga_has_suffix(name, formats[i]->suffix))
            return formats[i];
    return NULL;
}

bool saga_cloud_moves(const saga_cloud_format *format)
{
    return format == &saga_moving_ply_format;
}

void saga_cloud_suffixes(char text[SAGA_SUFFIXES_NBYTES])
{
    size_t n = 0;

    for (int i = 0; i < N_FORMATS; i++)
        n += (size_t)snprintf(text + n, SAGA_SUFFIXES_NBYTES - n, "%s%s",
                              i ? ", " : "", formats[i]->suffix);
}

bool saga_cloud_write(const char *path, saga_cloud *cloud, saga_error *error)
{
    const saga_cloud_format *const format = saga_cloud_format_of(path);
    char known[SAGA_SUFFIXES_NBYTES];

    if (format)
        return format->write(path, cloud, error);
    saga_cloud_suffixes(known);
    return saga_fail(error, path, "use one of these endings",
                     "its ending belongs to no splat format (%s)", known);
}

static bool read_any(saga_cloud *cloud, const saga_bytes *bytes,
                     const char *path, saga_error *error)
{
    char known[SAGA_SUFFIXES_NBYTES];

    for (int i = 0; i < N_FORMATS; i++)
        if (formats[i]->is_it(bytes))
            return formats[i]->read(cloud, bytes, path, error);
    saga_cloud_suffixes(known);
    return saga_fail(error, path, "export the splats in one of these",
                     "is not in a known splat format (%s)", known);
}

/* Reads the bytes of a file that is not larger than `most`; 0: any. */
static bool read_bytes(saga_bytes *bytes, const char *path, uint64_t most,
                       saga_error *error)
{
    struct stat info;

    if (most && stat(path, &info) == 0 && S_ISREG(info.st_mode) &&
        (uint64_t)info.st_size > most)
        return saga_fail(error, path,
                         "give more --memory or a file of fewer "
                         "splats",
                         "has %.1f GiB; --memory allows %.1f",
                         0x1p-30 * (double)info.st_size,
                         0x1p-30 * (double)most);
    return saga_read_file(bytes, path, error);
}

bool saga_cloud_read(saga_cloud *cloud, const char *path, uint64_t most_nbytes,
                     saga_error *error)
{
    return saga_cloud_read_frame(cloud, path, 0, most_nbytes, error);
}

bool saga_cloud_read_frame(saga_cloud *cloud, const char *path, uint32_t frame,
                           uint64_t most_nbytes, saga_error *error)
{
    saga_bytes bytes;
    bool ok;

    *cloud = (saga_cloud){ .frame = frame };
    if (!read_bytes(&bytes, path, most_nbytes, error))
        return false;
    /* Its splats have what the file leaves; at least a byte, because 0 means
     * any number. */
    if (most_nbytes)
        cloud->most_nbytes = most_nbytes - bytes.nbytes + 1;
    ok = read_any(cloud, &bytes, path, error) &&
         saga_cloud_tidy(cloud, path, error);
    saga_bytes_free(&bytes);
    return ok;
}

/* Tells whether a number is beyond a range by more than is lost in rounding. */
static bool is_beyond(const float *v, size_t n, float least, float most)
{
    const float slack = 1.0f / 32;

    for (size_t i = 0; i < n; i++)
        if (v[i] < least - slack || v[i] > most + slack)
            return least < most;
    return false;
}

size_t saga_cloud_beyond(const saga_cloud *cloud,
                         const saga_cloud_format *format, int of)
{
    const saga_cloud_limits *const l = &format->limits;
    const size_t each = 3 * (size_t)saga_n_harmonics(cloud->degree);
    size_t n = 0;

    for (size_t i = 0; i < cloud->n; i++) {
        const float *const colour = cloud->colour + each * i;

        n += of == 0 ? is_beyond(cloud->log_scale + 3 * i, 3, l->log_scale[0],
                                 l->log_scale[1])
                     : is_beyond(colour, 3, -l->constant, l->constant) ||
                           is_beyond(colour + 3, each - 3, -l->rest, l->rest);
    }
    return n;
}
