/* SPDX-License-Identifier: MIT
 *
 * The choice of classes against costs that are computed here from the formulas:
 * a motion b under the weight w costs w b^2; an opacity that falls by
 * log2(e) (t / width)^2 costs its variance over the segment.
 */
#include "scene_model.h"
#include "start_state.h"
#include "testing.h"

enum { N = 40, MOVES = N - 2, FADES = N - 1 };

/* Primitives with anchors of their own, each of the weight 2. One moves by 0.1
 * along y in each age, and one fades with a width of a segment about its
 * middle. The others stand still. */
typedef struct {
    saga_coarse coarse[N];
    saga_fine fine[N];
    uint32_t prim_fine[N];
    float prim_x[4 * N], motion[9 * N], log2_width[N];
    double weight[5 * N]; /* opacity, width, motion of first order */
    saga_scene s;
    saga_splat_params target;
    saga_start x;
    saga_fit f;
} fixture;

static void begin(fixture *t)
{
    memset(t, 0, sizeof *t);
    for (uint32_t i = 0; i < N; i++) {
        t->prim_fine[i] = t->fine[i].parent = i;
        t->prim_x[4 * i + 3] = 0.5f;
        t->log2_width[i] = i == FADES ? 0 : 20;
    }
    t->motion[9 * MOVES + 1] = 0.1f;
    for (int i = 0; i < 5 * N; i++)
        t->weight[i] = 2;
    t->s = (saga_scene){ .n = { N, N, N },
                         .coarse = t->coarse,
                         .fine = t->fine,
                         .prim_fine = t->prim_fine,
                         .prim_x = t->prim_x };
    t->target.motion = t->motion;
    t->target.log2_width = t->log2_width;
    t->x = (saga_start){ .target = &t->target, .n = N, .d = 5 };
    t->x.weight = t->weight;
    t->x.width[SAGA_ATTR_OPACITY] = t->x.width[SAGA_ATTR_LOG2_WIDTH] = 1;
    t->x.width[SAGA_ATTR_MOTION] = 3;
    t->x.at[SAGA_ATTR_LOG2_WIDTH] = 1;
    t->x.at[SAGA_ATTR_MOTION] = 2;
    t->f.scene = &t->s;
}

/* Chooses with 1 / `bits` as the price of a bit, by which a cost of c is
 * c bits. Compares the number of still anchors and the classes of the last
 * two. */
static void expect(fixture *t, double bits, int still, int moves, int fades)
{
    int n = 0;

    t->f.o.price.residual = 1 / bits;
    assert_done(saga_start_choose_classes(&t->x, &t->f, &error));
    for (int i = 0; i < N; i++)
        n += t->coarse[i].class == SAGA_CLASS_STILL;
    assert_int_equal(n, still);
    assert_int_equal(t->coarse[MOVES].class, moves);
    assert_int_equal(t->coarse[FADES].class, fades);
}

TEST(classes_should_follow_the_cost_of_stillness)
{
    enum { STILL = SAGA_CLASS_STILL, MOVING = SAGA_CLASS_MOVING };
    /* 0.02 and 0.0231. The variance of (t / width)^2 for uniform t in +-1/2 is
     * 1 / 180. */
    const double moves = 2 * 0.1 * 0.1;
    const double fades = 2 / (M_LN2 * M_LN2) / 180;
    fixture t;

    begin(&t);
    /* A primitive may cost 200 bits. */
    expect(&t, 201 / moves, N - 2, MOVING, MOVING);
    expect(&t, 199 / moves, N - 1, STILL, MOVING);
    expect(&t, 201 / fades, N - 1, STILL, MOVING);
    expect(&t, 199 / fades, N, STILL, STILL);
    /* A target that is frozen has no motion. */
    t.target.motion = NULL;
    expect(&t, 201 / fades, N - 1, STILL, MOVING);
}

/* If all move slowly, each by 0.1, the limit is the 20 bits that they may cost
 * together. */
TEST(slow_motion_of_all_should_stay)
{
    const double each = 2 * 0.1 * 0.1;
    fixture t;

    begin(&t);
    t.log2_width[FADES] = 20;
    for (int i = 0; i < N; i++)
        t.motion[9 * i + 1] = 0.1f;
    expect(&t, 21 / each, 0, SAGA_CLASS_MOVING, SAGA_CLASS_MOVING);
    expect(&t, 19 / each, N, SAGA_CLASS_STILL, SAGA_CLASS_STILL);
}

/* A base has no primitives that move. An anchor with two primitives moves if
 * either does. */
TEST(classes_should_be_still_in_a_base_and_moving_for_both)
{
    fixture t;

    begin(&t);
    t.coarse[MOVES].class = SAGA_CLASS_MOVING;
    t.s.still = true;
    expect(&t, 1e9, N, SAGA_CLASS_STILL, SAGA_CLASS_STILL);
    t.s.still = false;
    t.prim_fine[MOVES] = 0;
    expect(&t, 1e9, N - 2, SAGA_CLASS_STILL, SAGA_CLASS_MOVING);
    assert_int_equal(t.coarse[0].class, SAGA_CLASS_MOVING);
}
