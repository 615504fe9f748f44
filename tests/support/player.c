/* SPDX-License-Identifier: MIT
 *
 * See player.h.
 */
#include "player.h"

#include "testing.h"
#include "vectors.h"

void player_load(player *p, const gen_stream *g)
{
    gen_stream copy = *g;

    memset(p, 0, sizeof *p);
    gen_stream_encode(&copy, &p->bytes, &p->n);
    assert_ok(saga_probe(&p->info, p->bytes, p->n));
    p->work = must(aligned_alloc(SAGA_WORK_ALIGN, p->info.work_nbytes));
}

void player_open(player *p, const gen_stream *g)
{
    uint32_t number;

    player_load(p, g);
    assert_ok(saga_open(&p->dec, p->work, p->info.work_nbytes, p->bytes,
                        p->info.head_nbytes, NULL));
    assert_ok(saga_rig(&p->camera, &number, p->bytes, p->n, 0));
}

void player_make(player *p, const gen_options *o)
{
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(o);

    player_open(p, &g);
}

void player_close(player *p)
{
    free(p->work);
    free(p->bytes);
}

saga_segment player_find(player *p, uint32_t number)
{
    uint32_t frame = 0;

    do {
        assert_ok(saga_find(&p->seg, p->bytes, p->n, frame, 1));
        frame += p->seg.n_frames;
    } while (p->seg.number != number);
    return p->seg;
}

void player_decode(player *p, uint32_t number)
{
    const saga_segment seg = player_find(p, number);

    assert_ok(
        saga_decode(p->dec, &seg, p->bytes + seg.offset, seg.nbytes, NULL));
    assert_ok(saga_tell(&p->report, p->dec));
}

void player_view(player *p, uint32_t camera, int32_t t)
{
    uint32_t number;

    assert_ok(saga_rig(&p->camera, &number, p->bytes, p->n, camera));
    assert_ok(saga_view(p->dec, &p->camera, t));
    assert_ok(saga_tell(&p->report, p->dec));
}

saga_status player_draw(uint32_t *crc, const saga_decoder *dec,
                        const saga_camera *c)
{
    const size_t n = 3u * c->width * (size_t)c->height;
    FREED uint8_t *const pixels = must(calloc(n, 1));
    const saga_picture picture = { pixels, 3u * c->width, n, 8 };
    const saga_status s = saga_draw_whole(dec, c, &picture);

    *crc = saga_crc32c(0, pixels, n);
    return s;
}

void player_check_chunk(saga_status (*find)(const uint8_t *bytes, size_t n),
                        uint8_t *bytes, size_t n, const size_t chunk[2],
                        size_t more)
{
    for (size_t k = 0; k < chunk[1] + more; k++) {
        FREED uint8_t *const exact = must(malloc(k ? k : 1));

        memcpy(exact, bytes, k);
        assert_int_equal(find(exact, k), SAGA_ERR_TRUNCATED);
    }
    for (size_t i = 8 * chunk[0]; i < 8 * chunk[1]; i++) {
        const size_t at = i / 8 - chunk[0];
        saga_status s;

        bytes[i / 8] ^= (uint8_t)(1u << i % 8);
        s = find(bytes, n);
        /* A changed length may also run past the end. */
        assert_true(s == (at < 4 ? SAGA_ERR_ARG : SAGA_ERR_DATA) ||
                    (s == SAGA_ERR_TRUNCATED && at >= 4 && at < 8));
        bytes[i / 8] ^= (uint8_t)(1u << i % 8);
    }
}

saga_animated player_primitive(const player *p, uint32_t index, int32_t t)
{
    saga_animated a;

    assert_ok(saga_primitive_at(&a, p->dec, index, t));
    return a;
}

saga_splat player_splat(const player *p, uint32_t order)
{
    saga_splat s;

    assert_ok(saga_splat_at(&s, p->dec, order));
    return s;
}
