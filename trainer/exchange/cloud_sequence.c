/* SPDX-License-Identifier: MIT */
#include "cloud_sequence.h"

#include "alloc.h"
#include "cloud_4dgs.h"
#include "cloud_splat4d.h"

#include <math.h>
#include <stdlib.h>

_Static_assert((int)SAGA_SEQUENCE_HEAD_NBYTES >= (int)SAGA_SPLAT4D_HEAD_NBYTES
               && (int)SAGA_SEQUENCE_HEAD_NBYTES >= (int)SAGA_4DGS_MAGIC_NBYTES,
               "the head must suffice for all formats");

struct saga_cloud_sequence {
    saga_splat4d *splat4d;   /* one of the two is NULL */
    saga_4dgs *gs4;
    double fps;
};

bool saga_is_sequence(const saga_bytes *bytes)
{
    return saga_is_splat4d(bytes) || saga_is_4dgs(bytes);
}

saga_cloud_sequence *saga_sequence_open(const saga_bytes *bytes,
                                        const char *path, double fps,
                                        saga_error *error)
{
    saga_cloud_sequence *const s = saga_calloc(1, sizeof *s, path, error);

    if (!s)
        return NULL;
    s->fps = isnan(fps) ? 30.0 : fps;
    if (saga_is_4dgs(bytes))
        s->gs4 = saga_4dgs_open(bytes, path, s->fps, error);
    else
        s->splat4d = saga_splat4d_open(bytes, path, error);
    if (s->splat4d && isnan(fps))
        s->fps = saga_splat4d_fps(s->splat4d);
    if (s->gs4 || s->splat4d)
        return s;
    free(s);
    return NULL;
}

void saga_sequence_free(saga_cloud_sequence *sequence)
{
    if (!sequence)
        return;
    saga_splat4d_free(sequence->splat4d);
    saga_4dgs_free(sequence->gs4);
    free(sequence);
}

int saga_sequence_n_frames(const saga_cloud_sequence *sequence)
{
    return sequence->gs4 ? saga_4dgs_n_frames(sequence->gs4)
                         : saga_splat4d_n_frames(sequence->splat4d);
}

double saga_sequence_fps(const saga_cloud_sequence *sequence)
{
    return sequence->fps;
}

bool saga_sequence_read(saga_cloud *cloud, saga_cloud_sequence *sequence,
                        int frame, saga_error *error)
{
    return sequence->gs4
        ? saga_4dgs_read(cloud, sequence->gs4, frame, error)
        : saga_splat4d_read(cloud, sequence->splat4d, frame, error);
}
