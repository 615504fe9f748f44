/* SPDX-License-Identifier: MIT */
#include "ablation.h"

#include "model.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define ROW(member, word, value, most, help) \
    { word, offsetof(saga_ablation, member), most },

static const struct {
    const char *name;
    size_t offset; /* offset of the member in saga_ablation */
    long most;
} words[] = { SAGA_ABLATION_WORDS(ROW) };

enum { N_WORDS = sizeof words / sizeof *words };

#define NAME(member, word, value, most, help) word ", "

static const char remedy[] = "use the words " SAGA_ABLATION_WORDS(
    NAME) "see `saga help encode --all`";

/* Reads a word of n characters. Returns false if it is unknown or its number is
 * out of range. */
static bool read_word(saga_ablation *a, const char *text, size_t n)
{
    for (int i = 0; i < N_WORDS; i++) {
        const size_t length = strlen(words[i].name);
        const bool flag = words[i].name[length - 1] != '=';
        char *end = NULL;

        /* A flag must be the whole word; a name with '=' must begin it. */
        if (n < length || memcmp(text, words[i].name, length) != 0 ||
            flag != (n == length))
            continue;
        const long x = flag ? 1 : strtol(text + length, &end, 10);
        const uint16_t number = (uint16_t)x;

        /* All members of saga_ablation have 16 bits. */
        memcpy((char *)a + words[i].offset, &number, sizeof number);
        return flag || (end == text + n && x > 0 && x <= words[i].most);
    }
    return false;
}

static bool is_allowed(const saga_ablation *a, saga_error *error)
{
    /* The number of slots is a power of two within the format's limits; 0 means
     * that it was not given. */
    if (a->slots & (a->slots - 1) || (a->slots && a->slots < SAGA_MIN_SLOTS))
        return saga_fail(error, NULL, remedy, "--ablate slots=%u", a->slots);
    return !a->no_bank || (!a->slots && !a->plain_update) ||
           saga_fail(error, NULL, "leave it or them out",
                     "--ablate no-bank "
                     "excludes slots and plain-update");
}

bool saga_ablation_read(saga_ablation *a, const char *list, saga_error *error)
{
    memset(a, 0, sizeof *a);
    while (list) {
        const size_t n = strcspn(list, ",");

        if (!read_word(a, list, n))
            return saga_fail(error, NULL, remedy,
                             "--ablate does not know "
                             "'%.*s'",
                             (int)n, list);
        list = list[n] ? list + n + 1 : NULL;
    }
    return is_allowed(a, error);
}
