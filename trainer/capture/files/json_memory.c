/* SPDX-License-Identifier: MIT */
#include "json_memory.h"

#include "alloc.h"
#include "file.h"

#include <stdlib.h>
#include <string.h>

/* jansson's allocator gets no context, so that these flags are thread-local. */
static _Thread_local bool starved, lost;

static void *allocate(size_t nbytes)
{
    void *const p = malloc(nbytes);
    starved |= !p;
    return p;
}

void saga_json_watch(void)
{
    starved = false;
    lost = false;
    json_set_alloc_funcs(allocate, free);
}

bool saga_json_starved(void)
{
    return starved;
}

bool saga_json_lost(void)
{
    return lost;
}

bool saga_json_set_value(json_t *object, const char *key, json_t *value)
{
    const bool ok = json_object_set_new_nocheck(object, key, value) == 0;

    lost |= !ok;
    return ok;
}

bool saga_json_append_item(json_t *array, json_t *value)
{
    const bool ok = json_array_append_new(array, value) == 0;

    lost |= !ok;
    return ok;
}

void saga_json_merge_object(json_t *object, json_t *other)
{
    lost |= json_object_update_new(object, other) != 0;
}

/* Copies a text with quotes around the words that stand for no number, which
 * JSON does not have, though many programs write them. Then the reader of each
 * value can say where a number is wanted, and the others do not matter. */
static bool quote_words(saga_bytes *to, const saga_bytes *from,
                        const char *path, saga_error *error)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyz"
                                  "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+-.#()_";
    const char *p = (const char *)from->data, *const end = p + from->nbytes;
    bool inside = false; /* a string */
    /* The shortest of these words has three characters and gets two more. */
    *to = (saga_bytes){ saga_alloc(from->nbytes * 2 + 1, 1, path, error), 0 };
    while (to->data && p < end) {
        const size_t word = inside ? 0 : strspn(p, letters);
        const bool quoted = saga_is_no_number(p, word);
        const bool escape = inside && *p == '\\' && p + 1 < end;
        const size_t n = word ? word : escape ? 2 : 1;
        inside ^= !word && *p == '"';
        to->data[to->nbytes] = '"';
        to->nbytes += quoted;
        memcpy(to->data + to->nbytes, p, n);
        to->nbytes += n;
        to->data[to->nbytes] = '"';
        to->nbytes += quoted;
        p += n;
    }
    return to->data != NULL;
}

static bool bad_json(const json_error_t *problem, const char *path,
                     saga_error *error)
{
    const bool nonfinite = strstr(problem->text, "real number overflow");
    return saga_fail(
        error, path, nonfinite ? "export the poses again" : "correct the file",
        "%s at line %d, column %d (%s)",
        nonfinite ? "holds a number that is not finite" : "is not valid JSON",
        problem->line, problem->column, problem->text);
}

json_t *saga_json_parse(const saga_bytes *text, const char *path,
                        saga_error *error)
{
    json_error_t problem;
    saga_json_watch();
    const size_t bom = saga_bom_nbytes(text->data, text->nbytes);
    json_t *root = json_loadb((const char *)text->data + bom,
                              text->nbytes - bom, 0, &problem);
    /* If an allocation failed, jansson's error about the text is
     * meaningless. */
    bool ok = root || saga_json_starved() || bad_json(&problem, path, error);
    if (saga_json_starved())
        ok = saga_no_memory(0, path, error);
    else if (ok && !json_is_object(root))
        ok = saga_fail(error, path, "correct the file",
                       "\"(root)\" at the "
                       "top is not an object");
    if (ok)
        return root;
    json_decref(root);
    return NULL;
}

json_t *saga_json_read(const char *path, saga_error *error)
{
    saga_bytes bytes, quoted = { 0 };
    json_t *root = NULL;
    if (saga_read_text(&bytes, path, error) &&
        quote_words(&quoted, &bytes, path, error))
        root = saga_json_parse(&quoted, path, error);
    saga_bytes_free(&bytes);
    saga_bytes_free(&quoted);
    return root;
}
