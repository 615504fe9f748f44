/* SPDX-License-Identifier: MIT
 *
 * Writes the first picture of a .saga file, in its first camera, as PPM to
 * stdout. It shows everything that a program with the library needs; memory
 * comes from malloc.
 *
 *     cc first_picture.c $(pkg-config --cflags --libs saga) -o first_picture
 *     ./first_picture scene.saga >first.ppm
 */
#include <saga.h>

#include <stdio.h>
#include <stdlib.h>

enum { TILE = 16, LIST = 1 << 14 };

static int stop(const char *what, saga_status s)
{
    fprintf(stderr, "first_picture: %s: %s\n", what, saga_status_text(s));
    return 1;
}

/* Returns all bytes of a file, which the caller frees, or NULL. */
static uint8_t *read_file(const char *name, size_t *n)
{
    FILE *const f = fopen(name, "rb");
    uint8_t *bytes = NULL;
    long size;

    if (!f)
        return NULL;
    if (fseek(f, 0, SEEK_END) == 0 && (size = ftell(f)) > 0) {
        bytes = malloc((size_t)size);
        rewind(f);
        *n = bytes ? fread(bytes, 1, (size_t)size, f) : 0;
    }
    fclose(f);
    return bytes;
}

/* Draws the whole picture of a camera into rgb. */
static saga_status draw(const saga_decoder *dec, const saga_camera *c,
                        uint8_t *rgb, void *scratch)
{
    const size_t stride = 3u * c->width;
    saga_job job = { .x1 = c->width,
                     .y1 = c->height,
                     .tile = TILE,
                     .list_capacity = LIST,
                     .scratch = scratch,
                     .scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) };
    saga_picture picture = { rgb, stride, stride * c->height, 8 };
    saga_status s;

    do /* a player would look at its clock here */
        s = saga_draw(dec, &job, &picture, 1 << 20);
    while (s == SAGA_AGAIN);
    return s;
}

int main(int argc, char **argv)
{
    size_t n = 0;
    uint8_t *const bytes = argc == 2 ? read_file(argv[1], &n) : NULL;
    saga_decoder *dec;
    saga_segment seg;
    saga_camera camera;
    saga_info info;
    saga_status s;
    uint8_t *rgb;
    void *work, *scratch;
    uint32_t number;

    if (!bytes) {
        fputs("usage: first_picture FILE.saga >OUT.ppm\n", stderr);
        return 2;
    }
    s = saga_probe(&info, bytes, n);
    if (s)
        return stop(argv[1], s);
    work = malloc(info.work_nbytes); /* malloc aligns to SAGA_WORK_ALIGN */
    scratch = malloc(SAGA_JOB_NBYTES(TILE, LIST));
    if (!work || !scratch)
        return stop("memory", SAGA_ERR_SPACE);
    s = saga_open(&dec, work, info.work_nbytes, bytes, n, NULL);
    if (!s)
        s = saga_rig(&camera, &number, bytes, n, 0);
    if (!s)
        s = saga_find(&seg, bytes, n, 0, 1);
    if (!s && (seg.offset > n || seg.nbytes > n - seg.offset))
        s = SAGA_ERR_TRUNCATED;
    if (!s)
        s = saga_decode(dec, &seg, bytes + seg.offset, seg.nbytes, NULL);
    if (!s)
        s = saga_view(dec, &camera, seg.t);
    if (s)
        return stop(argv[1], s);
    rgb = malloc(3u * camera.width * (size_t)camera.height);
    if (!rgb)
        return stop("memory", SAGA_ERR_SPACE);
    s = draw(dec, &camera, rgb, scratch);
    if (s)
        return stop("drawing", s);
    printf("P6\n%u %u\n255\n", camera.width, camera.height);
    fwrite(rgb, 3u * camera.width, camera.height, stdout);
    free(rgb);
    free(scratch);
    free(work);
    free(bytes);
    return 0;
}
