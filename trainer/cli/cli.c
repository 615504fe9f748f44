/* SPDX-License-Identifier: MIT */
#include "cli.h"

#include "clock.h"
#include "output.h"
#include "threads.h"
#include "utf8.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* --- Messages ------------------------------------------------------------ */

/* Room for the longest line: a note of a capture may have 4,096 bytes. */
enum { MOST_LINE = 8192 };

static void print(FILE *to, const char *begin, const char *format, va_list args)
{
    char text[MOST_LINE], shown[sizeof text];

    vsnprintf(text, sizeof text, format, args);
    saga_utf8_copy(shown, sizeof shown, text, strlen(text));
    fprintf(to, "%s%s\n", begin, shown);
}

void saga_cli_print(const char *format, ...)
{
    va_list args;

    va_start(args, format);
    print(stdout, "", format, args);
    va_end(args);
}

int saga_cli_error(int status, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    print(stderr, "saga: ", format, args);
    va_end(args);
    return status;
}

/* --- Signals ------------------------------------------------------------- */

void saga_cli_catch_signals(void (*handler)(int number))
{
    static const int numbers[] = { SIGINT, SIGTERM, SIGHUP };
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    sigemptyset(&action.sa_mask);
    /* A signal that is ignored, as under nohup, stays ignored. */
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        struct sigaction old;

        if (sigaction(numbers[i], NULL, &old) == 0 && old.sa_handler != SIG_IGN)
            sigaction(numbers[i], &action, NULL);
    }
}

void saga_cli_end(int number)
{
    sigset_t its;

    saga_output_abandon();
    /* The default action ends the program by the signal, which the shell then
     * sees. The signal is blocked while its handler runs, so it is unblocked
     * first. */
    signal(number, SIG_DFL);
    sigemptyset(&its);
    sigaddset(&its, number);
    sigprocmask(SIG_UNBLOCK, &its, NULL);
    raise(number);
}

/* --- Threads ------------------------------------------------------------- */

int saga_cli_threads(const char *command, int n)
{
    saga_error error = { "" };

#ifdef _OPENMP
    if (n > 0)
        omp_set_num_threads(n);
#endif
    if (saga_threads_reserve(n > 0 ? n : (int)saga_n_threads(), &error))
        return SAGA_EXIT_OK;
    return saga_cli_error(SAGA_EXIT_USAGE, "%s: %s", command, error.message);
}

/* --- Values -------------------------------------------------------------- */

bool saga_cli_flag(void *to, const char *text, const saga_cli_option *option)
{
    (void)text;
    (void)option;
    *(bool *)to = true;
    return true;
}

bool saga_cli_text(void *to, const char *text, const saga_cli_option *option)
{
    (void)option;
    *(const char **)to = text;
    return text[0] != '\0';
}

bool saga_cli_names(void *to, const char *text, const saga_cli_option *option)
{
    (void)option;
    *(const char **)to = text;
    return true;
}

/* Reads a decimal integer in the range of option o. *text moves past it. */
static bool take_int(int32_t *v, const char **text, const saga_cli_option *o)
{
    char *end;
    long x;

    /* strtol would also take blanks and a plus sign. */
    if ((**text < '0' || **text > '9') && **text != '-')
        return false;
    errno = 0;
    x = strtol(*text, &end, 10);
    if (end == *text || errno || x < o->min || x > o->max)
        return false;
    *text = end;
    *v = (int32_t)x;
    return true;
}

bool saga_cli_int(void *to, const char *text, const saga_cli_option *option)
{
    int32_t v;

    if (!take_int(&v, &text, option) || *text)
        return false;
    *(int *)to = v;
    return true;
}

bool saga_cli_real(void *to, const char *text, const saga_cli_option *option)
{
    char *end;
    const double v = strtod(text, &end);

    (void)option;
    if (end == text || *end || !isfinite(v) || text[0] == ' ')
        return false;
    *(double *)to = v;
    return true;
}

bool saga_cli_nbytes(void *to, const char *text, const saga_cli_option *option)
{
    char *end;
    double v = strtod(text, &end);

    (void)option;
    if (end == text || text[0] < '0' || text[0] > '9')
        return false;
    if (*end == 'k' || *end == 'M')
        v *= *end++ == 'k' ? 1e3 : 1e6;
    *(double *)to = rint(v);
    return !*end && v >= 1 && v <= 1e12;
}

bool saga_cli_scale(void *to, const char *text, const saga_cli_option *option)
{
    return saga_cli_int(to, strncmp(text, "1/", 2) ? text : text + 2, option);
}

bool saga_cli_size(void *to, const char *text, const saga_cli_option *option)
{
    saga_cli_pair *const p = to;

    return take_int(&p->a, &text, option) && *text++ == 'x' &&
           take_int(&p->b, &text, option) && !*text;
}

bool saga_cli_sides(void *to, const char *text, const saga_cli_option *option)
{
    saga_cli_pair *const p = to;

    p->b = 0;
    return strchr(text, 'x') ? saga_cli_size(to, text, option)
                             : saga_cli_int(&p->a, text, option);
}

bool saga_cli_colour(void *to, const char *text, const saga_cli_option *option)
{
    static const char digits[] = "0123456789abcdefABCDEF";
    const char *const hex = text[0] == '#' ? text + 1 : text;
    saga_cli_rgb *const c = to;

    (void)option;
    c->given = strlen(hex) == 6 && strspn(hex, digits) == 6;
    for (int i = 0; c->given && i < 3; i++)
        c->rgb[i] = (uint8_t)strtol((char[]){ hex[2 * i], hex[2 * i + 1], 0 },
                                    NULL, 16);
    return c->given;
}

bool saga_cli_range(void *to, const char *text, const saga_cli_option *option)
{
    saga_cli_pair *const p = to;

    if (*text != ':' && !take_int(&p->a, &text, option))
        return false;
    if (*text++ != ':')
        return false;
    if (!*text)
        return true;
    return take_int(&p->b, &text, option) && !*text && p->a < p->b;
}

bool saga_cli_fraction(void *to, const char *text,
                       const saga_cli_option *option)
{
    saga_cli_pair *const p = to;

    p->b = 1;
    if (!take_int(&p->a, &text, option))
        return false;
    if (!*text)
        return true;
    return *text++ == '/' && take_int(&p->b, &text, option) && !*text &&
           p->b >= 1;
}

/* --- Nearest name -------------------------------------------------------- */

enum { LONGEST_NAME = 32 };

static int min3(int a, int b, int c)
{
    const int ab = a < b ? a : b;

    return ab < c ? ab : c;
}

/* Returns the number of letters to insert, remove or change to turn a into b,
 * or LONGEST_NAME if one of them is too long. */
static int distance(const char *a, const char *b)
{
    const int na = (int)strlen(a), nb = (int)strlen(b);
    int row[LONGEST_NAME + 1];

    if (na > LONGEST_NAME || nb > LONGEST_NAME)
        return LONGEST_NAME;
    for (int j = 0; j <= nb; j++)
        row[j] = j;
    /* Levenshtein's algorithm. row[j] is the distance between the first i
     * letters of a and the first j letters of b; `corner` is the previous row's
     * value at j - 1. */
    for (int i = 1; i <= na; i++) {
        int corner = row[0];

        row[0] = i;
        for (int j = 1; j <= nb; j++) {
            const int changed = corner + (a[i - 1] != b[j - 1]);

            corner = row[j];
            row[j] = min3(row[j] + 1, row[j - 1] + 1, changed);
        }
    }
    return row[nb];
}

/* Accepts a known name if fewer than half of its letters are wrong, or if
 * `name` is its beginning. */
static bool could_mean(const char *name, const char *known, int d)
{
    const size_t n = strlen(name);

    return (n >= 2 && !strncmp(name, known, n)) || 2 * d < (int)strlen(known);
}

const char *saga_cli_nearest(const char *name, const void *names, size_t n,
                             size_t stride)
{
    const char *best = NULL;
    int least = LONGEST_NAME;

    for (size_t i = 0; i < n; i++) {
        const char *known;
        int d;

        memcpy(&known, (const char *)names + i * stride, sizeof known);
        d = distance(name, known);
        if (d < least && could_mean(name, known, d)) {
            least = d;
            best = known;
        }
    }
    return best;
}

/* --- Command line -------------------------------------------------------- */

static const saga_cli_option *find_option(const saga_command *c,
                                          const char *name, size_t n)
{
    for (int i = 0; i < c->n_options; i++)
        if (strlen(c->options[i].name) == n &&
            !strncmp(c->options[i].name, name, n))
            return &c->options[i];
    return NULL;
}

static int unknown_option(const saga_command *c, const char *name)
{
    const char *const near = saga_cli_nearest(
        name, &c->options[0].name, (size_t)c->n_options, sizeof c->options[0]);

    return saga_cli_error(SAGA_EXIT_USAGE,
                          "%s: unknown option '%s'%s%s%s; "
                          "`saga help %s --all` lists them",
                          c->name, name, near ? ", did you mean '" : "",
                          near ? near : "", near ? "'" : "", c->name);
}

static int wrong_value(const saga_command *c, const saga_cli_option *o,
                       const char *value)
{
    char range[64] = "";

    if (o->max > o->min)
        snprintf(range, sizeof range, ", %ld to %ld", o->min, o->max);
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "%s: %s takes %s%s, not '%s'; see "
                          "`saga help %s --all`",
                          c->name, o->name, o->value, range, value, c->name);
}

/* Reads the option at argv[*i] and its value; *i moves to the value if it is an
 * argument of its own. */
static int take_option(const saga_command *c, void *values, int argc,
                       char **argv, int *i)
{
    const char *const name = argv[*i];
    const char *const equals = strchr(name, '=');
    const size_t n = equals ? (size_t)(equals - name) : strlen(name);
    const saga_cli_option *const o = find_option(c, name, n);
    const char *value = equals ? equals + 1 : NULL, *before;

    /* The option must exist, and have a value exactly if it takes one. */
    if (!o)
        return unknown_option(c, name);
    if (!o->value && equals)
        return saga_cli_error(SAGA_EXIT_USAGE, "%s: %s takes no value", c->name,
                              o->name);
    if (o->value && !value) {
        if (*i + 1 == argc)
            return saga_cli_error(SAGA_EXIT_USAGE, "%s: %s needs a value, %s",
                                  c->name, o->name, o->value);
        value = argv[++*i];
    }
    /* Of two outputs only one would be written. Other options count as they
     * are given last, so that scripts may append to their own. */
    if (!strcmp(o->name, "-o")) {
        memcpy(&before, (const char *)values + o->offset, sizeof before);
        if (before)
            return saga_cli_error(SAGA_EXIT_USAGE,
                                  "%s: -o is given twice, %s "
                                  "and %s",
                                  c->name, before, value);
    }
    if (!o->read((char *)values + o->offset, value, o))
        return wrong_value(c, o, value);
    return SAGA_CLI_GO_ON;
}

static int wrong_count(const saga_command *c, int n)
{
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "%s: %s; usage: saga %s %s "
                          "[options]",
                          c->name,
                          n > c->n_arguments ? "there are too many arguments"
                                             : "an argument is missing",
                          c->name, c->arguments);
}

int saga_cli_parse(const saga_command *c, void *values, const char **arguments,
                   int argc, char **argv)
{
    const int most = strstr(c->arguments, "...") ? SAGA_CLI_MOST_ARGUMENTS
                                                 : c->n_arguments;
    /* Surplus arguments are counted too, because wrong_count() reports them. */
    int n = 0;
    bool options = true;

    for (int i = 1; i < argc; i++) {
        int status = SAGA_CLI_GO_ON;

        if (options && (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h"))) {
            saga_cli_help(c, i + 1 < argc && !strcmp(argv[i + 1], "--all"));
            return SAGA_EXIT_OK;
        }
        if (options && !strcmp(argv[i], "--"))
            options = false;
        else if (options && argv[i][0] == '-' && argv[i][1])
            status = take_option(c, values, argc, argv, &i);
        else if (n++ < most)
            arguments[n - 1] = argv[i];
        if (status != SAGA_CLI_GO_ON)
            return status;
    }
    return n >= c->n_arguments && n <= most ? SAGA_CLI_GO_ON
                                            : wrong_count(c, n);
}

/* --- Help ---------------------------------------------------------------- */

enum { HELP_COLUMN = 22, HELP_WIDTH = 79 };

static void option_help(const saga_cli_option *o)
{
    const char *line = o->help;
    int column = printf("  %s%s%s", o->name, o->value ? " " : "",
                        o->value ? o->value : "");

    /* A name too long for its column has a line of its own. */
    if (column >= HELP_COLUMN) {
        putchar('\n');
        column = 0;
    }
    for (;;) {
        const int n = (int)strcspn(line, "\n");

        printf("%*s%.*s\n", HELP_COLUMN - column, "", n, line);
        if (!line[n])
            return;
        line += n + 1;
        column = 0;
    }
}

void saga_cli_row(const char *name, const char *meaning)
{
    int column = printf("  %-*s", HELP_COLUMN - 2, name);

    for (const char *word = meaning; *word;) {
        const int n = (int)strcspn(word, " ");

        if (column + 1 + n > HELP_WIDTH)
            column = printf("\n%*s", HELP_COLUMN, "") - 1;
        column += printf("%s%.*s", column > HELP_COLUMN ? " " : "", n, word);
        word += n + (word[n] == ' ');
    }
    putchar('\n');
}

void saga_cli_help(const saga_command *c, bool all)
{
    printf("usage: saga %s %s%s\n\n%s", c->name, c->arguments,
           c->n_options ? " [options]" : "", c->text);
    if (c->print_list)
        c->print_list();
    if (c->n_options)
        putchar('\n');
    for (int i = 0; i < c->n_options; i++) {
        if (c->options[i].read)
            option_help(&c->options[i]);
        else if (!all) {
            printf("\n`saga help %s --all` lists %d more.\n", c->name,
                   c->n_options - 1 - i);
            return;
        }
    }
}

/* --- Progress ------------------------------------------------------------ */

/* Writes "3 s", "12 min" or "4.0 h", about as precise as the estimate is. */
static void time_text(char *text, size_t n, double seconds)
{
    if (seconds < 90.0)
        snprintf(text, n, "%.0f s", seconds);
    else if (seconds < 5400.0)
        snprintf(text, n, "%.0f min", seconds / 60.0);
    else
        snprintf(text, n, "%.1f h", seconds / 3600.0);
}

void saga_meter_show(saga_meter *m, double done, const char *doing)
{
    const double now = saga_clock_seconds();
    char left[32];
    int n;

    if (m->quiet)
        return;
    if (!m->started) {
        /* A terminal gets the first line at once, as if the last one was a
         * minute ago. */
        *m = (saga_meter){ .started = true,
                           .start = now,
                           .shown = now - 60.0,
                           .from = done,
                           .terminal = isatty(STDERR_FILENO) };
        if (!m->terminal) /* a short run needs no line in a log */
            m->shown = now;
    }
    if (now - m->shown < (m->terminal ? 0.1 : 5.0))
        return;
    m->shown = now;
    snprintf(left, sizeof left, "time left unknown");
    /* The speed is measured from the start of this run, since the part before a
     * resumed run's start took no time. */
    if (done > m->from)
        time_text(left, sizeof left,
                  (now - m->start) * (1.0 - done) / (done - m->from));
    n = fprintf(stderr, "%s%3.0f %%  %s  %s%s", m->terminal ? "\r" : "",
                100.0 * done, doing, left, done > m->from ? " left" : "");
    /* On a terminal, blanks cover the rest of a longer line. */
    if (!m->terminal)
        fputc('\n', stderr);
    else if (n < m->width)
        fprintf(stderr, "%*s", m->width - n, "");
    m->width = n;
}

bool saga_meter_progress(void *user, double done, const char *doing)
{
    saga_meter_show(user, done, doing);
    return true;
}

void saga_meter_end(saga_meter *m)
{
    if (m->started && m->terminal && m->width)
        fprintf(stderr, "\r%*s\r", m->width, "");
    m->width = 0;
}
