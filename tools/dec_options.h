/* SPDX-License-Identifier: MIT
 *
 * The command line of saga-dec, and numbers as saga-play has them too.
 */
#ifndef DEC_OPTIONS_H
#define DEC_OPTIONS_H

#include <stdint.h>

typedef struct {
    const char *file, *camera, *out;
    uint32_t time_num, time_den;
    double seconds;          /* of decoding, at most; 0: any */
    int crc, info;
} dec_options;

extern const char dec_usage[];

/* Reads a number of 32 bits, all of text up to `end`; 0 if it is none. */
int dec_parse_u32(uint32_t *v, const char *text, char end);

/* Reads a time, above 0 and at most 1e9; 0 if it is none. */
int dec_parse_seconds(double *seconds, const char *text);

/* Sets *o, which has its defaults; 0, said on stderr, if that cannot be. */
int dec_parse_options(dec_options *o, int argc, char **argv);

#endif
