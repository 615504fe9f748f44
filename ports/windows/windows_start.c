/* SPDX-License-Identifier: MIT
 *
 * Every program for Windows contains this file. Before main() it makes all
 * streams binary, since lines end with "\n" on every machine.
 */
#include <fcntl.h>
#include <io.h>
#include <stdlib.h>

__attribute__((constructor)) static void make_binary(void)
{
    int fd;

    _fmode = _O_BINARY; /* for files that are opened later */
    for (fd = 0; fd <= 2; fd++)
        _setmode(fd, _O_BINARY);
}
