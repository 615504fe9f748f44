/* SPDX-License-Identifier: MIT
 *
 * saga devices: lists what Vulkan finds, and opens what --device names.
 */
#include "devices_cli.h"

#include "cli.h"
#include "commands.h"
#include "json_cli.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_DEVICES = 16 };

typedef struct {
    bool json;
} devices_options;

/* --- --device ------------------------------------------------------------ */

/* Returns the number of the first usable device of one of two kinds, or -1. */
static int first_of(const saga_gpu_info *list, int n, const char *kind,
                    const char * or)
{
    for (int i = 0; i < n; i++)
        if (!list[i].lacks &&
            (!strcmp(list[i].kind, kind) || !strcmp(list[i].kind, or)))
            return i;
    return -1;
}

/* Returns whether a name is a number, and sets it. */
static bool is_number(int *number, const char *name)
{
    char *end;

    *number = (int)strtol(name, &end, 10);
    return end != name && *end == '\0' && *number >= 0;
}

static int no_device(const char *command, const saga_error *error)
{
    return saga_cli_error(SAGA_EXIT_USAGE, "%s: %s", command, error->message);
}

int saga_cli_open_device(saga_gpu **gpu, const char *name, const char *command)
{
    const bool is_auto = !strcmp(name, "auto");
    saga_gpu_info list[MOST_DEVICES];
    saga_error error = { "" };
    int n, number = -1;

    *gpu = NULL;
    if (!strcmp(name, "cpu"))
        return SAGA_EXIT_OK;
    if (!is_auto && strcmp(name, "gpu") != 0 && !is_number(&number, name))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "%s: --device takes auto, cpu, gpu or a number "
                              "of `saga devices`, not '%s'",
                              command, name);
    n = saga_gpu_list(list, MOST_DEVICES, &error);
    n = n < MOST_DEVICES ? n : MOST_DEVICES;
    if (n == 0)
        return is_auto ? SAGA_EXIT_OK : no_device(command, &error);
    if (is_auto || !strcmp(name, "gpu"))
        number = first_of(list, n, "discrete", is_auto ? "" : "integrated");
    if (number < 0 && is_auto)
        return SAGA_EXIT_OK;
    if (number < 0)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "%s: there is no usable GPU; see `saga devices`, "
                              "or give --device cpu",
                              command);
    *gpu = saga_gpu_open(number, &error);
    if (*gpu)
        saga_cli_error(0, "%s: device %d, %s", command, number,
                       saga_gpu_is(*gpu)->name);
    /* A device that the user did not name must not stop the training. */
    if (!*gpu && is_auto)
        saga_cli_error(0, "%s: %s; the processor trains", command,
                       error.message);
    return *gpu || is_auto ? SAGA_EXIT_OK : no_device(command, &error);
}

/* --- saga devices -------------------------------------------------------- */

static int print_json(const saga_gpu_info *list, int n)
{
    json_t *const report = saga_cli_json_head("devices", NULL);
    json_t *const all = json_array();

    for (int i = 0; i < n; i++) {
        const saga_gpu_info *const d = list + i;
        json_t *const o = json_object();
        char version[40];

        snprintf(version, sizeof version, "%" PRIu32 ".%" PRIu32 ".%" PRIu32,
                 d->version[0], d->version[1], d->version[2]);
        saga_put_int(o, "number", i);
        saga_put_text(o, "name", d->name);
        saga_put_text(o, "kind", d->kind);
        saga_put_int(o, "memory", (json_int_t)d->memory);
        saga_put_text(o, "vulkan", version);
        saga_put_text(o, "driver", d->driver);
        saga_put_text(o, "lacks", d->lacks);
        saga_put_item(all, o);
    }
    saga_put(report, "devices", all);
    return saga_cli_print_json(report, 6, "devices");
}

static void print_table(const saga_gpu_info *list, int n)
{
    saga_cli_print("   name                                     kind         "
                   "   memory   usable");
    for (int i = 0; i < n; i++)
        saga_cli_print("%-2d %-40s %-11s %7.1f GB   %s%s", i, list[i].name,
                       list[i].kind, (double)list[i].memory * 1e-9,
                       list[i].lacks ? "lacks " : "yes",
                       list[i].lacks ? list[i].lacks : "");
}

static int devices_command(int argc, char **argv)
{
    devices_options o = { .json = false };
    saga_gpu_info list[MOST_DEVICES];
    saga_error error = { "" };
    const char *none[SAGA_CLI_MOST_ARGUMENTS];
    const int status = saga_cli_parse(&saga_command_devices, &o, none, argc,
                                      argv);
    int n;

    if (status != SAGA_CLI_GO_ON)
        return status;
    n = saga_gpu_list(list, MOST_DEVICES, &error);
    n = n < MOST_DEVICES ? n : MOST_DEVICES;
    if (o.json)
        return print_json(list, n);
    if (n > 0)
        print_table(list, n);
    else
        saga_cli_print("no devices: %s", error.message);
    return SAGA_EXIT_OK;
}

static const saga_cli_option options[] = {
    { "--json", NULL, "print the list as JSON", saga_cli_flag,
      offsetof(devices_options, json), 0, 0 }
};

const saga_command saga_command_devices = {
    "devices",
    "",
    0,
    "lists the GPUs that can train (encode --device)",
    "Lists the devices that Vulkan finds, with the numbers that\n"
    "`saga encode --device` takes. A device of the kind cpu is a program that\n"
    "computes what a GPU would; it is slower than `--device cpu`.\n",
    options,
    sizeof options / sizeof options[0],
    devices_command,
    NULL
};
