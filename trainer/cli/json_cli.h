/* SPDX-License-Identifier: MIT
 *
 * A command's report is a tree of JSON, which is built once. It is printed as
 * JSON, completely or not at all, or as text by a table of lines.
 *
 * A key that begins with '/' is an aside: it is for the text only and is left
 * out of JSON. Names of cameras are keys, too; they have no '/' in front.
 */
#ifndef SAGA_JSON_CLI_H
#define SAGA_JSON_CLI_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* --- The tree ------------------------------------------------------------ */

/* The version of a report's schema. A key keeps its meaning as long as the
 * number is the same; keys may be added. */
enum { SAGA_JSON_SCHEMA = 1 };

/* Begins to watch for lack of memory (json_memory.h), and returns an object
 * with the beginning of every report: "schema", "program" (with its version),
 * "command", and "file". */
json_t *saga_cli_json_head(const char *command, const char *file);

/* These add a value to an object; if that fails, the report fails when it is
 * printed. A real that is not finite becomes null, or "inf" in text. A NULL
 * text becomes null; bytes that are not UTF-8 can be printed as text only. */
void saga_put_int(json_t *object, const char *key, json_int_t value);
void saga_put_real(json_t *object, const char *key, double value);
void saga_put_flag(json_t *object, const char *key, bool value);
void saga_put_text(json_t *object, const char *key, const char *value);
void saga_put(json_t *object, const char *key, json_t *value);
void saga_put_item(json_t *list, json_t *value);

/* --- As text ------------------------------------------------------------- */

/* A piece of text, with its newlines. */
typedef struct saga_line {
    /* The condition for printing it: terms joined by '&', all of which must
     * hold. PATH: the value is neither missing, null, false, 0 nor empty;
     * !PATH: it is one of these; PATH=N, PATH>N: compares it. NULL or "":
     * always. */
    const char *when;
    /* Path of a list or an object, for each of whose items the piece is
     * printed. Paths then start at the item; those with '^' in front start at
     * the root. Consecutive pieces with the same `each` are printed together
     * for each item. NULL: print once. */
    const char *each;
    /* The text, with values in braces. {PATH} is a value, where PATH is keys
     * and numbers of items joined by '.'. {PATH:%8.3f} gives the format; null
     * is printed as a dash of that width. {PATH*100:%5.1f} is multiplied first.
     * {PATH:%8.2f: %} has a suffix, which becomes blanks after a dash. {PATH+s}
     * is "s" unless the value is 1. {#} is the item's number from 0 on, {@} its
     * key. */
    const char *text;
} saga_line;

/* Prints n lines about a report on stdout. */
void saga_print_lines(const json_t *report, const saga_line *lines, int n);

/* --- As JSON ------------------------------------------------------------- */

/* Checks before long work whether a report can contain the name of a file or
 * folder; name may be NULL. Returns the exit status. */
int saga_cli_json_can_name(const char *command, const char *name);

/* Removes the asides from a report that becomes part of another. */
void saga_drop_asides(json_t *report);

/* Prints o as JSON without its asides, and frees it. Fails if a value could not
 * be added since saga_json_watch. Reals have `precision` digits. `file` is the
 * name for messages. Returns the exit status. */
int saga_cli_print_json(json_t *o, size_t precision, const char *file);

/* Writes o to `file`, otherwise as saga_cli_print_json does. */
int saga_cli_write_json(json_t *o, size_t precision, const char *file);

/* Writes JSON into a script element of a page. "<" is escaped, because
 * "</script>" in a name would end the element. */
void saga_cli_embed_json(FILE *page, const char *json);

/* --- Either -------------------------------------------------------------- */

typedef struct saga_print_style {
    bool json;
    size_t precision; /* digits of reals in JSON */
    const char *file; /* name for messages */
} saga_print_style;

/* A table of lines and its length, as two arguments. */
#define SAGA_LINES(table) table, (int)(sizeof table / sizeof table[0])

/* Prints a report as JSON, or as text with n lines, and frees it. Returns the
 * exit status. */
int saga_cli_print_report(json_t *report, const saga_print_style *how,
                          const saga_line *lines, int n);

#endif
