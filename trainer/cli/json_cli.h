/* SPDX-License-Identifier: MIT
 *
 * A command's report is a tree of JSON, built once. It is printed as JSON,
 * whole or not at all, or as text by a table of lines.
 *
 * A key that begins with '/' is an aside: lines may tell it, JSON does not.
 * Names of cameras are keys, too; a name has no '/' in front.
 */
#ifndef SAGA_JSON_CLI_H
#define SAGA_JSON_CLI_H

#include <jansson.h>
#include <stdbool.h>

/* --- The tree ------------------------------------------------------------ */

/* Reports have a schema's number: a key that is there keeps its meaning while
 * the number is the same; keys may be added. */
enum { SAGA_JSON_SCHEMA = 1 };

/* Begins to watch memory (json_memory.h), and returns an object with what every
 * report begins with: "schema", "program" (with its version), "command", and
 * the "file" it is about. */
json_t *saga_cli_json_head(const char *command, const char *file);

/* These put a value into an object; what cannot be put makes the report fail
 * when it is printed. A real that is not finite is null, and "inf" in text.
 * Text that is NULL is null; bytes that are no UTF-8 can be told as text
 * alone. */
void saga_put_int(json_t *object, const char *key, json_int_t value);
void saga_put_real(json_t *object, const char *key, double value);
void saga_put_flag(json_t *object, const char *key, bool value);
void saga_put_text(json_t *object, const char *key, const char *value);
void saga_put(json_t *object, const char *key, json_t *value);
void saga_put_item(json_t *list, json_t *value);

/* --- As text ------------------------------------------------------------- */

/* A piece of text, with its newlines. */
typedef struct saga_line {
    /* It is there if all of these are, with '&' between: PATH is neither
     * missing, null, false, 0 nor empty; !PATH is; PATH=N or PATH>N. NULL or
     * "": always. */
    const char *when;
    /* A list or an object, of whose items each has the piece once; paths then
     * begin in the item, those with '^' in front at the top. Pieces that follow
     * each other with the same `each` go through it together. NULL: once. */
    const char *each;
    /* {PATH} is a value; a PATH is keys with '.' between, and numbers of items.
     * {PATH:%8.3f} is printed so, or as a dash as wide where it is null;
     * {PATH*100:%5.1f} times that number. {PATH:%8.2f: %} has the last part
     * behind it, or blanks behind a dash. {PATH+s} is "s" unless the value is
     * 1. {#} is the item's number from 0 on, {@} its key. */
    const char *text;
} saga_line;

/* Prints n lines about a report on stdout. */
void saga_print_lines(const json_t *report, const saga_line *lines, int n);

/* --- As JSON ------------------------------------------------------------- */

/* Says before long work whether a report can have a file's or folder's name;
 * NULL: there is none. The exit status. */
int saga_cli_json_can_tell(const char *command, const char *name);

/* Takes the asides out of a report that becomes a part of another. */
void saga_drop_asides(json_t *report);

/* Prints o, without its asides, and frees it; where something of it could not
 * be told since saga_json_watch, that is an error. Reals have `precision`
 * digits. file is for messages: its name is in o. The exit status. */
int saga_cli_print_json(json_t *o, size_t precision, const char *file);

/* Does the same into the file. */
int saga_cli_write_json(json_t *o, size_t precision, const char *file);

/* --- Either -------------------------------------------------------------- */

typedef struct saga_telling {
    bool json;
    size_t precision;        /* of JSON */
    const char *file;        /* for messages */
} saga_telling;

/* A table of lines, and how many there are: two arguments. */
#define SAGA_LINES(table) table, (int)(sizeof table / sizeof table[0])

/* Prints a report as JSON, or as text by n lines, and frees it. The exit
 * status. */
int saga_cli_tell(json_t *report, const saga_telling *how,
                  const saga_line *lines, int n);

#endif
