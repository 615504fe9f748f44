/* SPDX-License-Identifier: MIT
 *
 * Shared by the subcommands of `saga`: their description, the command line,
 * messages, progress.
 *
 * Messages go to stderr, one sentence each: the file or the option, the value
 * that is wrong, and what to do about it. Results go to stdout.
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

/* The exit statuses of every subcommand. */
enum {
    SAGA_EXIT_OK = 0,
    SAGA_EXIT_DATA = 1,  /* the contents of a file are invalid */
    SAGA_EXIT_USAGE = 2, /* a mistake in the command line, or a file cannot
                          * be read or written */
    SAGA_CLI_GO_ON = -1  /* saga_cli_parse returns it if the command is to be
                          * run */
};

/* --- Commands and options ------------------------------------------------ */

typedef struct saga_cli_option saga_cli_option;

/* Parses a whole text into the value at `to`; returns false if it is
 * invalid. */
typedef bool saga_cli_read_fn(void *to, const char *text,
                              const saga_cli_option *option);

struct saga_cli_option {
    const char *name;       /* "--json", "-o" */
    const char *value;      /* name of the value in the help; NULL: a flag has
                             * none */
    const char *help;       /* lines, separated by \n */
    saga_cli_read_fn *read; /* saga_cli_flag for a flag */
    size_t offset;          /* offset of its value in the command's structure */
    long min, max;          /* the range, for readers that have one */
};

/* A row of a table of options: those after it are for few users, and the help
 * lists them only with --all. */
#define SAGA_CLI_MORE                 \
    {                                 \
        "", NULL, NULL, NULL, 0, 0, 0 \
    }

/* The largest number of arguments if the last may be repeated. */
enum { SAGA_CLI_MOST_ARGUMENTS = 1024 };

typedef struct saga_command {
    const char *name;
    const char *arguments; /* "FILE CAPTURE", for the usage line; "..." at the
                            * end: the last argument may be repeated */
    int n_arguments;       /* number of arguments that must be given */
    const char *summary;   /* one line, for the list of commands */
    const char *text;      /* describes the command; lines */
    const saga_cli_option *options;
    int n_options;
    int (*run)(int argc, char **argv); /* argv[0] is the command's name */
    void (*print_list)(void); /* prints a list after the text; NULL: no list */
} saga_command;

/* Readers of values; the comment after each says what it stores at the option's
 * offset. */
saga_cli_read_fn saga_cli_flag;   /* bool; text is NULL */
saga_cli_read_fn saga_cli_text;   /* const char *; not empty */
saga_cli_read_fn saga_cli_names;  /* const char *; empty for none */
saga_cli_read_fn saga_cli_int;    /* int, min..max */
saga_cli_read_fn saga_cli_real;   /* double, finite */
saga_cli_read_fn saga_cli_nbytes; /* double; "150k" is 150,000, "1.2M"
                                   * 1,200,000 */
saga_cli_read_fn saga_cli_scale;  /* int N of "1/N" or "N", min..max */
saga_cli_read_fn saga_cli_size;   /* saga_cli_pair of "WxH", each min..max */
saga_cli_read_fn saga_cli_sides;  /* the same, or "N", which leaves b 0 */
saga_cli_read_fn saga_cli_range;  /* saga_cli_pair of "A:B", A < B, min..max; a
                                   * missing end keeps its default */
saga_cli_read_fn saga_cli_fraction; /* saga_cli_pair of "N" or "N/D", N within
                                     * min..max, D >= 1 */

saga_cli_read_fn saga_cli_colour; /* saga_cli_rgb of "RRGGBB", with or without
                                   * a "#" */

typedef struct saga_cli_rgb {
    bool given;
    uint8_t rgb[3];
} saga_cli_rgb;

typedef struct saga_cli_pair {
    int32_t a, b;
} saga_cli_pair;

/* Parses the options into the structure at `values`, which holds the defaults,
 * and the arguments into arguments[], which must have room for all that may be
 * given. Options may stand anywhere, also as --name=value; "--" ends them.
 * Returns SAGA_CLI_GO_ON or an exit status: 0 after --help [--all],
 * SAGA_EXIT_USAGE after a mistake, which has been reported on stderr. */
int saga_cli_parse(const saga_command *c, void *values, const char **arguments,
                   int argc, char **argv);

/* Prints the help of one command on stdout, with all of its options or without
 * those after SAGA_CLI_MORE. */
void saga_cli_help(const saga_command *c, bool all);

/* Prints a row of a list in the help: a name, and its meaning, wrapped. */
void saga_cli_row(const char *name, const char *meaning);

/* Returns the one of n names that is nearest to `name`, or NULL if none is near
 * enough to be what was meant. names points to the first of n pointers (const
 * char *), which are `stride` bytes apart. */
const char *saga_cli_nearest(const char *name, const void *names, size_t n,
                             size_t stride);

/* --- Threads -------------------------------------------------------------- */

/* Sets the number of threads; n = 0 means all cores. Returns SAGA_EXIT_OK, or
 * an exit status after a message from `command`. */
int saga_cli_threads(const char *command, int n);

/* --- Messages ------------------------------------------------------------ */

/* Prints a line on stdout, in which all that is foreign is made visible
 * (utf8.h). */
void saga_cli_print(const char *format, ...) SAGA_CLI_PRINTF(1, 2);

/* Prints "saga: ..." in the same way on stderr; returns status. */
int saga_cli_error(int status, const char *format, ...) SAGA_CLI_PRINTF(2, 3);

/* --- Signals ------------------------------------------------------------- */

/* Installs `handler` for Ctrl-C, SIGTERM and SIGHUP, except for signals that
 * the parent process has set to be ignored (nohup). */
void saga_cli_catch_signals(void (*handler)(int number));

/* A handler that removes the files being written (output.h) and ends the
 * program by the signal's default action. */
void saga_cli_end(int number);

/* --- Progress ------------------------------------------------------------ */

/* A meter is one line on stderr: on a terminal it is rewritten in place,
 * otherwise a new line is printed every few seconds. Initialise with zeros; set
 * `quiet` to print nothing. It must not be used by several threads at once. */
typedef struct saga_meter {
    bool quiet;
    bool started, terminal;
    double start, shown; /* seconds: when it began and when it was last shown */
    double from;         /* the value of `done` at the start */
    int width;           /* length of the line on the terminal, in characters */
} saga_meter;

/* Shows progress: `done` runs to 1 from 0, or from what an earlier run has
 * completed; `doing` describes the work, with numbers. */
void saga_meter_show(saga_meter *m, double done, const char *doing);

/* A saga_progress_fn whose user is a meter; it shows progress there and never
 * cancels. */
bool saga_meter_progress(void *user, double done, const char *doing);

/* Removes the line, so that other output may follow. */
void saga_meter_end(saga_meter *m);

/* The option of every command that has a meter, and the bool that it sets. */
#define SAGA_CLI_QUIET(type, field)                                      \
    {                                                                    \
        "--quiet", NULL, "show no progress; messages are still printed", \
            saga_cli_flag, offsetof(type, field), 0, 0                   \
    }

#endif
