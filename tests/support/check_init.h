/* SPDX-License-Identifier: MIT */
#ifndef CHECK_INIT_H
#define CHECK_INIT_H

#include "cpu.h"

/* Plays files on every path up to `best`, to which *chosen is set; see
 * check_init.c. Returns the program's exit status. */
int check_init(saga_cpu *chosen, saga_cpu best, char *const *files,
               int n_files);

#endif
