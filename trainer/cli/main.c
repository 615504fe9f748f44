/* SPDX-License-Identifier: MIT
 *
 * saga is the desktop program. Each subcommand has a file of its own; this file
 * finds the subcommand and prints the general help.
 */
#include "cli.h"
#include "commands.h"
#include "isa.h"
#include "presets_cli.h"
#include "saga.h"
#include "threads.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const saga_command *const commands[] = {
    &saga_command_synth,  &saga_command_check,  &saga_command_encode,
    &saga_command_info,   &saga_command_eval,   &saga_command_compare,
    &saga_command_report, &saga_command_render, &saga_command_view,
    &saga_command_verify, &saga_command_export, &saga_command_import,
    &saga_command_cut,    &saga_command_join,   &saga_command_mux,
    &saga_command_volume, &saga_command_devices
};

enum { N_COMMANDS = (int)(sizeof commands / sizeof commands[0]) };

static const char first_steps[] =
    "saga turns a multi-view video of a moving scene into one small file.\n"
    "From that file it draws any view at any time, with the same bits on\n"
    "every machine.\n"
    "\n"
    "usage: saga COMMAND [ARGUMENTS] [OPTIONS]\n"
    "\n";

static const char last_words[] =
    "\n"
    "  saga help COMMAND   explains a command and its options\n"
    "  saga help presets   lists the presets of encode\n"
    "  saga --version      prints the versions of program and file format\n"
    "\n"
    "First steps:\n"
    "\n"
    "  saga synth demo                  makes a capture of a built-in scene\n"
    "  saga encode demo -o demo.saga    trains on it, for some minutes\n"
    "  saga info demo.saga              prints what the file holds\n"
    "  saga eval demo.saga demo         measures how good it is\n"
    "  saga view demo.saga              shows it in the browser\n"
    "  saga render demo.saga -o tour_%02d.png --orbit 60\n"
    "\n"
    "saga-play draws all pictures of a film for a player (saga-play --help).\n"
    "On small devices, saga-dec draws pictures with the decoder alone\n"
    "(saga-dec --help).\n"
    "\n"
    "Exit status: 0 done, 1 the contents of a file are invalid, 2 a mistake\n"
    "in the command line, or a file cannot be read or written.\n";

static void print_help(void)
{
    fputs(first_steps, stdout);
    for (int i = 0; i < N_COMMANDS; i++)
        printf("  %-8s %-16s %s\n", commands[i]->name, commands[i]->arguments,
               commands[i]->summary);
    fputs(last_words, stdout);
}

static const saga_command *find(const char *name)
{
    for (int i = 0; i < N_COMMANDS; i++)
        if (!strcmp(commands[i]->name, name))
            return commands[i];
    return NULL;
}

static int unknown(const char *name)
{
    const char *names[N_COMMANDS];
    const char *near;

    for (int i = 0; i < N_COMMANDS; i++)
        names[i] = commands[i]->name;
    near = saga_cli_nearest(name, names, N_COMMANDS, sizeof names[0]);
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "unknown command '%s'%s%s%s; "
                          "`saga --help` lists them",
                          name, near ? ", did you mean '" : "",
                          near ? near : "", near ? "'" : "");
}

/* `more` is what stands after the name: --all, or NULL. */
static int help(const char *name, const char *more)
{
    const saga_command *const c = name ? find(name) : NULL;

    if (name && !strcmp(name, "presets")) {
        saga_presets_help();
        return SAGA_EXIT_OK;
    }
    if (name && !c)
        return unknown(name);
    if (c)
        saga_cli_help(c, more && !strcmp(more, "--all"));
    else
        print_help();
    return SAGA_EXIT_OK;
}

/* Returns the exit status after checking that standard output could be written;
 * the disk may be full. */
static int flushed(int status)
{
    if ((fflush(stdout) || ferror(stdout)) && status == SAGA_EXIT_OK)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "standard output: cannot be "
                              "written; check the free space of the disk");
    return status;
}

static int run_command(int argc, char **argv)
{
    const char *const name = argc > 1 ? argv[1] : NULL;
    const saga_command *c;

    if (!name) {
        saga_cli_error(SAGA_EXIT_USAGE, "no command is given; `saga --help` "
                                        "lists the commands");
        return SAGA_EXIT_USAGE;
    }
    if (!strcmp(name, "--help") || !strcmp(name, "-h") || !strcmp(name, "help"))
        return help(argc > 2 ? argv[2] : NULL, argc > 3 ? argv[3] : NULL);
    if (!strcmp(name, "--version")) {
        puts("saga " SAGA_RELEASE ", format " SAGA_FORMAT);
        return SAGA_EXIT_OK;
    }
    c = find(name);
    if (!c && name[0] == '-')
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "unknown option '%s'; `saga "
                              "--help` lists them",
                              name);
    return c ? c->run(argc - 1, argv + 1) : unknown(name);
}

/* Starts the program again with another environment for libgomp, which reads it
 * before main. By default its threads spin while they wait, which takes cores
 * from everything else, and have stacks of 8 MiB. If the restart fails, only
 * time and memory are lost. */
static void tame_threads(char **argv)
{
#ifdef _OPENMP
    char stack[32];

    snprintf(stack, sizeof stack, "%zuB", SAGA_STACK_NBYTES);
    /* The variable also marks the restarted program, so that it starts over
     * only once. A value that the user set is kept. execv returns only if it
     * failed. */
    if (!getenv("OMP_WAIT_POLICY") &&
        setenv("OMP_WAIT_POLICY", "passive", 1) == 0 &&
        setenv("OMP_STACKSIZE", stack, 0) == 0)
        execv("/proc/self/exe", argv);
#else
    (void)argv;
#endif
}

/* Makes the stack deeper than training needs it, whose functions take up to
 * 67 kB each. If it grew only when memory is used up, the system would end the
 * program before it could say so. */
static void deepen_stack(void)
{
    enum { NBYTES = 512 << 10, PAGE = 4096 };
    volatile char deep[NBYTES];

    for (size_t i = NBYTES; i >= PAGE; i -= PAGE)
        deep[i - PAGE] = 0;
    (void)deep[0];
}

int main(int argc, char **argv)
{
    saga_error error = { "" };

    deepen_stack();
    tame_threads(argv);
    if (!saga_isa_check(&error))
        return saga_cli_error(SAGA_EXIT_USAGE, "%s", error.message);
    saga_cli_catch_signals(saga_cli_end);
    /* A file that outgrows `ulimit -f` is reported like one that does not fit
     * on the disk. */
    signal(SIGXFSZ, SIG_IGN);
    return flushed(run_command(argc, argv));
}
