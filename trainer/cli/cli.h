/* SPDX-License-Identifier: MIT
 *
 * The subcommands of `saga` share this: their description, the command line,
 * messages, progress.
 *
 * Messages go to stderr, as one sentence each: the file or the option, the
 * value that is wrong, and what to do about it. Results go to stdout.
 */
#ifndef SAGA_CLI_H
#define SAGA_CLI_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __GNUC__
#define SAGA_CLI_PRINTF(f, a) __attribute__((format(printf, f, a)))
#else
#define SAGA_CLI_PRINTF(f, a)
#endif

/* Every subcommand has these exit statuses. */
enum {
    SAGA_EXIT_OK = 0,
    SAGA_EXIT_DATA = 1,     /* what a file holds is refused */
    SAGA_EXIT_USAGE = 2,    /* the command line, or reading or writing */
    SAGA_CLI_GO_ON = -1     /* of saga_cli_parse: nothing to exit for */
};

/* --- Commands and options ------------------------------------------------ */

typedef struct saga_cli_option saga_cli_option;

/* Reads a whole text into the value at `to`; false if it is not one. */
typedef bool saga_cli_read_fn(void *to, const char *text,
                              const saga_cli_option *option);

struct saga_cli_option {
    const char *name;       /* "--json", "-o" */
    const char *value;      /* the value's name in the help; NULL: a flag */
    const char *help;       /* lines, separated by \n */
    saga_cli_read_fn *read; /* a flag's is saga_cli_flag */
    size_t offset;          /* of its value in the command's structure */
    long min, max;          /* of saga_cli_int */
};

/* The most arguments of a command whose last one may be repeated. */
enum { SAGA_CLI_MOST_ARGUMENTS = 1024 };

typedef struct saga_command {
    const char *name;
    const char *arguments;  /* "FILE CAPTURE", for the usage line; "..." at
                             * the end: the last may be repeated */
    int n_arguments;        /* number that must be given */
    const char *summary;    /* one line, for the table */
    const char *text;       /* what it does; lines */
    const saga_cli_option *options;
    int n_options;
    int (*run)(int argc, char **argv); /* argv[0] is the command's name */
    void (*print_list)(void); /* prints a list behind the text; NULL: none */
} saga_command;

/* These read values; behind each is what lies at the option's offset. */
saga_cli_read_fn saga_cli_flag;  /* bool; text is NULL */
saga_cli_read_fn saga_cli_text;  /* const char *; not empty */
saga_cli_read_fn saga_cli_names; /* const char *; empty for none */
saga_cli_read_fn saga_cli_int;   /* int, min..max */
saga_cli_read_fn saga_cli_real;  /* double, finite */
saga_cli_read_fn saga_cli_nbytes; /* double; "150k" is 150,000, "1.2M"
                                   * 1,200,000 */
saga_cli_read_fn saga_cli_scale; /* int N of "1/N" or "N", min..max */
saga_cli_read_fn saga_cli_size;  /* saga_cli_pair of "WxH", each min..max */
saga_cli_read_fn saga_cli_range; /* saga_cli_pair of "A:B", A < B, min..max; an
                                  * end left out stays as it was */
saga_cli_read_fn saga_cli_fraction; /* saga_cli_pair of "N" or "N/D", N within
                                     * min..max, D >= 1 */

typedef struct saga_cli_pair {
    int32_t a, b;
} saga_cli_pair;

/* Reads the options into the structure at `values`, which holds the defaults,
 * and the arguments into arguments[], in which all that may be given must fit.
 * Options may stand anywhere, also as --name=value; "--" ends them. GO_ON, or
 * the exit status: after --help 0, after a mistake USAGE, told on stderr. */
int saga_cli_parse(const saga_command *c, void *values,
                   const char **arguments, int argc, char **argv);

/* Prints the help of one command, on stdout. */
void saga_cli_help(const saga_command *c);

/* Prints a row of a list in the help: a name, and what it means, wrapped. */
void saga_cli_row(const char *name, const char *meaning);

/* Returns the nearest of n names to `name`, or NULL if none is near enough to
 * have been meant. Names lie `stride` bytes apart, each a const char *. */
const char *saga_cli_nearest(const char *name, const void *names, size_t n,
                             size_t stride);

/* --- Threads -------------------------------------------------------------- */

/* Takes n threads, 0 for as many as there are cores: SAGA_EXIT_OK, or the
 * status after a message of `command`. */
int saga_cli_threads(const char *command, int n);

/* --- Messages ------------------------------------------------------------ */

/* Prints "saga: ..." and a newline on stderr; returns status. */
int saga_cli_error(int status, const char *format, ...) SAGA_CLI_PRINTF(2, 3);

/* --- Signals ------------------------------------------------------------- */

/* Has Ctrl-C, SIGTERM and SIGHUP call `handler`, but those that whoever started
 * the program ignores (nohup). */
void saga_cli_catch_signals(void (*handler)(int number));

/* A handler that ends the program by the signal, as usual, without the files it
 * was writing (output.h). */
void saga_cli_end(int number);

/* --- Progress ------------------------------------------------------------ */

/* A meter is one line on stderr: rewritten in place on a terminal, else a new
 * one every few seconds. Zero it, set quiet to say nothing. Not for several
 * threads at once. */
typedef struct saga_meter {
    bool quiet;
    bool started, terminal;
    double start, shown;    /* seconds */
    double from;            /* what was done at the start */
    int width;              /* characters of the line that stands there */
} saga_meter;

/* done runs from 0, or what a run before has left, to 1; `doing` says what is
 * being done, with numbers. */
void saga_meter_show(saga_meter *m, double done, const char *doing);

/* Does the same as a saga_progress_fn; user is the meter. Never cancels. */
bool saga_meter_progress(void *user, double done, const char *doing);

/* Takes the line away, so that other output may follow. */
void saga_meter_end(saga_meter *m);

#endif
