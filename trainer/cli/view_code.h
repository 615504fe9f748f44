/* SPDX-License-Identifier: MIT */
#ifndef SAGA_VIEW_CODE_H
#define SAGA_VIEW_CODE_H

#include <stdio.h>

/* Draws a text as a QR code on a terminal. Draws nothing if memory is short, or
 * if the program was built without libqrencode. */
void saga_view_code(FILE *terminal, const char *text);

#endif
