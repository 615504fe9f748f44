/* SPDX-License-Identifier: MIT */
#include "export_page.h"

#include "alloc.h"
#include "base64.h"
#include "file.h"
#include "json_cli.h"
#include "orbit.h"
#include "output.h"
#include "utf8.h"
#include "view_files.h"

#include <jansson.h>
#include <limits.h>
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
static const char *const places[] = { "id=\"carried\">",
                                      "id=\"poster\" alt=\"\" src=\"",
                                      "id=\"film\">" };
enum { N_PLACES = sizeof places / sizeof places[0] };

/* Returns what the page is told about the film, its name, as JSON. */
static char *carried_json(const saga_film *film, saga_error *error)
{
    const char *const name = saga_path_base(film->name);
    char shown[3 * NAME_MAX + 1];
    json_t *json;
    char *text;

    saga_utf8_copy(shown, sizeof shown, name, strlen(name));
    json = json_pack("{s:n, s:[], s:s}", "src", "pictures", "name", shown);
    text = json_dumps(json, JSON_COMPACT);
    json_decref(json);
    if (!text)
        saga_no_memory(0, film->name, error);
    return text;
}

/* Returns the first picture of the first camera as a data URL, or an empty
 * picture for a film without cameras. */
static char *poster_of(saga_film *film, saga_error *error)
{
    saga_camera c;
    uint32_t number;
    uint8_t *rgb, *webp = NULL;
    size_t n = 0;
    char *text = NULL;

    if (!film->info.n_cameras)
        return saga_string_copy("data:,", error);
    if (!saga_film_rig(film, 0, &c, &number, error))
        return NULL;
    if (c.width > POSTER_WIDTH)
        saga_camera_resize(&c, POSTER_WIDTH,
                           1 + (c.height - 1) * POSTER_WIDTH / c.width);
    rgb = saga_alloc((size_t)3 * c.width * c.height, 1, film->name, error);
    if (rgb && saga_film_draw(film, &c, 0, 1, rgb, error)) {
        n = WebPEncodeRGB(rgb, c.width, c.height, 3 * c.width, POSTER_QUALITY,
                          &webp);
        text = n ? saga_base64("data:image/webp;base64,", webp, n, error)
                 : (saga_no_memory(0, film->name, error), NULL);
    }
    WebPFree(webp);
    free(rgb);
    return text;
}

/* Writes the page with a text at each place. */
static void put_page(FILE *f, const saga_view_file *page, char *const *texts)
{
    const char *at = (const char *)page->bytes;
    const char *const end = at + page->nbytes;

    for (int i = 0; i < N_PLACES; i++) {
        const char *const start = at;

        /* tools/whole.sh writes all places, which a test checks. */
        at = saga_view_text_find(at, places[i]) + strlen(places[i]);
        fwrite(start, 1, (size_t)(at - start), f);
        saga_cli_embed_json(f, texts[i]); /* the others have no "<" */
    }
    fwrite(at, 1, (size_t)(end - at), f);
}

bool saga_page_write(const char *path, saga_film *film, bool *unwritten,
                     saga_error *error)
{
    const saga_view_file *const page = saga_view_file_find("whole.html");
    char *texts[N_PLACES] = { NULL };
    saga_output out = { 0 };
    bool ok;

    /* A file that cannot be a page is refused. Then the texts are made, and the
     * page, which appears whole or not at all. */
    *unwritten = false;
    if (!page)
        return saga_fail(error, path,
                         "install clang and lld, then `make` again",
                         "this program was built without the decoder for "
                         "browsers");
    if (film->nbytes > MOST_NBYTES)
        return saga_fail(
            error, film->name, "put it on a server (docs/embed.md)",
            "has %zu bytes; a page may hold %d", film->nbytes, MOST_NBYTES);
    ok = (texts[0] = carried_json(film, error)) &&
         (texts[1] = poster_of(film, error)) &&
         (texts[2] = saga_base64("", film->bytes, film->nbytes, error));
    if (ok) {
        *unwritten = !saga_output_open(&out, path, error);
        ok = !*unwritten;
    }
    if (ok) {
        put_page(out.file, page, texts);
        ok = saga_output_close(&out, true, error);
        *unwritten = !ok;
    }
    for (int i = 0; i < N_PLACES; i++)
        free(texts[i]);
    return ok;
}
