/* SPDX-License-Identifier: MIT */
#include "view_code.h"

#ifdef SAGA_QRENCODE
#include <qrencode.h>
#include <stdbool.h>

/* Light modules around a code, without which cameras do not find it (ISO/IEC
 * 18004). */
enum { MARGIN = 4 };

static bool is_dark(const QRcode *code, int x, int y)
{
    return x >= 0 && y >= 0 && x < code->width && y < code->width &&
           (code->data[y * code->width + x] & 1);
}

void saga_view_code(FILE *terminal, const char *text)
{
    /* A character is one module wide and two high; light is white. By [upper is
     * dark][lower is dark]: full, upper half, lower half, blank. */
    static const char *const cell[2][2] = { { "\xe2\x96\x88", "\xe2\x96\x80" },
                                            { "\xe2\x96\x84", " " } };
    QRcode *const code = QRcode_encodeString8bit(text, 0, QR_ECLEVEL_L);

    if (!code)
        return;
    for (int y = -MARGIN; y < code->width + MARGIN; y += 2) {
        /* White on black, whatever the terminal's colours are. */
        fputs("\033[97;40m", terminal);
        for (int x = -MARGIN; x < code->width + MARGIN; x++)
            fputs(cell[is_dark(code, x, y)][is_dark(code, x, y + 1)], terminal);
        fputs("\033[0m\n", terminal);
    }
    QRcode_free(code);
}
#else
void saga_view_code(FILE *terminal, const char *text)
{
    (void)terminal;
    (void)text;
}
#endif
