/* SPDX-License-Identifier: MIT
 *
 * The frozen tables have the checksums that docs/arithmetic.md gives. SAGA_ROOT
 * is the repository's folder, by default ".".
 */
#include "fx_math.h"
#include "prob_tables.h"
#include "saga.h"
#include "sqrt_up.h"
#include "testing.h"

static char page[1 << 17];

static void read_page(void)
{
    const char *const root = getenv("SAGA_ROOT");
    char path[1024];
    FILE *f;
    size_t n;

    snprintf(path, sizeof path, "%s/docs/arithmetic.md", root ? root : ".");
    f = fopen(path, "r");
    if (!f)
        fail_msg("%s: cannot be read", path);
    n = fread(page, 1, sizeof page - 1, f);
    assert_true(n < sizeof page - 1);
    page[n] = '\0';
    fclose(f);
}

static uint32_t crc_on(uint32_t crc, uint32_t x)
{
    const uint8_t b[4] = { (uint8_t)x, (uint8_t)(x >> 8), (uint8_t)(x >> 16),
                           (uint8_t)(x >> 24) };

    return saga_crc32c(crc, b, 4);
}

/* Checks that the page has a checksum in the line that begins with `line`,
 * before the text `end`. */
static void check_page(const char *line, const char *end, uint32_t crc)
{
    char digits[9];
    const char *const at = strstr(page, line);
    const char *found;

    snprintf(digits, sizeof digits, "%08x", crc);
    if (!at)
        fail_msg("arithmetic.md has no '%s'", line);
    found = strstr(at, digits);
    if (!found || found > strstr(at, end))
        fail_msg("arithmetic.md, '%s': not %s", line, digits);
}

#define CHECK_TABLE(line, end, table)                         \
    do {                                                      \
        uint32_t crc = 0;                                     \
        size_t k;                                             \
        for (k = 0; k < sizeof(table) / sizeof *(table); k++) \
            crc = crc_on(crc, (uint32_t)(table)[k]);          \
        check_page(line, end, crc);                           \
    } while (0)

TEST(page_should_have_the_checksum_of_every_table)
{
    read_page();
    CHECK_TABLE("\n| exp2 |", "\n| soft", saga_exp2_q30);
    CHECK_TABLE("\n| soft |", "\n| sigm", saga_softplus2_q24);
    CHECK_TABLE("\n| sigm |", "\n| inv", saga_sigmoid_q24);
    CHECK_TABLE("\n| inv |", "\n| root", saga_recip_q23);
    CHECK_TABLE("\n| root |", "\n\n", saga_rsqrt_q23);
    CHECK_TABLE("of the 2,488 starts", "They", saga_prob_start);
    CHECK_TABLE("of the 136 starts", "\n\n", saga_prob_binomial);
    CHECK_TABLE("    up[i] =", "\n", saga_sqrt_up_q12);
}
