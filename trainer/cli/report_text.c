/* SPDX-License-Identifier: MIT
 *
 * Prints a report as text by a table of lines, whose syntax json_cli.h
 * explains.
 */
#include "json_cli.h"

#include "utf8.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Longest path, conversion or unit. */
enum { LONGEST = 96 };

/* The item of a list or an object for which a line is printed. */
typedef struct {
    const json_t *top, *item;
    size_t number;
    const char *key;
} place;

/* --- Values -------------------------------------------------------------- */

/* Returns a member of an object or an item of a list, or NULL if there is
 * none. */
static const json_t *member(const json_t *of, const char *name)
{
    return json_is_array(of) ? json_array_get(of, (size_t)atoi(name))
                             : json_object_get(of, name);
}

/* Follows a path of n characters. Sets *parent and key for its last step. */
static const json_t *follow(const json_t **parent, char key[LONGEST],
                            const place *at, const char *path, size_t n)
{
    const json_t *value = at->item;
    const char *const end = path + n;

    if (path < end && *path == '^') {
        value = at->top;
        path++;
    }
    while (path < end) {
        size_t step = strcspn(path, ".");

        step = step < (size_t)(end - path) ? step : (size_t)(end - path);
        snprintf(key, LONGEST, "%.*s", (int)step, path);
        *parent = value;
        value = member(value, key);
        path += step + (path + step < end);
    }
    return value;
}

static bool is_there(const json_t *v)
{
    if (json_is_number(v))
        return json_number_value(v) != 0.0;
    if (json_is_string(v))
        return json_string_value(v)[0] != '\0';
    return json_is_true(v) || json_array_size(v) > 0 || json_object_size(v) > 0;
}

/* --- Conditions ---------------------------------------------------------- */

static bool holds(const char *condition, size_t n, const place *at)
{
    const bool negated = condition[0] == '!';
    const char *const path = condition + negated;
    const size_t n_path = strcspn(path, "=>&");
    const json_t *parent;
    char key[LONGEST];
    const json_t *const v = follow(&parent, key, at, path, n_path);
    double wanted;

    if (n_path + negated >= n)
        return is_there(v) != negated;
    wanted = atof(path + n_path + 1);
    return negated !=
           (path[n_path] == '>'
                ? json_number_value(v) > wanted
                : json_is_number(v) && json_number_value(v) == wanted);
}

static bool all_hold(const char *conditions, const place *at)
{
    while (conditions && *conditions) {
        const size_t n = strcspn(conditions, "&");

        if (!holds(conditions, n, at))
            return false;
        conditions += n + (conditions[n] == '&');
    }
    return true;
}

/* --- Lines --------------------------------------------------------------- */

/* A field in braces: PATH*FACTOR:CONVERSION:UNIT. */
typedef struct {
    size_t n_path;
    double factor;
    char format[LONGEST], unit[LONGEST];
} field;

static field parse(const char *text, size_t n)
{
    field f = { strcspn(text, "*+:}"), 1.0, "", "" };
    const char *p = text + f.n_path, *const end = text + n;

    if (*p == '*')
        f.factor = atof(p + 1);
    p += strcspn(p, ":}");
    if (p < end) {
        const size_t n_format = strcspn(p + 1, ":}");

        snprintf(f.format, sizeof f.format, "%.*s", (int)n_format, p + 1);
        p += 1 + n_format;
    }
    if (p < end)
        snprintf(f.unit, sizeof f.unit, "%.*s", (int)(end - p - 1), p + 1);
    return f;
}

/* Longest string of a report that is printed whole. */
enum { LONGEST_STRING = 4096 };

/* Prints a string of the report, in which all that is foreign is made visible.
 */
static void print_string(const char *format, const char *s)
{
    char shown[LONGEST_STRING];

    saga_utf8_copy(shown, sizeof shown, s, strlen(s));
    printf(format[0] ? format : "%s", shown);
}

/* Prints a text with the width that a format gives a number. */
static void print_aligned(const char *text, const char *format)
{
    const char *const width = format + strcspn(format, "-.0123456789");

    printf("%*s", atoi(width), text);
}

static void print_integer(json_int_t v, const char *format)
{
    const size_t n = strlen(format);
    char longer[LONGEST + 2];

    /* jansson's integers are long long, so %7d becomes %7lld. */
    snprintf(longer, sizeof longer, "%.*sll%s", (int)(n ? n - 1 : 0), format,
             n ? format + n - 1 : "d");
    printf(n ? longer : "%lld", v);
}

static void print_value(const json_t *v, const json_t *parent, const char *key,
                        const field *f)
{
    const size_t n = strlen(f->format);
    const char last = n ? f->format[n - 1] : '\0';
    char aside[LONGEST + 1];
    const char *text;

    if (json_is_string(v)) {
        print_string(f->format, json_string_value(v));
    } else if (json_is_number(v) && last && last != 'd') {
        printf(f->format, f->factor * json_number_value(v));
    } else if (json_is_integer(v)) {
        print_integer(json_integer_value(v), f->format);
    } else if (json_is_number(v)) {
        printf("%g", f->factor * json_number_value(v));
    } else {
        /* JSON has no infinity. If the value is infinite, the aside "/KEY" has
         * its text. */
        snprintf(aside, sizeof aside, "/%s", key);
        text = json_string_value(member(parent, aside));
        print_aligned(text ? text : "-", f->format);
        printf("%*s", (int)strlen(f->unit), text ? f->unit : "");
        return;
    }
    fputs(f->unit, stdout);
}

static void print_field(const char *text, size_t n, const place *at)
{
    const field f = parse(text, n);
    const json_t *parent = NULL, *v;
    char key[LONGEST] = "";

    if (text[0] == '#') {
        print_integer((json_int_t)at->number, f.format);
        return;
    }
    if (text[0] == '@') {
        print_string(f.format, at->key);
        return;
    }
    v = follow(&parent, key, at, text, f.n_path);
    if (text[f.n_path] != '+')
        print_value(v, parent, key, &f);
    else if (json_number_value(v) != 1.0)
        printf("%.*s", (int)(n - f.n_path - 1), text + f.n_path + 1);
}

static void print_piece(const saga_line *line, const place *at)
{
    if (!all_hold(line->when, at))
        return;
    for (const char *p = line->text; *p;) {
        const size_t n = strcspn(p, "{");

        fwrite(p, 1, n, stdout);
        p += n;
        if (*p) {
            const size_t inside = strcspn(p, "}") - 1;

            print_field(p + 1, inside, at);
            p += inside + 2;
        }
    }
}

static void print_pieces(const saga_line *lines, int n, const place *at)
{
    for (int i = 0; i < n; i++)
        print_piece(&lines[i], at);
}

/* Prints n pieces for each item of the list or object that they name. */
static void print_each(const saga_line *lines, int n, place at)
{
    const json_t *parent;
    char key[LONGEST];
    const json_t *const of = follow(&parent, key, &at, lines->each,
                                    strlen(lines->each));
    json_t *value;
    const char *name;
    size_t i;

    at.number = 0;
    json_array_foreach(of, i, value)
    {
        at.item = value;
        at.number = i;
        print_pieces(lines, n, &at);
    }
    /* jansson iterates over objects through non-const pointers only. */
    json_object_foreach((json_t *)of, name, value)
    {
        at.item = value;
        at.key = name;
        print_pieces(lines, n, &at);
        at.number++;
    }
}

/* Returns the number of pieces, from the first, that are about the same
 * items. */
static int together(const saga_line *lines, int n)
{
    int i = 1;

    while (i < n && lines->each && lines[i].each &&
           !strcmp(lines->each, lines[i].each))
        i++;
    return i;
}

void saga_print_lines(const json_t *report, const saga_line *lines, int n)
{
    const place at = { report, report, 0, "" };

    for (int i = 0, k; i < n; i += k) {
        k = together(lines + i, n - i);
        if (lines[i].each)
            print_each(lines + i, k, at);
        else
            print_pieces(lines + i, k, &at);
    }
}
