/* SPDX-License-Identifier: MIT */
#ifndef SAGA_PRESETS_CLI_H
#define SAGA_PRESETS_CLI_H

/* Prints what the presets of saga encode are, on stdout. */
void saga_presets_help(void);

#endif
