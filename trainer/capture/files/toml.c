/* SPDX-License-Identifier: MIT */
#include "toml.h"

#include "file.h"
#include "json_memory.h"
#include "utf8.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    MOST_TEXT = 1024, /* limit for a key, a string or a number */
    MOST_DEPTH = 8    /* limit for nested lists or tables, because
                       * jansson frees nested values by recursion */
};

typedef struct toml_reader {
    const char *path;
    const uint8_t *next, *end;
    int line;
    json_t *root, *table;  /* the tree; the table to which keys are added */
    const char *key;       /* the key whose value is read */
    const uint8_t *header; /* the name of the table and what follows; NULL:
                            * the root */
    saga_error *error;
} toml_reader;

static bool bad(const toml_reader *r, const char *what)
{
    /* If memory ran out, a table may be missing from the tree. */
    if (saga_json_starved())
        return saga_no_memory(0, r->path, r->error);
    return saga_fail(r->error, r->path, "export the calibration again",
                     "line %d: %s", r->line, what);
}

/* Returns the next byte, or 0 at the end. A byte 0 in the file is an error in
 * any place. */
static int look(const toml_reader *r)
{
    return r->next < r->end ? *r->next : 0;
}

static bool take(toml_reader *r, int byte)
{
    if (r->next == r->end || look(r) != byte)
        return false;
    r->line += byte == '\n';
    r->next++;
    return true;
}

static void skip_blanks(toml_reader *r)
{
    while (take(r, ' ') || take(r, '\t'))
        ;
}

/* Skips blanks and a comment at the end of a line. */
static void skip_comment(toml_reader *r)
{
    skip_blanks(r);
    if (take(r, '#'))
        while (r->next < r->end && look(r) != '\n')
            r->next++;
    (void)take(r, '\r');
}

static void skip_lines(toml_reader *r)
{
    do
        skip_comment(r);
    while (take(r, '\n'));
}

/* --------------------------------------------------------------------- text */

static bool is_bare(int c)
{
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') ||
           (c >= 'A' && c <= 'Z') || c == '_' || c == '-';
}

/* Reads a string of one line, "basic" or 'literal'. */
static bool take_string(toml_reader *r, char text[MOST_TEXT])
{
    const int quote = look(r);
    size_t n = 0;
    (void)take(r, quote);
    while (look(r) != quote) {
        int c = look(r);
        if ((c < ' ' && c != '\t') || n + 1 == MOST_TEXT)
            return bad(r, "a string does not end, or is too long");
        r->next++;
        if (c == '\\' && quote == '"') {
            /* Names and paths need no other escapes. */
            c = look(r);
            if (c != '\\' && c != '"')
                return bad(r, "a string has an escape sequence other than "
                              "\\\\ and \\\"");
            r->next++;
        }
        text[n++] = (char)c;
    }
    text[n] = '\0';
    (void)take(r, quote);
    return saga_utf8_is(text) || bad(r, "a string is not valid UTF-8");
}

static bool take_key(toml_reader *r, char text[MOST_TEXT])
{
    size_t n = 0;
    if (look(r) == '"' || look(r) == '\'')
        return take_string(r, text);
    while (is_bare(look(r)) && n + 1 < MOST_TEXT)
        text[n++] = (char)*r->next++;
    text[n] = '\0';
    return n > 0 || bad(r, "a key is missing");
}

/* ------------------------------------------------------------------- values */

/* Reads true, false or a number, whose digits may have _ between them. */
static json_t *take_word(toml_reader *r)
{
    char text[MOST_TEXT];
    size_t n = 0;
    /* No number ends in a point, so that 1.#QNAN is no comment behind it. */
    while (n + 1 < MOST_TEXT &&
           (is_bare(look(r)) || look(r) == '+' || look(r) == '.' ||
            (look(r) == '#' && n > 0 && text[n - 1] == '.'))) {
        text[n] = (char)*r->next++;
        n += text[n] != '_';
    }
    text[n] = '\0';
    if (strcmp(text, "true") == 0 || strcmp(text, "false") == 0)
        return json_boolean(text[0] == 't');
    const char *word = text;
    double x;
    if (saga_take_number(&word, &x) && isfinite(x))
        return json_real(x);
    /* The table's name ends with its line at the latest. */
    const char *const table = (const char *)r->header;
    char what[320];
    (void)snprintf(what, sizeof what,
                   "a value is not a string, a finite "
                   "number, true, false or a list of these (\"%.40s\" for "
                   "%.60s%s%.*s)",
                   text, r->key, table ? " of " : "",
                   table ? (int)strcspn(table, "]\n") : 0, table ? table : "");
    bad(r, what);
    return NULL;
}

static json_t *take_scalar(toml_reader *r)
{
    char text[MOST_TEXT];
    if (look(r) != '"' && look(r) != '\'')
        return take_word(r);
    return take_string(r, text) ? json_string(text) : NULL;
}

/* Reads a list. `lists` holds the open lists, the outermost first. */
static json_t *take_list(toml_reader *r)
{
    json_t *lists[MOST_DEPTH];
    int depth = 0;
    bool ok = true, after = false; /* a value was read, so a comma must
                                    * follow */
    lists[0] = json_array();
    (void)take(r, '[');
    while (ok && depth >= 0) {
        skip_lines(r);
        if (take(r, ']')) {
            after = true;
            depth--;
        } else if (after) {
            ok = take(r, ',') || bad(r, "a list has no comma or no end");
            after = false;
        } else if (take(r, '[')) {
            ok = depth + 1 < MOST_DEPTH || bad(r, "lists are nested too "
                                                  "deeply");
            if (ok) {
                json_t *const inner = json_array();
                ok = saga_json_append_item(lists[depth], inner);
                lists[++depth] = inner;
            }
        } else {
            json_t *const value = take_scalar(r);
            ok = value != NULL;
            if (ok)
                saga_json_append_item(lists[depth], value);
            after = true;
        }
    }
    if (!ok)
        json_decref(lists[0]);
    return ok ? lists[0] : NULL;
}

/* -------------------------------------------------------------------- lines */

/* Goes to the table of a header "[a.b]", which is made if it does not exist. */
static bool take_header(toml_reader *r)
{
    char key[MOST_TEXT];
    r->table = r->root;
    r->header = r->next;
    if (look(r) == '[')
        return bad(r, "lists of tables are not supported");
    /* Each part of a name "a.b" goes one table deeper; the depth is limited,
     * since jansson frees by recursion. */
    for (int depth = 0; depth == 0 || take(r, '.'); depth++) {
        skip_blanks(r);
        if (depth == MOST_DEPTH)
            return bad(r, "tables are nested too deeply");
        if (!take_key(r, key))
            return false;
        skip_blanks(r);
        json_t *inner = json_object_get(r->table, key);
        if (!inner) {
            inner = json_object();
            if (!saga_json_set_value(r->table, key, inner))
                return false;
        }
        if (!json_is_object(inner))
            return bad(r, "a table has the name of a value");
        r->table = inner;
    }
    return take(r, ']') || bad(r, "a table's name does not end in ]");
}

static bool take_pair(toml_reader *r)
{
    char key[MOST_TEXT];
    if (!take_key(r, key))
        return false;
    skip_blanks(r);
    if (!take(r, '='))
        return bad(r, "there is no = after a key");
    skip_blanks(r);
    if (json_object_get(r->table, key))
        return bad(r, "a key occurs twice");
    r->key = key;
    json_t *const value = look(r) == '[' ? take_list(r) : take_scalar(r);
    if (value)
        saga_json_set_value(r->table, key, value);
    return value != NULL;
}

static bool take_all(toml_reader *r)
{
    for (skip_lines(r); r->next < r->end; skip_lines(r)) {
        if (!(take(r, '[') ? take_header(r) : take_pair(r)))
            return false;
        skip_comment(r);
        if (r->next < r->end && look(r) != '\n')
            return bad(r, "a line has something after its key and value");
    }
    return true;
}

json_t *saga_toml_read(const char *path, saga_error *error)
{
    saga_bytes bytes;
    if (!saga_read_text(&bytes, path, error))
        return NULL;
    toml_reader r = { .path = path,
                      .next = bytes.data,
                      .end = bytes.data + bytes.nbytes,
                      .line = 1,
                      .error = error };
    saga_json_watch();
    r.root = r.table = json_object();
    bool ok = take_all(&r);
    if (saga_json_starved() || saga_json_lost() || !r.root)
        ok = saga_no_memory(0, path, error);
    saga_bytes_free(&bytes);
    if (!ok)
        json_decref(r.root);
    return ok ? r.root : NULL;
}
