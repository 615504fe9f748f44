/* SPDX-License-Identifier: MIT
 *
 * A damaged stream must give a status, and never a crash or an endless loop.
 * The damage follows from a stream's number alone: SAGA_TEST_SEED is the first
 * number, SAGA_TEST_COUNT the count of streams; SAGA_TEST_VERBOSE=1 prints each
 * number before it is played.
 *
 * Damage that is not signed must be noticed. That is, saga_open and saga_find
 * may both accept a head only if it equals the original's head byte by byte
 * (saga_open alone does not read the index); and saga_decode may accept a
 * segment only if its bytes are those of one of the original's segments (the
 * index says which). Bytes that are never passed to the decoder, such as those
 * after the last segment, may have any value.
 *
 * Damage that is signed, with new CRCs, may give another valid stream.
 */
#include "gen_mutate.h"
#include "testing.h"

#include <time.h>
#include <unistd.h>

enum {
    PER_BASE = 64,       /* streams made of one base */
    BASE_NBYTES = 12000, /* the most bytes of a base that is not drawn */
    WALL_SECONDS = 120,  /* limit for one stream, then the program ends */
    CPU_SECONDS = 20
};

/* --- Bases --------------------------------------------------------------- */

typedef struct {
    uint64_t number;
    uint8_t *bytes;
    size_t n;
    saga_info info;
    saga_segment segment[GEN_MAX_SEGMENTS];
} base;

static void find_segments(base *b)
{
    uint32_t frame = 0;

    assert_ok(saga_probe(&b->info, b->bytes, b->n));
    assert_true(b->info.n_segments <= GEN_MAX_SEGMENTS);
    for (uint32_t i = 0; i < b->info.n_segments; i++) {
        assert_ok(saga_find(&b->segment[i], b->bytes, b->n, frame, 1));
        frame += b->segment[i].n_frames;
    }
}

/* Returns whether a stream is too large. Random weights take about a byte each,
 * so a stream with more weights than a base has bytes need not be coded. */
static int is_too_large(const gen_stream *g)
{
    size_t n_weights = 0;

    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_net_shape s;

        saga_model_net(&s, &g->header.model, net);
        for (int i = 0; i < s.n_layers; i++)
            n_weights += (size_t)s.dim[i] * s.dim[i + 1];
    }
    return n_weights > BASE_NBYTES;
}

/* Makes a small stream of one of several kinds: with pictures, with anything,
 * with outputs at the limits. */
static void make_base(base *b, uint64_t number)
{
    gen_options o = { 0 };
    uint64_t r = number;

    o.level = (int)(number & 1);
    o.n_coarse = 1 + (uint32_t)(number % 7);
    o.n_segments = number % 5 ? 1 : 2 + (uint32_t)(number % 2);
    o.picture = number % 3 == 0;
    o.bank = (int)(number / 2 % 3);
    o.no_fuse = (uint32_t)(number / 3 % 4);
    o.linear = number % 5 == 0;
    o.base = number % 3 == 1;
    o.classes = number % 5 < 3 ? 0 : 2 + (uint32_t)(number / 5 % 3);
    o.n_layers = number % 4 == 2 ? 2 + (uint32_t)(number / 4 % 2) : 1;
    if (!o.picture) {
        o.bank_slots = 32;
        o.bank_width = 8;
    }
    for (o.seed = 1000 * number;; o.seed++) {
        gen_stream g = gen_stream_make(&o);

        if (number % 4 == 1)
            mutate_extreme_nets(&g, &r);
        if (!o.picture && is_too_large(&g)) {
            gen_stream_free(&g);
            continue;
        }
        gen_stream_encode(&g, &b->bytes, &b->n);
        gen_stream_free(&g);
        if (o.picture || b->n <= BASE_NBYTES)
            break;
        free(b->bytes);
    }
    b->number = number;
    find_segments(b);
}

static void keep_base(base *b, uint64_t number)
{
    if (b->bytes && b->number == number)
        return;
    free(b->bytes);
    make_base(b, number);
}

/* --- One stream ---------------------------------------------------------- */

/* Returns the kind of damage. Most is done to segments, so that it reaches the
 * later stages of the decoder. */
static mutate_class class_of(uint64_t number)
{
    static const mutate_class classes[] = {
        MUTATE_RAW,        MUTATE_RAW_SIGNED,  MUTATE_IN_PRIM,
        MUTATE_IN_HEADER,  MUTATE_IN_FINE,     MUTATE_IN_NETWORKS,
        MUTATE_IN_COARSE,  MUTATE_IN_INDEX,    MUTATE_IN_PRIM,
        MUTATE_RAW_SIGNED, MUTATE_IN_FINE,     MUTATE_IN_COUNTS,
        MUTATE_IN_COARSE,  MUTATE_IN_NETWORKS, MUTATE_IN_ORDER,
        MUTATE_IN_HEADER,  MUTATE_IN_PRIM,     MUTATE_RAW,
        MUTATE_IN_FINE,    MUTATE_IN_BASE
    };

    return classes[number % (sizeof classes / sizeof *classes)];
}

/* Returns whether p is one of the original's segments, or its first layers. */
static int is_original_segment(const base *b, const uint8_t *p, size_t n)
{
    for (uint32_t i = 0; i < b->info.n_segments; i++)
        if ((b->segment[i].nbytes == n ||
             (b->info.n_layers > 1 && b->segment[i].nbytes > n)) &&
            memcmp(b->bytes + b->segment[i].offset, p, n) == 0)
            return 1;
    return 0;
}

/* Returns whether accepted bytes are those of the original. */
static int is_unchanged(const base *b, const mutate_result *result,
                        const uint8_t *bytes)
{
    if (result->head_nbytes == 0)
        return result->n_segments == 0;
    if (result->head_nbytes != b->info.head_nbytes ||
        memcmp(bytes, b->bytes, b->info.head_nbytes) != 0)
        return 0;
    for (uint32_t i = 0; i < result->n_segments; i++)
        if (!is_original_segment(b, bytes + result->segment[i].offset,
                                 result->segment[i].nbytes))
            return 0;
    return 1;
}

typedef struct {
    uint32_t count[MUTATE_N_CLASSES][MUTATE_N_STAGES];
    uint32_t unchanged;
    double slowest; /* CPU seconds */
    uint64_t slowest_number;
} table;

static void play(table *t, const base *b, uint64_t number)
{
    const mutate_class c = class_of(number);
    uint64_t r = number * 0x9e3779b97f4a7c15u;
    mutate_result result;
    size_t n;
    FREED uint8_t *const bytes = mutate_make(b->bytes, b->n, c, &r, &n);
    const clock_t start = clock();
    double seconds;

    alarm(WALL_SECONDS);
    mutate_play(&result, bytes, n, &r);
    alarm(0);
    seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    if (result.broken)
        fail_msg("stream %" PRIu64 ": not so: %s", number, result.broken);
    if (seconds > CPU_SECONDS)
        fail_msg("stream %" PRIu64 ": %.1f s", number, seconds);
    if (c == MUTATE_RAW && !is_unchanged(b, &result, bytes))
        fail_msg("stream %" PRIu64 ": damage not noticed", number);
    if (seconds > t->slowest) {
        t->slowest = seconds;
        t->slowest_number = number;
    }
    if (n == b->n && memcmp(bytes, b->bytes, n) == 0)
        t->unchanged++;
    else
        t->count[c][result.stage]++;
}

/* --- The report ---------------------------------------------------------- */

static uint32_t reached(const table *t, int c)
{
    return t->count[c][MUTATE_AT_VIEW] + t->count[c][MUTATE_DRAWN];
}

/* Checks that at least a tenth of all damaged streams reach reconstruction,
 * without counting those whose networks were changed but are valid. */
static void assert_depth(const table *t, uint32_t n)
{
    uint32_t segments = 0, networks = reached(t, MUTATE_IN_NETWORKS);

    for (int c = MUTATE_RAW_SIGNED; c < MUTATE_N_CLASSES; c++)
        segments += c == MUTATE_IN_NETWORKS ? 0 : reached(t, c);
    printf("reconstructed: %" PRIu32 " of %" PRIu32 ", and %" PRIu32
           " with damaged networks\n",
           segments, n, networks);
    if (n >= 1000) {
        assert_true(segments >= n / 10);
        assert_true(networks > 0);
    }
}

TEST(damaged_streams_should_only_give_a_status)
{
    const uint64_t seed = testing_seed(0);
    const uint32_t n = testing_count(1000, 10000);
    const int verbose = getenv("SAGA_TEST_VERBOSE") != NULL;
    table t = { 0 };
    base b = { 0 };

    printf("streams from %" PRIu64 ", %" PRIu32 " of them\n", seed, n);
    for (uint32_t i = 0; i < n; i++) {
        keep_base(&b, (seed + i) / PER_BASE);
        if (verbose) {
            printf("stream %" PRIu64 "\n", seed + i);
            fflush(stdout);
        }
        play(&t, &b, seed + i);
    }
    free(b.bytes);
    printf("unchanged %" PRIu32 ", slowest %.2f s (stream %" PRIu64 ")\n",
           t.unchanged, t.slowest, t.slowest_number);
    assert_depth(&t, n);
}

/* --- More ---------------------------------------------------------------- */

TEST(undamaged_streams_should_be_drawn)
{
    const uint32_t n = testing_long() ? 48 : 16;
    const uint64_t seed = testing_seed(0) / PER_BASE;
    uint64_t r = seed;

    for (uint32_t i = 0; i < n; i++) {
        mutate_result result;
        base b;

        make_base(&b, seed + i);
        mutate_play(&result, b.bytes, b.n, &r);
        if (result.broken)
            fail_msg("base %" PRIu64 ": not so: %s", seed + i, result.broken);
        assert_int_equal(result.stage, MUTATE_DRAWN);
        assert_int_equal(result.n_segments, b.info.n_segments);
        assert_true(is_unchanged(&b, &result, b.bytes));
        free(b.bytes);
    }
}

/* A changed bit in any byte of a file must be noticed, because a CRC covers
 * every byte; one in seven is changed here if the run is short. */
TEST(no_changed_byte_should_go_unnoticed)
{
    mutate_result result;
    uint64_t r = 5;
    base b;

    make_base(&b, 10);
    assert_true(b.info.n_segments > 1 && b.info.n_layers > 1);
    for (size_t i = 0; i < b.n; i += testing_long() ? 1 : 7) {
        b.bytes[i] ^= (uint8_t)(1u << i % 8);
        mutate_play(&result, b.bytes, b.n, &r);
        assert_null(result.broken);
        assert_int_not_equal(result.stage, MUTATE_DRAWN);
        assert_int_not_equal(result.status, SAGA_OK);
        b.bytes[i] ^= (uint8_t)(1u << i % 8);
    }
    free(b.bytes);
}

TEST(pieces_should_make_the_same_file_again)
{
    for (uint64_t i = 0; i < 8; i++) {
        mutate_file f;
        uint8_t *joined;
        size_t n;
        base b;

        make_base(&b, i);
        mutate_split(&f, b.bytes, b.n);
        joined = mutate_join(&f, &n);
        assert_int_equal(n, b.n);
        assert_memory_equal(joined, b.bytes, n);
        mutate_sign(joined, n);
        assert_memory_equal(joined, b.bytes, n);
        free(joined);
        mutate_free(&f);
        free(b.bytes);
    }
}
