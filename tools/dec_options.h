/* SPDX-License-Identifier: MIT
 *
 * The command line of saga-dec, and the parsing of numbers, which saga-play
 * shares.
 */
#ifndef DEC_OPTIONS_H
#define DEC_OPTIONS_H

#include <stdint.h>

typedef struct {
    const char *file, *camera, *out;
    uint32_t time_num, time_den;
    double seconds; /* limit of the time to decode; 0: no limit */
    int crc, info;
} dec_options;

extern const char dec_usage[];

/* Reads a 32-bit number, which must fill the text up to the character `end`.
 * Returns 0 if it does not. */
int dec_parse_u32(uint32_t *v, const char *text, char end);

/* Reads a time above 0 and at most 1e9. Returns 0 if the text is not one. */
int dec_parse_seconds(double *seconds, const char *text);

/* As saga_utf8_copy of the trainer, which tools/ do not link, but for ASCII
 * only: copies text as it may be printed on a terminal: bytes other than
 * printable ASCII, which could be escape sequences, become %XX. What is longer
 * is cut. Returns `to`. */
enum { DEC_SHOWN_NBYTES = 256 };
const char *dec_shown(char to[DEC_SHOWN_NBYTES], const char *text);
#define SHOWN(text) dec_shown((char[DEC_SHOWN_NBYTES]){ 0 }, text)

/* Sets *o, which already has its defaults, from the command line. Returns 0,
 * after a message on stderr, if an option is unknown, wrong or missing. */
int dec_parse_options(dec_options *o, int argc, char **argv);

#endif
