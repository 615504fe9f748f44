/* SPDX-License-Identifier: MIT
 *
 * A name with a number in it, like out_%04d.png, stands for a sequence of
 * files.
 */
#ifndef SAGA_NUMBERED_H
#define SAGA_NUMBERED_H

#include "error.h"

#include <stdbool.h>

/* Tells whether the name has exactly one %d or %0Nd, N <= 20, and no other
 * %. */
bool saga_is_numbered(const char *name);

/* Returns the name with the number in place of its %d, or a copy of a name that
 * has none. The caller frees it. */
char *saga_numbered_name(const char *name, int number, saga_error *error);

#endif
