/* SPDX-License-Identifier: MIT
 *
 * The check of UTF-8 is compared with table 3-7 of the Unicode Standard, whose
 * byte ranges are written out here. Names that are not UTF-8 stay distinct, and
 * are cut after a whole character. A missing value in JSON is noticed.
 */
#include "json_memory.h"
#include "notes.h"
#include "testing.h"
#include "utf8.h"

/* The ranges of the first and second byte, and the length of a character; all
 * further bytes are 80 to BF. */
static const struct {
    uint8_t lo, hi, second_lo, second_hi, n;
} row[] = { { 0x00, 0x7f, 0, 0, 1 },       { 0xc2, 0xdf, 0x80, 0xbf, 2 },
            { 0xe0, 0xe0, 0xa0, 0xbf, 3 }, { 0xe1, 0xec, 0x80, 0xbf, 3 },
            { 0xed, 0xed, 0x80, 0x9f, 3 }, { 0xee, 0xef, 0x80, 0xbf, 3 },
            { 0xf0, 0xf0, 0x90, 0xbf, 4 }, { 0xf1, 0xf3, 0x80, 0xbf, 4 },
            { 0xf4, 0xf4, 0x80, 0x8f, 4 } };

static size_t by_table(const uint8_t *p, size_t n)
{
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        bool ok = n >= row[i].n && p[0] >= row[i].lo && p[0] <= row[i].hi;

        if (ok && row[i].n > 1)
            ok = p[1] >= row[i].second_lo && p[1] <= row[i].second_hi;
        for (size_t k = 2; ok && k < row[i].n; k++)
            ok = p[k] >= 0x80 && p[k] <= 0xbf;
        if (ok)
            return row[i].n;
    }
    return 0;
}

TEST(characters_should_be_those_of_the_table)
{
    static const uint8_t ends[] = { 0x00, 0x7f, 0x80, 0xbf, 0xc0, 0xff };

    for (uint32_t head = 0; head < 0x10000; head++)
        for (size_t i = 0; i < 36; i++) {
            const uint8_t p[4] = { (uint8_t)(head >> 8), (uint8_t)head,
                                   ends[i / 6], ends[i % 6] };

            for (size_t n = 0; n <= 4; n++)
                assert_int_equal(saga_utf8_length((const char *)p, n),
                                 by_table(p, n));
        }
}

static void copy(const char *from, const char *wanted)
{
    char to[64];

    memset(to, 'x', sizeof to);
    saga_utf8_copy(to, sizeof to, from, strlen(from));
    assert_string_equal(to, wanted);
    assert_true(saga_utf8_is(to));
}

TEST(bytes_should_be_told_where_they_are_no_character)
{
    copy("", "");
    copy("caf\303\251", "caf\303\251");
    copy("caf\351", "caf%E9");
    copy("\303", "%C3");
    copy("\355\240\200", "%ED%A0%80");
    copy("\300\257\xff/", "%C0%AF%FF/");
    assert_false(saga_utf8_is("caf\351"));
    assert_false(saga_utf8_is("\303"));
}

/* If a name of at most 63 bytes has 61 letters, the next character must be kept
 * whole or dropped. */
TEST(foreign_text_should_not_act_on_what_shows_it)
{
    saga_error error = { "" };

    copy("Z\303\274rich, \346\235\261", "Z\303\274rich, \346\235\261");
    copy("\033]0;x\a\177", "%1B]0;x%07%7F");
    /* U+009B begins an escape sequence, U+202E turns the writing round, U+200B
     * has no width, U+2028 ends a line, U+E0041 is a tag. */
    copy("a\302\233b", "a%C2%9Bb");
    copy("a\342\200\256b\342\200\213\342\200\250",
         "a%E2%80%AEb%E2%80%8B%E2%80%A8");
    copy("\363\240\201\201", "%F3%A0%81%81");
    assert_false(
        saga_fail(&error, "a\033[2J.png", "give %s", "is %s", "\r\n\302\205"));
    assert_string_equal(error.message, "a%1B[2J.png: is %0D%0A%C2%85; give %s");
}

TEST(names_should_end_behind_a_character)
{
    static const char *const tail[] = { "\303\251", "\342\202\254",
                                        "\360\237\230\200", "\351", "\303" };
    static const size_t wanted[] = { 63, 61, 61, 61, 61 };
    char name[SAGA_NAME_NBYTES], text[80];

    for (size_t i = 0; i < sizeof tail / sizeof tail[0]; i++) {
        memset(text, 'x', 61);
        strcpy(text + 61, tail[i]);
        strcat(text, "end");
        saga_copy_name(name, text, strlen(text));
        assert_int_equal(strlen(name), wanted[i]);
        assert_true(saga_utf8_is(name));
    }
    saga_copy_name(name, "a/b,\n\177\351", 7);
    assert_string_equal(name, "a_b_%0A%7F%E9");
}

TEST(notes_should_be_text)
{
    char notes[SAGA_NOTES_NBYTES] = "";

    saga_note(notes, "%.4s: %d", "caf\303\251", 7);
    saga_note(notes, "%s", "caf\351");
    assert_string_equal(notes, "caf%C3: 7\ncaf%E9\n");
    while (strlen(notes) + 2 < sizeof notes)
        saga_note(notes, "%s", "\303\251\303\251\303\251\303\251\303\251x");
    assert_true(saga_utf8_is(notes));
}

/* Notes of one kind are one line; those of other kinds between them stay. */
TEST(notes_of_one_kind_should_be_one_line)
{
    static const char *const wanted[] = {
        "dark: c0 (-1); see\nx: y\n", "dark: c0 (-1), c1 (-1); see\nx: y\n",
        "dark: c0 (-1), c1 (-1), c2 (-1); see\nx: y\n",
        "dark: c0 (-1), c1 (-1), c2 (-1) and 1 more; see\nx: y\n",
        "dark: c0 (-1), c1 (-1), c2 (-1) and 2 more; see\nx: y\n"
    };
    static const saga_note_kind dark = { "dark: ", "; see" };
    static const saga_note_kind other = { "dark: ", "; look" };
    char notes[SAGA_NOTES_NBYTES] = "";

    for (int i = 0; i < 17; i++) {
        saga_note_each(notes, &dark, "c%d (-1)", i);
        if (i == 0)
            saga_note(notes, "x: y");
        if (i < 5)
            assert_string_equal(notes, wanted[i]);
    }
    assert_non_null(strstr(notes, "c2 (-1) and 14 more; see\nx: y\n"));
    saga_note_each(notes, &other, "c0");
    assert_non_null(strstr(notes, "x: y\ndark: c0; look\n"));
    /* A full buffer keeps its text. */
    while (strlen(notes) + 2 < sizeof notes)
        saga_note(notes, "%s", "0123456789");
    saga_note_each(notes, &other, "c1");
    assert_true(strlen(notes) < sizeof notes);
}

TEST(json_should_tell_when_a_value_is_missing)
{
    json_t *const o = json_object(), *const list = json_array();

    saga_json_watch();
    saga_json_set_value(o, "name", json_string("caf\303\251"));
    saga_json_append_item(list, json_integer(1));
    saga_json_merge_object(o, json_pack("{si}", "n", 1));
    assert_false(saga_json_lost());
    saga_json_set_value(o, "name", json_string("caf\351"));
    assert_true(saga_json_lost());
    saga_json_watch();
    assert_false(saga_json_lost());
    saga_json_append_item(list, json_pack("{ss}", "name", "caf\351"));
    assert_true(saga_json_lost());
    saga_json_watch();
    saga_json_merge_object(o, json_pack("{ss}", "name", "caf\351"));
    assert_true(saga_json_lost());
    assert_false(saga_json_starved());
    json_decref(o);
    json_decref(list);
}
