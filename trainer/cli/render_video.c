/* SPDX-License-Identifier: MIT */
#include "render_video.h"

#include "ogg_opus.h"

#include <inttypes.h>
#include <stdio.h>

enum { MOST_ARGUMENTS = 64 };

/* A list of arguments under construction, which ends with NULL. */
typedef struct {
    const char *argv[MOST_ARGUMENTS];
    int n;
} arguments;

static void add(arguments *a, const char *const *more)
{
    while (*more && a->n < MOST_ARGUMENTS - 1)
        a->argv[a->n++] = *more++;
    a->argv[a->n] = NULL;
}

/* Arguments for ffmpeg that are formatted from a plan. */
typedef struct {
    char size[32], rate[32], seconds[32], shift[64], name[FILENAME_MAX],
         sound[FILENAME_MAX + 96];
} words;

/* Writes the filter that shifts the sound: it cuts its beginning off, or delays
 * it with silence. */
static void write_shift(char *to, size_t n, double start)
{
    if (start < 0.0)
        (void)snprintf(to, n, "atrim=start=%.6f,asetpts=PTS-STARTPTS", -start);
    else
        (void)snprintf(to, n, "adelay=%.0fS:all=1", SAGA_OPUS_RATE * start);
}

static void write_words(words *w, const saga_film_plan *plan, const char *out)
{
    const saga_film_sound *const sound = &plan->sound;

    (void)snprintf(w->size, sizeof w->size, "%dx%d", plan->width,
                   plan->height);
    (void)snprintf(w->rate, sizeof w->rate, "%.6f", plan->fps);
    (void)snprintf(w->seconds, sizeof w->seconds, "%.6f",
                   plan->n_pictures / plan->fps);
    /* "file:" keeps a name from being taken for an option or a URL. */
    (void)snprintf(w->name, sizeof w->name, "file:%s", out);
    (void)snprintf(w->sound, sizeof w->sound,
                   "subfile,,start,%" PRIu64 ",end,%" PRIu64 ",,:file:%s",
                   sound->offset, sound->offset + sound->nbytes,
                   sound->file ? sound->file : "");
    write_shift(w->shift, sizeof w->shift, sound->start);
}

bool saga_film_writer_open(saga_film_writer *w, const char *path,
                           const saga_film_plan *plan, saga_error *error)
{
    words say;
    /* Chroma of half size needs even sides, so pictures are padded. */
    static const char even_bt709[] = "scale=out_color_matrix=bt709:"
                                     "out_range=tv,"
                                     "pad=ceil(iw/2)*2:ceil(ih/2)*2";
    const char *const pictures[] = {
        "ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", say.size, "-r", say.rate, "-i", "-", NULL
    };
    const char *const sound[] = {
        "-f", "ogg", "-i", say.sound, "-af", say.shift, "-c:a", "aac", "-t",
        say.seconds, NULL
    };
    const char *const film[] = {
        "-vf", even_bt709,
        "-c:v", "libx264", "-crf", "16", "-preset", "medium", "-pix_fmt",
        "yuv420p", "-colorspace", "bt709", "-color_primaries", "bt709",
        "-color_trc", "bt709", "-color_range", "tv", "-movflags", "+faststart",
        "-f", "mp4", say.name, NULL
    };
    arguments all = { .n = 0 };

    if (!saga_output_open(&w->out, path, error))
        return false;
    write_words(&say, plan,
                w->out.temporary ? w->out.temporary : w->out.path);
    w->picture_nbytes = (size_t)3 * (size_t)plan->width *
                        (size_t)plan->height;
    add(&all, pictures);
    if (plan->sound.file)
        add(&all, sound);
    add(&all, film);
    if (saga_child_start_fed(&w->ffmpeg, all.argv, error))
        return true;
    saga_output_close(&w->out, false, error);
    return false;
}

/* Waits for ffmpeg and reports its error if it failed. */
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
