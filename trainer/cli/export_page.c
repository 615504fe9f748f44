/* SPDX-License-Identifier: MIT */
#include "export_page.h"

#include "alloc.h"
#include "base64.h"
#include "file.h"
#include "json_cli.h"
#include "orbit.h"
#include "output.h"
#include "page_text.h"
#include "picture.h"
#include "utf8.h"
#include "view_files.h"

#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <webp/encode.h>

enum {
    POSTER_WIDTH = 640,
    POSTER_QUALITY = 80,
    /* Browsers have strings of less than 2^29 characters. As whole.js. */
    MOST_NBYTES = 1 << 28
};

/* The page's empty places begin after these texts, in this order. */
enum { TITLE, TAGS, CARRIED, POSTER, FILM, N_PLACES };
static const char *const places[N_PLACES] = {
    [TITLE] = "<title>",           [TAGS] = "</title>",
    [CARRIED] = "id=\"carried\">", [POSTER] = "id=\"poster\" alt=\"\" src=\"",
    [FILM] = "id=\"film\">",
};

/* A film and what is made of it. */
typedef struct page {
    saga_film *film;
    char name[3 * NAME_MAX + 1]; /* of the film, safe to show */
    saga_camera camera;          /* of the poster */
    uint8_t *rgb;                /* the poster; NULL: there is none */
    char *picture;               /* path of the poster for links, or NULL */
    char *texts[N_PLACES];
    saga_error *error;
} page;

/* --- Texts ---------------------------------------------------------------- */

static char *no_memory(const page *p)
{
    saga_no_memory(0, p->film->name, p->error);
    return NULL;
}

static char *title_of(const page *p)
{
    char *text = NULL;
    size_t n;
    FILE *const f = open_memstream(&text, &n);

    if (!f)
        return no_memory(p);
    saga_page_put(f, p->name);
    return fclose(f) == 0 ? text : (free(text), no_memory(p));
}

static void put_tag(FILE *f, const char *name, const char *text)
{
    fprintf(f, "\n<meta property=\"og:%s\" content=\"", name);
    saga_page_put(f, text);
    fputs("\">", f);
}

/* Writes the tags of the picture for links, which lies beside the page: its
 * address has to be a whole one. Returns false if memory is short. */
static bool put_picture_tags(FILE *f, const page *p, const char *address)
{
    const char *const host = strstr(address, "://") + 3;
    const char *const slash = strrchr(host, '/');
    const size_t n = slash ? (size_t)(slash - address) : strlen(address);
    char side[16];
    char *const at = saga_page_address(address, n, saga_path_base(p->picture),
                                       p->error);

    if (!at)
        return false;
    put_tag(f, "image", at);
    (void)snprintf(side, sizeof side, "%d", p->camera.width);
    put_tag(f, "image:width", side);
    (void)snprintf(side, sizeof side, "%d", p->camera.height);
    put_tag(f, "image:height", side);
    fputs("\n<meta name=\"twitter:card\" content=\"summary_large_image\">", f);
    free(at);
    return true;
}

/* Returns the tags of The Open Graph Protocol, ogp.me. */
static char *tags_of(const page *p, const char *address)
{
    const saga_info *const i = &p->film->info;
    const double seconds = (double)i->n_frames * i->fps_den / i->fps_num;
    char *text = NULL, about[80];
    size_t n;
    FILE *const f = open_memstream(&text, &n);
    bool ok;

    if (!f)
        return no_memory(p);
    /* Tenths are told of short films only. */
    (void)snprintf(about, sizeof about, "%.*f second%s of volumetric video",
                   seconds < 100 && seconds != rint(seconds), seconds,
                   seconds == 1 ? "" : "s");
    put_tag(f, "type", "website");
    put_tag(f, "title", p->name);
    put_tag(f, "description", about);
    put_tag(f, "url", address);
    ok = !p->picture || put_picture_tags(f, p, address);
    /* The stream's memory is there when it is closed. */
    ok = fclose(f) == 0 && ok;
    return ok ? text : (free(text), no_memory(p));
}

/* Returns what the page is told about the film, its name, as JSON. */
static char *carried_json(const page *p)
{
    json_t *const json = json_pack("{s:n, s:[], s:s}", "src", "pictures",
                                   "name", p->name);
    char *const text = json_dumps(json, JSON_COMPACT);

    json_decref(json);
    return text ? text : no_memory(p);
}

/* --- The poster ----------------------------------------------------------- */

/* Draws the first picture of the camera at which the page begins, if the film
 * has cameras. */
static bool draw_poster(page *p)
{
    saga_camera *const c = &p->camera;
    saga_volume volume;
    uint32_t number, start = 0;

    if (!p->film->info.n_cameras)
        return true;
    if (saga_find_volume(&volume, p->film->bytes, p->film->nbytes) == SAGA_OK)
        start = volume.start;
    if (!saga_film_rig(p->film, start, c, &number, p->error))
        return false;
    if (c->width > POSTER_WIDTH)
        saga_camera_resize(c, POSTER_WIDTH,
                           1 + (c->height - 1) * POSTER_WIDTH / c->width);
    p->rgb = saga_alloc((size_t)3 * c->width * c->height, 1, p->film->name,
                        p->error);
    return p->rgb && saga_film_draw(p->film, c, 0, 1, p->rgb, p->error);
}

/* Returns the poster as a data URL. */
static char *poster_url(const page *p)
{
    const saga_camera *const c = &p->camera;
    uint8_t *webp = NULL;
    size_t n;
    char *text;

    if (!p->rgb)
        return saga_string_copy("data:,", p->error);
    n = WebPEncodeRGB(p->rgb, c->width, c->height, 3 * c->width, POSTER_QUALITY,
                      &webp);
    text = n ? saga_base64("data:image/webp;base64,", webp, n, p->error)
             : no_memory(p);
    WebPFree(webp);
    return text;
}

/* --- The page ------------------------------------------------------------ */

/* Writes the page with a text at each place. */
static void put_page(FILE *f, const saga_view_file *file, char *const *texts)
{
    const char *at = (const char *)file->bytes;
    const char *const end = at + file->nbytes;

    for (int i = 0; i < N_PLACES; i++) {
        const char *const start = at;

        /* tools/whole.sh writes all places, which a test checks. */
        at = saga_view_text_find(at, places[i]) + strlen(places[i]);
        fwrite(start, 1, (size_t)(at - start), f);
        if (i == CARRIED)
            saga_cli_embed_json(f, texts[i]);
        else
            fputs(texts[i], f);
    }
    fwrite(at, 1, (size_t)(end - at), f);
}

/* Makes all texts. path: that of the page. */
static bool make_texts(page *p, const char *path, const char *address)
{
    char **const texts = p->texts;
    const char *const name = saga_path_base(p->film->name);

    saga_utf8_copy(p->name, sizeof p->name, name, strlen(name));
    if (!draw_poster(p))
        return false;
    if (address && p->rgb) {
        p->picture = saga_string_copy(path, p->error);
        if (!p->picture)
            return false;
        memcpy(strrchr(p->picture, '.'), ".png", sizeof ".png");
    }
    return (texts[TITLE] = title_of(p)) &&
           (texts[TAGS] = address ? tags_of(p, address)
                                  : saga_string_copy("", p->error)) &&
           (texts[CARRIED] = carried_json(p)) &&
           (texts[POSTER] = poster_url(p)) &&
           (texts[FILM] = saga_base64("", p->film->bytes, p->film->nbytes,
                                      p->error));
}

/* Writes the picture for links, and then the page, which appear whole or not at
 * all. */
static bool write_outputs(const page *p, const char *path,
                          const saga_view_file *file)
{
    saga_output out = { 0 };

    if ((p->picture && !saga_png_write(p->picture, p->camera.width,
                                       p->camera.height, p->rgb, p->error)) ||
        !saga_output_open(&out, path, p->error))
        return false;
    put_page(out.file, file, p->texts);
    return saga_output_close(&out, true, p->error);
}

bool saga_page_write(const char *path, const char *address, saga_film *film,
                     bool *unwritten, saga_error *error)
{
    const saga_view_file *const file = saga_view_file_find("whole.html");
    page p = { .film = film, .error = error };
    bool ok;

    *unwritten = false;
    if (!file)
        return saga_fail(error, path,
                         "install clang and lld, then `make` again",
                         "this program was built without the decoder for "
                         "browsers");
    if (film->nbytes > MOST_NBYTES)
        return saga_fail(
            error, film->name, "put it on a server (docs/embed.md)",
            "has %zu bytes; a page may hold %d", film->nbytes, MOST_NBYTES);
    ok = make_texts(&p, path, address);
    if (ok) {
        ok = write_outputs(&p, path, file);
        *unwritten = !ok;
    }
    for (int i = 0; i < N_PLACES; i++)
        free(p.texts[i]);
    free(p.picture);
    free(p.rgb);
    return ok;
}

bool saga_page_is_address(const char *address)
{
    const char *const host = strstr(address, "://");

    if (strncmp(address, "http://", 7) != 0 &&
        strncmp(address, "https://", 8) != 0)
        return false;
    for (const char *c = address; *c; c++)
        if (*c <= ' ' || *c > '~' || strchr("\"<>\\?#", *c))
            return false;
    return host[3] != '\0' && host[3] != '/';
}
