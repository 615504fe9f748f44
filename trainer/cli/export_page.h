/* SPDX-License-Identifier: MIT
 *
 * A film as a page in one file: the page of ports/web with its modules, the
 * decoder, a poster and the film, whose bytes it holds unchanged in base64. It
 * needs no server and no network.
 */
#ifndef SAGA_EXPORT_PAGE_H
#define SAGA_EXPORT_PAGE_H

#include "error.h"
#include "view.h"

/* Writes the page of an open film. Returns false with *error set if it cannot
 * be made. *unwritten tells whether only the output failed. */
bool saga_page_write(const char *path, saga_film *film, bool *unwritten,
                     saga_error *error);

#endif
