/* SPDX-License-Identifier: MIT
 *
 * This program uses the library as a user's C program would: with the header,
 * the library and static memory. It prints the CRC of the picture that a file's
 * first camera sees at its first time.
 *
 *     use_from_c FILE.saga
 */
#include <saga.h>

#include <stdio.h>
#include <string.h>

enum { SIDE = 1024, LIST = 1024 };

static _Alignas(SAGA_WORK_ALIGN) uint8_t work[SAGA_WORK_MAX(1)];
static uint8_t bytes[1 << 20], rgb[3 * SIDE * SIDE];
static _Alignas(4) uint8_t scratch[SAGA_JOB_NBYTES(16, LIST)];

/* Opens the file and decodes its first segment, so that it can be drawn. */
static saga_status prepare(saga_decoder **dec, saga_camera *camera, size_t n)
{
    saga_info info;
    saga_segment seg;
    uint32_t number;
    saga_status s = saga_probe(&info, bytes, n);

    if (s || info.head_nbytes > n)
        return s ? s : SAGA_ERR_TRUNCATED;
    s = saga_open(dec, work, sizeof work, bytes, info.head_nbytes, NULL);
    if (!s)
        s = saga_rig(camera, &number, bytes, info.head_nbytes, 0);
    if (!s)
        s = saga_find(&seg, bytes, info.head_nbytes, 0, 1);
    if (s)
        return s;
    if (seg.offset > n || seg.nbytes > n - seg.offset)
        return SAGA_ERR_TRUNCATED;
    s = saga_decode(*dec, &seg, bytes + seg.offset, seg.nbytes, NULL);
    return s ? s : saga_view(*dec, camera, seg.t);
}

static saga_status draw(const saga_decoder *dec, const saga_camera *camera)
{
    saga_picture picture = { rgb, 3u * camera->width, sizeof rgb, 8 };
    saga_job job;
    saga_status s;

    memset(&job, 0, sizeof job);
    job.x1 = camera->width;
    job.y1 = camera->height;
    job.tile = 16;
    job.list_capacity = LIST;
    job.scratch = scratch;
    job.scratch_nbytes = sizeof scratch;
    do
        s = saga_draw(dec, &job, &picture, 10000);
    while (s == SAGA_AGAIN);
    return s;
}

int main(int argc, char **argv)
{
    FILE *const f = argc == 2 ? fopen(argv[1], "rb") : NULL;
    saga_decoder *dec;
    saga_camera camera;
    saga_status s;
    size_t n;

    if (!f)
        return 2;
    n = fread(bytes, 1, sizeof bytes, f);
    fclose(f);
    s = prepare(&dec, &camera, n);
    if (!s)
        s = draw(dec, &camera);
    if (s) {
        fprintf(stderr, "%s: %s\n", argv[1], saga_status_text(s));
        return 1;
    }
    printf("%08lx\n", (unsigned long)saga_crc32c(
                          0, rgb, 3u * camera.width * (size_t)camera.height));
    return 0;
}
