/* SPDX-License-Identifier: MIT
 *
 * The inputs of networks: every value of every format is converted to every
 * input format and compared with fx_requant16, with canaries around the output.
 */
#include "fx.h"
#include "nets.h"
#include "testing.h"

enum { N = 37, AT = 3, Q_END = 25, CANARY = 0x5a5a };

static saga_nets nets;
static saga_vectors vectors;
static const saga_runner runner = { &nets, NULL, &vectors, SAGA_CPU_PLAIN,
                                    NULL };

static void one_run(int32_t first, int q, int q_in)
{
    int16_t x[N];

    for (uint32_t i = 0; i < N; i++)
        x[i] = (int16_t)(first + (int32_t)i);
    for (uint32_t i = 0; i < AT + N + 1; i++)
        vectors.in[i] = CANARY;
    nets.shape[SAGA_NET_GEO].q_in = (uint8_t)q_in;
    assert_int_equal(saga_in_vector(&runner, SAGA_NET_GEO, AT, x, N, q),
                     AT + N);
    for (uint32_t i = 0; i < N; i++)
        assert_int_equal(vectors.in[AT + i], fx_requant16(x[i], q, q_in));
    assert_int_equal(vectors.in[AT - 1], CANARY);
    assert_int_equal(vectors.in[AT + N], CANARY);
}

TEST(inputs_should_be_each_in_the_networks_format)
{
    for (int q = 0; q < Q_END; q++)
        for (int q_in = 0; q_in < Q_END; q_in++)
            for (int32_t first = -32768; first < 32768; first += N)
                one_run(first, q, q_in);
}
