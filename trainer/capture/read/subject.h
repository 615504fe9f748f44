/* SPDX-License-Identifier: MIT
 *
 * Cuts a subject out of pictures at the size of their files, before scaling, so
 * that pixels at its edge have the subject's part of their light and nothing of
 * what is behind.
 */
#ifndef SAGA_SUBJECT_H
#define SAGA_SUBJECT_H

#include "capture.h"

/* Multiplies n pixels of RGB by their grey mask, (n, 3). */
void saga_subject_cut(uint8_t *rgb, const uint8_t *mask, size_t n);

/* Cuts out what is not of the key's colour: sets the mask, and multiplies the
 * colours by it. */
void saga_subject_key(uint8_t *rgb, uint8_t *mask, size_t n,
                      const uint8_t key[3]);

/* Fails if the colour is not that of a screen: one channel must be above the
 * others by at least 64. */
bool saga_subject_check_key(const uint8_t key[3], saga_error *error);

/* Tells whether all bytes have a value. */
bool saga_subject_is_all(const uint8_t *bytes, size_t n, uint8_t value);

/* Fails if the subject fills all pictures, or none: the masks are missing, or
 * do not mean the opacity of a subject. */
bool saga_subject_check(const saga_capture *capture, const char *path,
                        saga_error *error);

#endif
