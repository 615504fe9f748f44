/* SPDX-License-Identifier: MIT */
#include "cloud_files.h"

#include <string.h>

extern const saga_cloud_format saga_packed_format, saga_ply_format,
    saga_spz4_format, saga_spz_format, saga_glb_format, saga_sog_format;

/* The first matching format is taken. A format whose files look like another's
 * therefore comes before it, and so does a longer suffix. */
static const saga_cloud_format *const formats[] = {
    &saga_packed_format, &saga_ply_format, &saga_spz4_format, &saga_spz_format,
    &saga_glb_format, &saga_sog_format
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

bool saga_cloud_read(saga_cloud *cloud, const char *path, saga_error *error)
{
    saga_bytes bytes;
    bool ok;

    *cloud = (saga_cloud){ .n = 0 };
    if (!saga_read_file(&bytes, path, error))
        return false;
    ok = read_any(cloud, &bytes, path, error) &&
         saga_cloud_tidy(cloud, path, error);
    saga_bytes_free(&bytes);
    return ok;
}
