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
    "Draws one picture of a .saga file, the same bits on every machine.\n"
    "\n"
    "  --camera rig:N   camera N of the rig stored in the file (--info lists\n"
    "                   how many there are)\n"
    "  --camera FILE    a text file of 22 integers in saga_camera's order\n"
    "                   (decoder/saga.h): rotation 9, centre 3, focal 2,\n"
    "                   principal 2, near plane, width, height, background 3;\n"
    "                   # begins a comment\n"
    "  --time N/D       the time in frames, a fraction (default 0/1; 15/2\n"
    "                   lies half-way between frames 7 and 8)\n"
    "  -o OUT.ppm       write the picture (8 bits, binary PPM); a device or a\n"
    "                   pipe is written directly\n"
    "  --seconds S      give up when decoding takes longer (default: never;\n"
    "                   the longest file of level 2 takes some seconds)\n"
    "  --crc            print the CRC-32C of its pixels instead\n"
    "  --info           print what the header says and stop\n"
    "  --version        print the program's version and the level of its\n"
    "                   memory\n"
    "\n"
    "Exit status: 0 done, 1 the stream or the camera is refused, 2 a file or\n"
    "the command line.\n";

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

int dec_parse_options(dec_options *o, int argc, char **argv)
{
    int i;

    for (i = 1; i < argc; i++) {
        const char *const value = i + 1 < argc ? argv[i + 1] : NULL;

        /* An option whose value is missing or wrong falls through to the
         * message, and so does a second file. */
        if (!strcmp(argv[i], "--crc"))
            o->crc = 1;
        else if (!strcmp(argv[i], "--info"))
            o->info = 1;
        else if (!strcmp(argv[i], "--camera") && value)
            o->camera = argv[++i];
        else if (!strcmp(argv[i], "-o") && value)
            o->out = argv[++i];
        else if (!strcmp(argv[i], "--time") && value && parse_time(o, value))
            i++;
        else if (!strcmp(argv[i], "--seconds") && value &&
                 dec_parse_seconds(&o->seconds, value))
            i++;
        else if (argv[i][0] != '-' && !o->file)
            o->file = argv[i];
        else {
            fprintf(stderr, "saga-dec: cannot use '%s'%s%s; --help explains\n",
                    argv[i], value ? " with " : "", value ? value : "");
            return 0;
        }
    }
    /* A picture needs a camera, and somewhere to go. */
    if (!o->file || (!o->info && (!o->camera || (!o->crc && !o->out)))) {
        fputs(dec_usage, stderr);
        return 0;
    }
    return 1;
}
