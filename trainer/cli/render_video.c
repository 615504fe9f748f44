/* SPDX-License-Identifier: MIT */
#include "render_video.h"

#include "ffmpeg.h"
#include "file.h"
#include "ogg_opus.h"

#include <stdio.h>

/* With -xerror a write that fails is an error also where the file ends, behind
 * which ffmpeg would otherwise report success. Chroma of half size needs even
 * sides, so pictures are padded. */
#define BEGIN "-y", "-xerror", "-vf"
#define BT709 "scale=out_color_matrix=bt709:out_range=tv"
#define EVEN ",pad=ceil(iw/2)*2:ceil(ih/2)*2"
#define TAGS                                                           \
    "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", \
        "bt709", "-color_range", "tv"

typedef struct {
    const char *ending;
    bool opacity;
    const char *sound; /* its codec; NULL: such a film is silent */
    const char *words[32];
} film_kind;

static const film_kind kinds[] = {
    /* Pictures for pages, that begin anew at their end. In a GIF each has 256
     * colours of its own, so that ffmpeg need not keep all of them. */
    { ".gif",
      false,
      NULL,
      { BEGIN,
        "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1",
        "-loop", "0", "-f", "gif", NULL } },
    { ".webp",
      false,
      NULL,
      { BEGIN, "null", "-c:v", "libwebp_anim", "-quality", "80", "-loop", "0",
        "-f", "webp", NULL } },
    { ".mp4",
      false,
      "aac",
      { BEGIN, BT709 EVEN, "-c:v", "libx264", "-crf", "16", "-preset", "medium",
        "-pix_fmt", "yuv420p", TAGS, "-movflags", "+faststart", "-f", "mp4",
        NULL } },
    { ".webm",
      true,
      "libopus",
      /* VP9 keeps opacity only without alternate references. */
      { BEGIN,
        BT709 EVEN ":color=black@0",
        "-c:v",
        "libvpx-vp9",
        "-crf",
        "16",
        "-b:v",
        "0",
        "-auto-alt-ref",
        "0",
        "-row-mt",
        "1",
        "-cpu-used",
        "4",
        "-pix_fmt",
        "yuva420p",
        TAGS,
        "-f",
        "webm",
        NULL } },
    { ".mov",
      true,
      "aac",
      { BEGIN, BT709, "-c:v", "prores_ks", "-profile:v", "4444", "-pix_fmt",
        "yuva444p10le", TAGS, "-f", "mov", NULL } }
};

/* Returns the kind of film that a name has, or NULL. */
static const film_kind *kind_of(const char *path, bool opacity)
{
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        if (kinds[i].opacity == opacity &&
            saga_has_suffix(path, kinds[i].ending))
            return &kinds[i];
    return NULL;
}

bool saga_film_has_name(const char *path, bool opacity)
{
    return kind_of(path, opacity) != NULL;
}

/* Words for ffmpeg that are formatted from a plan. */
typedef struct {
    char size[32], rate[32], seconds[32], shift[64], name[FILENAME_MAX];
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
    (void)snprintf(w->size, sizeof w->size, "%dx%d", plan->width, plan->height);
    (void)snprintf(w->rate, sizeof w->rate, "%.6f", plan->fps);
    (void)snprintf(w->seconds, sizeof w->seconds, "%.6f",
                   plan->n_pictures / plan->fps);
    /* "file:" keeps a name from being taken for an option or a URL. */
    (void)snprintf(w->name, sizeof w->name, "file:%s", out);
    write_shift(w->shift, sizeof w->shift, plan->sound.start);
}

bool saga_film_writer_open(saga_film_writer *w, const char *path,
                           const saga_film_plan *plan, saga_error *error)
{
    const film_kind *const kind = kind_of(path, plan->opacity);
    const bool has_sound = plan->sound.file && kind->sound;
    const saga_film_sound *const sound = has_sound ? &plan->sound
                                                   : &(saga_film_sound){ 0 };
    words say;
    const char *const pictures[] = {
        "-pix_fmt", plan->opacity ? "rgba" : "rgb24",
        "-s",       say.size,
        "-r",       say.rate,
        NULL
    };
    const char *const silent[] = { say.name, NULL };
    const char *const with_sound[] = { "-af",       say.shift, "-c:a",
                                       kind->sound, "-t",      say.seconds,
                                       say.name,    NULL };
    const saga_ffmpeg job = { "ffmpeg",
                              { { .format = "rawvideo", .words = pictures },
                                { .path = sound->file,
                                  .format = "ogg",
                                  .offset = sound->offset,
                                  .nbytes = sound->nbytes } },
                              kind->words,
                              has_sound ? with_sound : silent };

    /* ffmpeg writes under the temporary name; the film appears when it ends. */
    if (!saga_output_open(&w->out, path, error))
        return false;
    write_words(&say, plan, w->out.temporary ? w->out.temporary : w->out.path);
    w->picture_nbytes = (size_t)(plan->opacity ? 4 : 3) * (size_t)plan->width *
                        (size_t)plan->height;
    if (saga_ffmpeg_start(&w->ffmpeg, &job, error))
        return true;
    saga_output_close(&w->out, false, error);
    return false;
}

/* Waits for ffmpeg and reports its error if it failed, or if it said anything:
 * older ones end with status 0 after a write that failed. */
static bool end_child(saga_film_writer *w, bool kill_it, saga_error *error)
{
    return (saga_child_end(&w->ffmpeg, kill_it) == 0 && !w->ffmpeg.tail[0]) ||
           saga_fail(error, w->out.path,
                     "check the free space of the disk and "
                     "that ffmpeg has libx264, libvpx-vp9, libwebp_anim or "
                     "prores_ks",
                     "ffmpeg failed: %s", w->ffmpeg.tail);
}

bool saga_film_writer_add(saga_film_writer *w, const uint8_t *pixels,
                          saga_error *error)
{
    if (saga_child_write(&w->ffmpeg, pixels, w->picture_nbytes))
        return true;
    end_child(w, false, error);
    return saga_fail(error, w->out.path, "try another name",
                     "ffmpeg took no more pictures");
}

bool saga_film_writer_close(saga_film_writer *w, bool ok, saga_error *error)
{
    if (!w->out.path)
        return ok;
    ok = end_child(w, !ok, error) && ok;
    return saga_output_close(&w->out, ok, error);
}
