/* SPDX-License-Identifier: MIT
 *
 * The measurement of the still part of a capture whose pictures arrive in
 * parts.
 */
#include "still.h"
#include "testing.h"

enum { PIXELS = 6, PART = 20, PARTS = 3, ALL = PART * PARTS };

/* A part of a capture with two views. A pixel of the first view has a different
 * value in each frame; the second view has no picture. */
typedef struct {
    saga_capture capture;
    saga_source_view view[2];
    uint8_t rgb[2][PART][3 * PIXELS];
    uint8_t mask[PART][PIXELS];
    bool missing[PART];
} part;

static uint8_t value_at(int frame)
{
    return (uint8_t)(frame * 37 % 251);
}

static const saga_capture *make_part(part *p, int number)
{
    memset(p, 0, sizeof *p);
    p->capture = (saga_capture){
        .n_views = 2, .n_frames = PART, .fps = 24, .views = p->view
    };
    memset(p->missing, 1, sizeof p->missing);
    for (int v = 0; v < 2; v++)
        p->view[v] = (saga_source_view){ .width = PIXELS,
                                         .height = 1,
                                         .rgb = p->rgb[v][0] };
    p->view[0].mask = p->mask[0];
    p->view[1].missing = p->missing;
    p->view[1].n_missing = PART;
    for (int f = 0; f < PART; f++) {
        memset(p->rgb[0][f], 90, sizeof p->rgb[0][f]);
        memset(p->rgb[0][f], value_at(number * PART + f), 3);
        /* One pixel counts only in the last part, one never counts. */
        memset(p->mask[f], 1, PIXELS);
        p->mask[f][4] = number == PARTS - 1;
        p->mask[f][5] = 0;
    }
    return &p->capture;
}

/* Adds all parts, whose pictures are in a file if there is a folder. */
static void add_parts_with(saga_still *s, const char *folder)
{
    *s = (saga_still){ .folder = folder };
    for (int i = 0; i < PARTS; i++) {
        part p;

        (void)make_part(&p, i);
        p.capture.pixels.at = folder ? p.rgb[0][0] : NULL;
        assert_done(saga_still_add(s, &p.capture, i * PART, ALL, &error));
    }
}

static void add_parts(saga_still *s)
{
    add_parts_with(s, NULL);
}

static int compare(const void *a, const void *b)
{
    return *(const uint8_t *)a - *(const uint8_t *)b;
}

/* The samples must be fifteen of the 60 frames: 2, 6, 10, ..., which are the
 * middles of fifteenths. */
TEST(still_should_be_the_median_over_all_parts)
{
    FREED_BY(saga_capture_free) saga_capture c;
    saga_still s;
    uint8_t seen[SAGA_STILL_PICTURES];

    add_parts(&s);
    assert_done(saga_still_finish(&c, &s, &error));
    assert_null(s.capture.views);
    for (int i = 0; i < SAGA_STILL_PICTURES; i++)
        seen[i] = value_at(4 * i + 2);
    qsort(seen, sizeof seen, 1, compare);
    assert_int_equal(c.n_frames, 1);
    assert_int_equal(c.n_views, 2);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(c.views[0].rgb[k], seen[SAGA_STILL_PICTURES / 2]);
        assert_int_equal(c.views[0].rgb[3 + k], 90);
    }
}

/* A pixel must count as still although some of the fifteen pictures differ. */
TEST(still_should_count_what_is_steady)
{
    enum { N = SAGA_STILL_PICTURES };

    for (int others = 0; others < 8; others++)
        for (int level = 8; level < 10; level++) {
            uint8_t rgb[N][3 * PIXELS];
            saga_source_view view = { .width = PIXELS,
                                      .height = 1,
                                      .rgb = rgb[0] };
            const saga_capture whole = { .n_views = 1,
                                         .n_frames = N,
                                         .views = &view };
            saga_still s = { .n = 0 };
            FREED_BY(saga_capture_free) saga_capture c;

            memset(rgb, 90, sizeof rgb);
            for (int f = 0; f < others; f++)
                rgb[2 * f][3 * (PIXELS - 1) + 1] = (uint8_t)(90 - level);
            assert_done(saga_still_add(&s, &whole, 0, N, &error));
            assert_done(saga_still_finish(&c, &s, &error));
            assert_int_equal(c.views[0].mask != NULL, level > 8 && others > 3);
            if (c.views[0].mask) {
                assert_int_equal(c.views[0].mask[0], 1);
                assert_int_equal(c.views[0].mask[PIXELS - 1], 0);
            }
        }
}

TEST(still_should_know_what_nobody_saw)
{
    static const uint8_t counts[PIXELS] = { 0, 1, 1, 1, 1, 0 };
    FREED_BY(saga_capture_free) saga_capture c;
    saga_still s;

    add_parts(&s);
    assert_done(saga_still_finish(&c, &s, &error));
    assert_memory_equal(c.views[0].mask, counts, sizeof counts);
    assert_true(saga_capture_has(&c, 0, 0));
    assert_false(saga_capture_has(&c, 1, 0));
    assert_int_equal(c.views[1].n_missing, 1);
}

/* If a part's pictures are in a file, so must be those that are taken of it.
 * Only the medians are in memory at the end, and only these are counted. */
TEST(still_should_take_pictures_to_a_file)
{
    FREED_BY(saga_capture_free) saga_capture c, in_memory;
    const size_t n = SAGA_STILL_PICTURES * PIXELS;
    saga_still s;

    add_parts(&s);
    assert_null(s.file.at);
    assert_done(saga_still_finish(&in_memory, &s, &error));
    add_parts_with(&s, "/tmp");
    assert_non_null(s.file.at);
    assert_int_equal(s.file.nbytes, n * 4 + n * 3);
    assert_ptr_equal(s.capture.views[0].rgb, s.file.at);
    assert_ptr_equal(s.capture.views[0].mask, s.file.at + n * 3);
    assert_ptr_equal(s.capture.views[1].rgb, s.file.at + n * 4);
    saga_still_free(&s);
    add_parts_with(&s, "/tmp");
    assert_done(saga_still_finish(&c, &s, &error));
    assert_null(s.file.at);
    assert_null(c.pixels.at);
    assert_int_equal(c.picture_nbytes, PIXELS * 4 + PIXELS * 3);
    for (int v = 0; v < 2; v++)
        assert_memory_equal(c.views[v].rgb, in_memory.views[v].rgb, 3 * PIXELS);
    assert_memory_equal(c.views[0].mask, in_memory.views[0].mask, PIXELS);
}

TEST(still_should_refuse_other_views)
{
    saga_error error = { "" };
    saga_still s = { .n = 0 };
    part p;

    assert_true(saga_still_add(&s, make_part(&p, 0), 0, ALL, &error));
    p.capture.n_views = 1;
    assert_false(saga_still_add(&s, &p.capture, PART, ALL, &error));
    assert_non_null(strstr(error.message, "1 cameras have pictures"));
    saga_still_free(&s);
    assert_null(s.capture.views);
}
