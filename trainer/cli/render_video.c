/* SPDX-License-Identifier: MIT */
#include "render_video.h"

#include <stdio.h>

bool saga_film_writer_open(saga_film_writer *w, const char *path, int width,
                           int height, double fps, saga_error *error)
{
    /* Chroma of half size wants even sides. */
    static const char even_bt709[] = "scale=out_color_matrix=bt709:"
                                     "out_range=tv,"
                                     "pad=ceil(iw/2)*2:ceil(ih/2)*2";
    char size[32], rate[32], name[FILENAME_MAX];
    const char *const argv[] = {
        "ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", size, "-r", rate, "-i", "-", "-vf",
        even_bt709,
        "-c:v", "libx264", "-crf", "16", "-preset", "medium", "-pix_fmt",
        "yuv420p", "-colorspace", "bt709", "-color_primaries", "bt709",
        "-color_trc", "bt709", "-color_range", "tv", "-movflags", "+faststart",
        "-f", "mp4", name, NULL
    };

    snprintf(size, sizeof size, "%dx%d", width, height);
    snprintf(rate, sizeof rate, "%.6f", fps);
    w->picture_nbytes = (size_t)3 * (size_t)width * (size_t)height;
    if (!saga_output_open(&w->out, path, error))
        return false;
    /* Without "file:", a name might look like an option or an address. */
    snprintf(name, sizeof name, "file:%s",
             w->out.temporary ? w->out.temporary : w->out.path);
    if (saga_child_start_fed(&w->ffmpeg, argv, error))
        return true;
    saga_output_close(&w->out, false, error);
    return false;
}

/* Waits for ffmpeg; passes on what it complains of. */
static bool end(saga_film_writer *w, bool kill_it, saga_error *error)
{
    return saga_child_end(&w->ffmpeg, kill_it) == 0 ||
           saga_fail(error, w->out.path, "check the free space of the disk and "
                     "that ffmpeg has libx264", "ffmpeg failed: %s",
                     w->ffmpeg.tail);
}

bool saga_film_writer_add(saga_film_writer *w, const uint8_t *rgb,
                          saga_error *error)
{
    if (saga_child_write(&w->ffmpeg, rgb, w->picture_nbytes))
        return true;
    end(w, false, error);
    return saga_fail(error, w->out.path, "try another name",
                     "ffmpeg took no more pictures");
}

bool saga_film_writer_close(saga_film_writer *w, bool ok, saga_error *error)
{
    if (!w->out.path)
        return ok;
    ok = end(w, !ok, error) && ok;
    return saga_output_close(&w->out, ok, error);
}
