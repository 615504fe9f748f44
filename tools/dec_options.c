/* SPDX-License-Identifier: MIT */
#include "dec_options.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char dec_usage[] =
    "usage: saga-dec FILE --camera CAM [--time N/D] (-o OUT.ppm | --crc)\n"
    "       saga-dec FILE --info\n"
    "       saga-dec --version\n"
    "\n"
    "Draws one picture of a .saga file, with the same bits on every machine.\n"
    "\n"
    "  --camera N       camera N of those stored in the file, also as rig:N\n"
    "                   (--info prints their number)\n"
    "  --camera FILE    a camera described by 22 integers in a text file, in\n"
    "                   the order of saga_camera (decoder/saga.h): 9 of the\n"
    "                   rotation, 3 of the centre, 2 focal lengths, 2 of the\n"
    "                   principal point, near plane, width, height, 3 of the\n"
    "                   background; # begins a comment. A FILE whose name is\n"
    "                   a number is given as ./FILE\n"
    "  --time N/D       time in frames, as a fraction (default 0/1; 15/2 is\n"
    "                   half-way between frames 7 and 8)\n"
    "  -o OUT.ppm       write the picture (8 bits, binary PPM) to a file, a\n"
    "                   device or a pipe\n"
    "  --seconds S      give up if decoding takes longer (default: never; the\n"
    "                   longest file of level 2 takes a few seconds)\n"
    "  --crc            print the CRC-32C of the pixels instead\n"
    "  --info           print what the header says, and stop\n"
    "  --version        print the version, and the level whose memory the\n"
    "                   program has\n"
    "\n"
    "Exit status: 0 done, 1 the file's contents or the camera are refused,\n"
    "2 a mistake in the command line, or a file cannot be read or written.\n";

int dec_parse_u32(uint32_t *v, const char *text, char end)
{
    char *stop;
    unsigned long long x;

    errno = 0;
    x = strtoull(text, &stop, 10);
    *v = (uint32_t)x;
    return text[0] >= '0' && text[0] <= '9' && *stop == end && !errno &&
           x <= 0xffffffffu;
}

static int parse_time(dec_options *o, const char *text)
{
    const char *const slash = strchr(text, '/');

    o->time_den = 1;
    if (!slash)
        return dec_parse_u32(&o->time_num, text, '\0');
    return dec_parse_u32(&o->time_num, text, '/') &&
           dec_parse_u32(&o->time_den, slash + 1, '\0') && o->time_den > 0;
}

int dec_parse_seconds(double *seconds, const char *text)
{
    char *stop;

    *seconds = strtod(text, &stop);
    return stop != text && *stop == '\0' && *seconds > 0 && *seconds <= 1e9;
}

const char *dec_shown(char to[DEC_SHOWN_NBYTES], const char *text)
{
    int n = 0;
    for (; *text && n < DEC_SHOWN_NBYTES - 4; text++)
        n += snprintf(to + n, 4, *text >= ' ' && *text <= '~' ? "%c" : "%%%02X",
                      (unsigned char)*text);
    to[n] = '\0';
    return to;
}

int dec_parse_options(dec_options *o, int argc, char **argv)
{
    int i;

    for (i = 1; i < argc; i++) {
        const char *const value = i + 1 < argc ? argv[i + 1] : NULL;

        /* Unknown options, options whose value is missing or wrong, and a
         * second file or output end in the last branch, which prints the
         * message. */
        if (!strcmp(argv[i], "--crc"))
            o->crc = 1;
        else if (!strcmp(argv[i], "--info"))
            o->info = 1;
        else if (!strcmp(argv[i], "--camera") && value)
            o->camera = argv[++i];
        else if (!strcmp(argv[i], "-o") && value && !o->out)
            o->out = argv[++i];
        else if (!strcmp(argv[i], "--time") && value && parse_time(o, value))
            i++;
        else if (!strcmp(argv[i], "--seconds") && value &&
                 dec_parse_seconds(&o->seconds, value))
            i++;
        else if (argv[i][0] != '-' && !o->file)
            o->file = argv[i];
        else {
            fprintf(stderr,
                    "saga-dec: unknown or wrong option '%s'%s%s; see "
                    "saga-dec --help\n",
                    SHOWN(argv[i]), value ? " " : "",
                    SHOWN(value ? value : ""));
            return 0;
        }
    }
    /* To draw a picture, saga-dec needs a camera, and either an output file or
     * --crc. */
    if (!o->file || (!o->info && (!o->camera || (!o->crc && !o->out)))) {
        fputs(dec_usage, stderr);
        return 0;
    }
    return 1;
}
