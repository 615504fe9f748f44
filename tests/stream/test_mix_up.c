/* SPDX-License-Identifier: MIT
 *
 * A caller that confuses views, jobs, segments or files is refused, and nothing
 * is written outside of its place.
 */
#include "player.h"
#include "testing.h"

enum { SIDE = 64, TILE = 16, LIST = 64, FEW = 40, SLACK = 8 };

/* --- A file, a decoder, a picture ---------------------------------------- */

static const gen_options options = { .seed = 5,
                                     .level = 1,
                                     .n_coarse = 24,
                                     .n_segments = 2,
                                     .picture = 1,
                                     .tools_fixed = 1,
                                     .tools = 0 };

static void view(player *p, uint32_t camera, int32_t t)
{
    player_view(p, camera, t);
    assert_true(p->camera.width >= SIDE && p->camera.height >= SIDE);
}

/* Makes a player that shows segment 0. */
static void begin(player *p)
{
    player_make(p, &options);
    player_decode(p, 0);
    view(p, 0, 0);
}

typedef struct {
    saga_job job;
    saga_picture picture;
    _Alignas(8) uint8_t rgb[SIDE * SIDE * sizeof(saga_depth)];
    _Alignas(4) uint8_t scratch[SAGA_JOB_NBYTES(TILE, LIST) + SLACK];
} painter;

static void prepare(painter *a)
{
    memset(a, 0, sizeof *a);
    a->job.x1 = a->job.y1 = SIDE;
    a->job.tile = TILE;
    a->job.list_capacity = LIST;
    a->job.scratch = a->scratch;
    a->job.scratch_nbytes = sizeof a->scratch - SLACK;
    a->picture.rgb = a->rgb;
    a->picture.stride_nbytes = 3 * SIDE;
    a->picture.nbytes = sizeof a->rgb;
    a->picture.bits = 8;
}

static saga_status go_on(const player *p, painter *a, uint32_t budget)
{
    return saga_draw(p->dec, &a->job, &a->picture, budget);
}

static saga_status finish(const player *p, painter *a)
{
    saga_status s;

    do
        s = go_on(p, a, 1000);
    while (s == SAGA_AGAIN);
    return s;
}

/* Makes a player that shows segment 0, and gives b its whole picture. */
static void begin_drawn(player *p, painter *b)
{
    begin(p);
    prepare(b);
    assert_ok(finish(p, b));
}

/* Begins a job, which stays far from its end. */
static void begin_job(const player *p, painter *a)
{
    prepare(a);
    for (int i = 0; i < 20; i++)
        assert_int_equal(go_on(p, a, FEW), SAGA_AGAIN);
}

/* Checks that the job is refused and leaves the picture alone. A new job draws
 * it. */
static void assert_refused(const player *p, painter *a)
{
    uint8_t before[sizeof a->rgb];

    memcpy(before, a->rgb, sizeof before);
    assert_int_equal(go_on(p, a, FEW), SAGA_ERR_STATE);
    assert_int_equal(finish(p, a), SAGA_ERR_STATE);
    assert_memory_equal(a->rgb, before, sizeof before);
    memset(a->job.cursor, 0, sizeof a->job.cursor);
    assert_ok(finish(p, a));
}

/* --- Jobs ---------------------------------------------------------------- */

TEST(job_should_be_refused_when_the_view_is_another)
{
    FREED_BY(player_close) player p;
    painter a;

    begin(&p);
    begin_job(&p, &a);
    view(&p, 1, 30000);
    assert_refused(&p, &a);
    begin_job(&p, &a);
    view(&p, 1, 30000);
    assert_refused(&p, &a);
}

TEST(job_should_be_refused_when_the_segment_is_another)
{
    FREED_BY(player_close) player p;
    painter a;

    begin(&p);
    begin_job(&p, &a);
    player_decode(&p, 1);
    assert_int_equal(go_on(&p, &a, FEW), SAGA_ERR_STATE);
    view(&p, 0, 0);
    assert_refused(&p, &a);
}

/* A job of one decoder must be refused by another, even if both have prepared
 * the same number of views. */
TEST(job_should_be_refused_when_the_decoder_is_another)
{
    player p, q;
    painter a;

    begin(&p);
    begin(&q);
    player_decode(&p, 0);
    player_decode(&q, 1);
    view(&p, 0, 0);
    view(&q, 0, 0);
    begin_job(&p, &a);
    assert_refused(&q, &a);
    view(&p, 0, 5);
    player_decode(&q, 0);
    view(&q, 1, 5);
    begin_job(&p, &a);
    assert_refused(&q, &a);
    player_close(&p);
    player_close(&q);
}

/* Two segments with the same payload differ in nothing but their numbers. */
TEST(job_should_be_refused_when_the_segment_is_a_repetition)
{
    gen_stream g = gen_stream_make(&options);
    const saga_symbols second = g.segment[1];
    player p, q;
    painter a;

    g.segment[1] = g.segment[0];
    g.n_frames[1] = g.n_frames[0];
    player_open(&p, &g);
    player_open(&q, &g);
    g.segment[1] = second;
    gen_stream_free(&g);
    player_decode(&p, 0);
    player_decode(&q, 1);
    view(&p, 0, 0);
    view(&q, 0, 0);
    assert_memory_equal(p.report.final_range, q.report.final_range,
                        sizeof p.report.final_range);
    begin_job(&p, &a);
    assert_refused(&q, &a);
    player_close(&p);
    player_close(&q);
}

/* Nothing is read or written out of place (the sanitizers look), and the job
 * ends, even if two views have one digest. This test forges it. */
TEST(job_should_stay_in_bounds_when_digests_collide)
{
    enum { CROWDED = 40, NBYTES = 3 * SAGA_JOB_NBYTES(8, CROWDED) };
    FREED void *const scratch = must(malloc(NBYTES));
    player p, q;
    painter a, b;

    begin(&p);
    begin(&q);
    player_decode(&q, 1);
    for (uint32_t budget = 1; budget < 3000; budget += 7) {
        view(&p, 0, 0);
        view(&q, 0, 0);
        prepare(&b);
        b.job.tile = 8;
        b.job.list_capacity = CROWDED;
        b.job.scratch = scratch;
        b.job.scratch_nbytes = NBYTES;
        a = b;
        (void)go_on(&q, &b, 1);
        if (go_on(&p, &a, budget) != SAGA_AGAIN)
            break;
        memcpy(a.job.cursor + 1, b.job.cursor + 1, 2 * sizeof(uint32_t));
        (void)finish(&q, &a);
    }
    player_close(&p);
    player_close(&q);
}

TEST(job_should_be_refused_when_finished_for_another_view)
{
    FREED_BY(player_close) player p;
    painter a;

    begin(&p);
    prepare(&a);
    assert_ok(finish(&p, &a));
    assert_ok(finish(&p, &a));
    view(&p, 1, 0);
    assert_refused(&p, &a);
}

/* The fields that a job must keep, and values of which a new job could be. */
#define FIELD(member, value)                                              \
    {                                                                     \
        offsetof(painter, member), sizeof((painter *)0)->member, (value), \
    }
static const struct {
    size_t at, nbytes;
    uint64_t value;
} fields[] = { FIELD(job.x0, 8),
               FIELD(job.y0, TILE),
               FIELD(job.x1, SIDE - 8),
               FIELD(job.y1, SIDE - 1),
               FIELD(job.tile, TILE / 2),
               FIELD(job.list_capacity, 1),
               FIELD(job.list_capacity, LIST - 1),
               FIELD(job.scratch_nbytes, SAGA_JOB_NBYTES(TILE, LIST) + SLACK),
               FIELD(picture.bits, 16),
               FIELD(picture.bits, (uint32_t)SAGA_DEPTH),
               FIELD(job.scratch, 0) };
enum { N_FIELDS = sizeof fields / sizeof *fields };

/* The last field is the scratch, whose value is a place in the painter. */
static void change_field(painter *a, int i)
{
    const uint32_t narrow = (uint32_t)fields[i].value;

    if (i + 1 == N_FIELDS)
        a->job.scratch = a->scratch + SLACK;
    else
        memcpy((char *)a + fields[i].at,
               fields[i].nbytes == 4 ? (const void *)&narrow : &fields[i].value,
               fields[i].nbytes);
}

/* A job with a changed field must be refused. When the field has its old value
 * again, the job must go on and give the right picture. */
TEST(job_should_be_refused_when_its_fields_are_others)
{
    FREED_BY(player_close) player p;
    painter a, b;

    begin_drawn(&p, &b);
    for (int i = 0; i < N_FIELDS; i++) {
        painter before;

        begin_job(&p, &a);
        a.picture.stride_nbytes = SIDE * sizeof(saga_depth);
        before = a;
        change_field(&a, i);
        assert_int_equal(go_on(&p, &a, FEW), SAGA_ERR_STATE);
        assert_int_equal(go_on(&p, &a, FEW), SAGA_ERR_STATE);
        assert_memory_equal(a.rgb, before.rgb, sizeof a.rgb);
        assert_memory_equal(a.scratch, before.scratch, sizeof a.scratch);
        a.job = before.job;
        a.picture.bits = 8;
        a.picture.stride_nbytes = 3 * SIDE;
        assert_ok(finish(&p, &a));
        assert_memory_equal(a.rgb, b.rgb, sizeof a.rgb);
        change_field(&a, i);
        assert_int_equal(go_on(&p, &a, FEW), SAGA_ERR_STATE);
    }
}

/* The caller may pass another buffer for the rows that are not yet drawn. */
TEST(job_should_go_on_in_another_picture)
{
    FREED_BY(player_close) player p;
    painter a, b;

    begin_drawn(&p, &b);
    begin_job(&p, &a);
    memcpy(b.rgb + sizeof b.rgb / 2, a.rgb, sizeof b.rgb / 2);
    a.picture.rgb = b.rgb + sizeof b.rgb / 2;
    a.picture.nbytes = sizeof b.rgb / 2;
    assert_ok(finish(&p, &a));
    assert_memory_equal(b.rgb + sizeof b.rgb / 2, b.rgb, 3 * SIDE * SIDE);
}

/* After a view was refused, the previous view and its jobs must still work. */
TEST(job_should_go_on_when_a_view_was_refused)
{
    FREED_BY(player_close) player p;
    painter a, b;
    saga_camera c;
    uint32_t number;

    begin_drawn(&p, &b);
    begin_job(&p, &a);
    assert_ok(saga_rig(&c, &number, p.bytes, p.n, 0));
    assert_int_equal(saga_view(p.dec, &c, -1), SAGA_ERR_ARG);
    assert_int_equal(saga_view(p.dec, &c, 65536), SAGA_ERR_ARG);
    c.near_plane = 0;
    assert_int_equal(saga_view(p.dec, &c, 0), SAGA_ERR_ARG);
    assert_ok(finish(&p, &a));
    assert_memory_equal(a.rgb, b.rgb, sizeof a.rgb);
}

TEST(job_should_go_on_when_the_decoder_was_moved)
{
    player p, q;
    painter a, b;

    begin_drawn(&p, &b);
    begin_job(&p, &a);
    q = p;
    q.work = must(aligned_alloc(SAGA_WORK_ALIGN, p.info.work_nbytes));
    memcpy(q.work, p.work, p.info.work_nbytes);
    memset(p.work, 0, p.info.work_nbytes);
    q.dec = (saga_decoder *)(void *)q.work;
    assert_ok(finish(&q, &a));
    assert_memory_equal(a.rgb, b.rgb, sizeof a.rgb);
    free(q.work);
    player_close(&p);
}

TEST(budget_should_be_refused_when_0)
{
    FREED_BY(player_close) player p;
    painter a;

    begin(&p);
    prepare(&a);
    assert_int_equal(go_on(&p, &a, 0), SAGA_ERR_ARG);
    assert_int_equal(go_on(&p, &a, FEW), SAGA_AGAIN);
    assert_int_equal(go_on(&p, &a, 0), SAGA_ERR_ARG);
    assert_ok(finish(&p, &a));
}

/* --- The caller's memory ------------------------------------------------- */

/* Shows segment 0 from bytes that are freed as soon as a call returns. */
static void begin_without_bytes(player *p, const player *from)
{
    FREED uint8_t *const bytes = must(malloc(from->n));
    const saga_segment seg = from->seg;

    *p = *from;
    p->work = must(aligned_alloc(SAGA_WORK_ALIGN, p->info.work_nbytes));
    memcpy(bytes, from->bytes, from->n);
    assert_ok(saga_open(&p->dec, p->work, p->info.work_nbytes, bytes,
                        p->info.head_nbytes, NULL));
    memset(bytes, 0, p->info.head_nbytes);
    assert_ok(saga_decode(p->dec, &seg, bytes + seg.offset, seg.nbytes, NULL));
}

TEST(decoder_should_keep_no_pointer_to_the_bytes)
{
    FREED_BY(player_close) player p;
    FREED void *work = NULL;
    painter a, b;
    player q;

    begin_drawn(&p, &b);
    player_find(&p, 0);
    begin_without_bytes(&q, &p);
    work = q.work;
    assert_ok(saga_view(q.dec, &p.camera, 0));
    prepare(&a);
    assert_ok(finish(&q, &a));
    assert_memory_equal(a.rgb, b.rgb, sizeof a.rgb);
}

/* A block may be used again without closing anything. */
TEST(job_should_be_refused_when_the_block_has_another_film)
{
    gen_options other = options;
    FREED_BY(player_close) player p;
    FREED_BY(player_close) player q;
    saga_decoder *dec;
    painter a;

    other.seed = 6;
    begin(&p);
    player_make(&q, &other);
    begin_job(&p, &a);
    p.work = must(realloc(p.work, SAGA_WORK_MAX(1)));
    assert_int_equal((uintptr_t)p.work % SAGA_WORK_ALIGN, 0);
    assert_ok(saga_open(&dec, p.work, SAGA_WORK_MAX(1), q.bytes,
                        q.info.head_nbytes, NULL));
    q.seg = player_find(&q, 0);
    assert_int_equal(saga_draw(dec, &a.job, &a.picture, FEW), SAGA_ERR_STATE);
    assert_ok(
        saga_decode(dec, &q.seg, q.bytes + q.seg.offset, q.seg.nbytes, NULL));
    assert_int_equal(saga_draw(dec, &a.job, &a.picture, FEW), SAGA_ERR_STATE);
    assert_ok(saga_view(dec, &q.camera, 0));
    assert_int_equal(saga_draw(dec, &a.job, &a.picture, FEW), SAGA_ERR_STATE);
}

/* --- Segments ------------------------------------------------------------ */

TEST(segment_should_be_refused_when_another_is_named)
{
    saga_segment seg[2], wrong;
    FREED_BY(player_close) player p;

    player_make(&p, &options);
    seg[0] = player_find(&p, 0);
    seg[1] = player_find(&p, 1);
    for (int i = 0; i < 2; i++) /* first fewer bytes than the index states */
        assert_int_equal(saga_decode(p.dec, &seg[1 - i],
                                     p.bytes + seg[i].offset, seg[i].nbytes,
                                     NULL),
                         seg[i].nbytes < seg[1 - i].nbytes ? SAGA_ERR_TRUNCATED
                                                           : SAGA_ERR_DATA);
    for (int i = 0; i < 3; i++) {
        wrong = seg[0];
        *(i == 0   ? &wrong.number
          : i == 1 ? &wrong.first_frame
                   : &wrong.n_frames) += 1;
        assert_int_equal(saga_decode(p.dec, &wrong, p.bytes + wrong.offset,
                                     wrong.nbytes, NULL),
                         SAGA_ERR_DATA);
    }
    player_decode(&p, 0);
}

/* The segments of two files differ only in a field of the header, and each
 * would decode with the other's head. They must be refused nevertheless. */
TEST(segment_should_be_refused_when_of_another_file)
{
    player p, q;
    gen_stream g = gen_stream_make(&options);

    player_open(&p, &g);
    g.header.unit_exponent++;
    player_open(&q, &g);
    gen_stream_free(&g);
    assert_int_equal(p.n, q.n);
    for (uint32_t i = 0; i < 2; i++) {
        const saga_segment seg = player_find(&p, i);

        player_decode(&q, i);
        assert_int_equal(
            saga_decode(q.dec, &seg, p.bytes + seg.offset, seg.nbytes, NULL),
            SAGA_ERR_DATA);
    }
    player_close(&p);
    player_close(&q);
}
