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

/* Writes the page of an open film to a path that ends in .html. address: where
 * on the web the page will be, or NULL; with it the page has the Open Graph
 * tags from which messengers show links, and their picture, a PNG with the
 * page's name, is written beside it. Returns false with *error set if the page
 * cannot be made. *unwritten tells whether only an output failed. */
bool saga_page_write(const char *path, const char *address, saga_film *film,
                     bool *unwritten, saga_error *error);

/* Returns whether an address has the form that saga_page_write takes:
 * http://HOST or https://HOST, perhaps with a path, without query and fragment,
 * of printable ASCII characters other than " < > and \. */
bool saga_page_is_address(const char *address);

#endif
