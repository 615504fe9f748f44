/* SPDX-License-Identifier: MIT */
#ifndef SAGA_PRESETS_CLI_H
#define SAGA_PRESETS_CLI_H

/* Prints a description of the presets of `saga encode` on stdout. */
void saga_presets_help(void);

#endif
