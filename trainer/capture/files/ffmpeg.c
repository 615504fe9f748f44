/* SPDX-License-Identifier: MIT */
#include "ffmpeg.h"

#include "alloc.h"
#include "error.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_WORDS = 80 };

/* An argument list under construction; it ends with NULL. */
typedef struct arguments {
    const char *argv[MOST_WORDS];
    char *urls[2];
    int n;
} arguments;

static void add(arguments *a, const char *const *words)
{
    while (words && *words && a->n < MOST_WORDS - 1)
        a->argv[a->n++] = *words++;
    a->argv[a->n] = NULL;
}

/* Returns an input as ffmpeg takes it. Without "file:", a path that begins with
 * '-' or looks like a protocol would not be taken as a path. */
static char *make_url(const saga_ffmpeg_input *input, saga_error *error)
{
    const char *const path = input->path ? input->path : "pipe:0";
    const size_t n = strlen(path) + 80;
    char *const url = saga_alloc(n, 1, path, error);
    if (url && input->nbytes)
        (void)snprintf(url, n,
                       "subfile,,start,%" PRIu64 ",end,%" PRIu64 ",,:file:%s",
                       input->offset, input->offset + input->nbytes, path);
    else if (url)
        (void)snprintf(url, n, "%s%s", input->path ? "file:" : "", path);
    return url;
}

static bool add_input(arguments *a, const saga_ffmpeg_input *input, int i,
                      saga_error *error)
{
    /* The names are those of ffmpeg's demuxers. A decoder refuses a picture
     * with more than SAGA_MAX_SIDE on both sides before it allocates. */
    static const char containers[] =
        "mov,matroska,avi,mpegts,mpeg,ogg,flv,ivf,obu,h264,hevc,m4v,mpegvideo,"
        "mxf,asf,wav,w64,aiff,caf,au,mp3,flac,aac,ac3,eac3,amr,wv";
    const char *const format = input->format;
    const char *const guard[] = { "-protocol_whitelist",
                                  "file,pipe,subfile",
                                  "-format_whitelist",
                                  format ? format : containers,
                                  "-max_pixels",
                                  "268435456",
                                  format ? "-f" : NULL,
                                  format,
                                  NULL };
    a->urls[i] = make_url(input, error);
    const char *const from[] = { "-i", a->urls[i], NULL };
    add(a, guard);
    add(a, input->words);
    add(a, from);
    return a->urls[i] != NULL;
}

bool saga_ffmpeg_start(saga_child *child, const saga_ffmpeg *job,
                       saga_error *error)
{
    const char *const begin[] = { job->program, "-v", "error", NULL };
    arguments a = { .n = 0 };
    add(&a, begin);
    bool ok = add_input(&a, &job->inputs[0], 0, error) &&
              (!job->inputs[1].path ||
               add_input(&a, &job->inputs[1], 1, error));
    add(&a, job->words);
    add(&a, job->last);
    if (ok)
        ok = (job->inputs[0].path ? saga_child_start
                                  : saga_child_start_fed)(child, a.argv, error);
    free(a.urls[0]);
    free(a.urls[1]);
    return ok;
}

/* Finds the name in "[NAME @ 0x...] Format not on whitelist". Returns its
 * length, 0 if the child did not complain of a format. */
static int refused_format(const saga_child *child, const char **name)
{
    const char *const said = strstr(child->said, "] Format not on whitelist");
    const char *begin = said;
    while (begin && begin > child->said && *begin != '[')
        begin--;
    *name = begin ? begin + 1 : "";
    return begin ? (int)strcspn(*name, " \n") : 0;
}

bool saga_ffmpeg_refuse(const saga_child *child, const char *path,
                        const char *remedy, const char *what, saga_error *error)
{
    const char *name;
    const int n = refused_format(child, &name);
    if (n > 0)
        return saga_fail(error, path, "give the media file itself",
                         "is in "
                         "ffmpeg's format \"%.*s\", which can name other "
                         "files, so that it is not read",
                         n, name);
    return saga_fail(error, path, remedy, "%s (%s)", what, child->tail);
}
