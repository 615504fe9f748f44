/* SPDX-License-Identifier: MIT
 *
 * The option --device: what trains.
 */
#ifndef SAGA_DEVICES_CLI_H
#define SAGA_DEVICES_CLI_H

#include "compute.h"

/* Opens the device of a name: "cpu" for none, "gpu" for the first GPU, a number
 * of `saga devices`, or "auto" for the first GPU with memory of its own, if
 * there is one. *gpu is NULL if the processor trains; else the caller closes
 * it. Returns an exit status, after a message from `command`. */
int saga_cli_open_device(saga_gpu **gpu, const char *name, const char *command);

#endif
