/* SPDX-License-Identifier: MIT
 *
 * Dense layers are compared with a straightforward reference in int64, with
 * random rows and with the largest valid rows. Buffers have their exact size,
 * so that the sanitizers see every read and write past an end.
 */
#include "mlp.h"
#include "mlp_pairs.h"
#include "testing.h"

#define CANARIES 16
#define CANARY 0x5a5a
#define POINTS 9 /* largest batch: two fours and a one */

/* A layer with int16 weights, and with int8 weights if they fit: by rows, and
 * in the order that the layer needs. */
typedef struct {
    uint16_t n_in, n_out;
    int fits8;
    int16_t *row; /* (n_out, pad(n_in)) */
    int16_t *w16;
    int8_t *w8;
    int32_t *bias;
    uint8_t *shift;
    int16_t *x;       /* (POINTS, pad(n_in)) */
    int16_t *y;       /* (POINTS, pad(n_out)) and canaries */
    int16_t *want[2]; /* (POINTS, n_out); [1]: with ReLU */
} net;

static uint32_t random_bits(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*seed >> 32);
}

/* Returns a number lo..hi, almost uniformly distributed. */
static int32_t random_in(uint64_t *seed, int32_t lo, int32_t hi)
{
    const uint64_t span = (uint64_t)((int64_t)hi - lo) + 1;

    return (int32_t)(lo + (int64_t)(random_bits(seed) * span >> 32));
}

static net net_new(uint32_t n_in, uint32_t n_out, int fits8)
{
    const size_t pad = saga_mlp_pad(n_in);
    net n;

    n.n_in = (uint16_t)n_in;
    n.n_out = (uint16_t)n_out;
    n.fits8 = fits8;
    n.row = zeroed(pad * n_out, sizeof *n.row);
    n.w16 = zeroed(pad * n_out, sizeof *n.w16);
    n.w8 = zeroed(pad * n_out, sizeof *n.w8);
    n.bias = zeroed(n_out, sizeof *n.bias);
    n.shift = zeroed(n_out, sizeof *n.shift);
    n.x = zeroed(POINTS * pad, sizeof *n.x);
    n.y = zeroed(POINTS * saga_mlp_pad(n_out) + CANARIES, sizeof *n.y);
    n.want[0] = zeroed(POINTS * n_out, sizeof **n.want);
    n.want[1] = zeroed(POINTS * n_out, sizeof **n.want);
    return n;
}

static void net_free(net *n)
{
    free(n->row);
    free(n->w16);
    free(n->w8);
    free(n->bias);
    free(n->shift);
    free(n->x);
    free(n->y);
    free(n->want[0]);
    free(n->want[1]);
}

static saga_cpu cpu;

static saga_layer net_layer(const net *n, int int8, int relu)
{
    saga_layer layer;

    layer.weight = int8 ? (const void *)n->w8 : n->w16;
    layer.bias = n->bias;
    layer.shift = n->shift;
    layer.n_in = n->n_in;
    layer.n_out = n->n_out;
    layer.int8 = (uint8_t)int8;
    layer.relu = (uint8_t)relu;
    layer.cpu = cpu;
    return layer;
}

static int16_t *row_of(const net *n, uint32_t row)
{
    return n->row + (size_t)row * saga_mlp_pad(n->n_in);
}

static void place_weights(net *n)
{
    for (uint32_t row = 0; row < n->n_out; row++) {
        const int16_t *const w = row_of(n, row);

        for (uint32_t k = 0; k < saga_mlp_pad(n->n_in); k++) {
            const size_t at = saga_mlp_weight_at(n->n_in, n->n_out, row, k);

            if (n->fits8)
                assert_in_range(w[k] + 127, 0, 254);
            n->w16[at] = w[k];
            n->w8[at] = (int8_t)w[k];
        }
    }
}

static int64_t row_abs_sum(const net *n, uint32_t row)
{
    const int16_t *const w = row_of(n, row);
    int64_t sum = 0;

    for (uint32_t k = 0; k < n->n_in; k++)
        sum += abs(w[k]);
    return sum;
}

/* Returns the largest |bias| that leaves the row valid. */
static int64_t row_room(const net *n, uint32_t row)
{
    const int64_t half = n->shift[row] ? (int64_t)1 << (n->shift[row] - 1) : 0;

    return INT32_MAX - half - row_abs_sum(n, row) * 32767;
}

static int64_t product(const net *n, uint32_t point, uint32_t row)
{
    const int16_t *const x = n->x + point * saga_mlp_pad(n->n_in);
    const int16_t *const w = row_of(n, row);
    int64_t sum = 0;

    for (uint32_t k = 0; k < n->n_in; k++)
        sum += (int64_t)w[k] * x[k];
    return sum;
}

static int16_t reference(const net *n, uint32_t point, uint32_t row, int relu)
{
    const int shift = n->shift[row];
    int64_t sum = n->bias[row] + product(n, point, row);

    if (shift > 0)
        sum = (sum + ((int64_t)1 << (shift - 1))) >> shift;
    if (relu && sum < 0)
        return 0;
    return (int16_t)(sum > 32767 ? 32767 : sum < -32767 ? -32767 : sum);
}

static void find_references(net *n)
{
    for (int relu = 0; relu < 2; relu++)
        for (uint32_t point = 0; point < POINTS; point++)
            for (uint32_t row = 0; row < n->n_out; row++)
                n->want[relu][point * n->n_out + row] = reference(n, point, row,
                                                                  relu);
}

static void assert_untouched(const int16_t *y, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        assert_int_equal(y[i], CANARY);
}

/* Runs a layer, which must give the expected outputs and must not change values
 * after n_out, nor points after the last. */
static void check_points(net *n, int int8, int relu, uint32_t points)
{
    const uint32_t stride = saga_mlp_pad(n->n_out);
    const uint32_t size = POINTS * stride + CANARIES;
    const saga_layer layer = net_layer(n, int8, relu);

    for (uint32_t i = 0; i < size; i++)
        n->y[i] = CANARY;
    saga_mlp_layer(n->y, &layer, n->x, points);
    for (uint32_t i = 0; i < points; i++) {
        assert_memory_equal(n->y + i * stride, n->want[relu] + i * n->n_out,
                            n->n_out * sizeof *n->y);
        assert_untouched(n->y + i * stride + n->n_out, stride - n->n_out);
    }
    assert_untouched(n->y + points * stride, size - points * stride);
}

static void check_variant(net *n, int int8, int relu)
{
    find_references(n);
    for (uint32_t points = 0; points <= POINTS; points++)
        check_points(n, int8, relu, points);
}

/* Checks the code for machines without SIMD, which exists on every machine. */
static void check_pairs(const net *n, const void *rows, int int8)
{
    saga_layer layer = net_layer(n, int8, 0);
    saga_pairs p;

    layer.weight = rows;
    for (uint32_t points = 1; points <= 2; points++)
        for (uint32_t row = 0; row < n->n_out; row += p.n_row) {
            p.n_row = n->n_out - row;
            p.n_row = p.n_row < SAGA_MLP_PAIRED ? p.n_row : SAGA_MLP_PAIRED;
            sum_pairs(&p, &layer, n->x, row, points);
            for (uint32_t i = 0; i < points; i++)
                for (uint32_t r = 0; r < p.n_row; r++)
                    assert_int_equal(p.sum[i][r], product(n, i, row + r));
        }
}

static void check_both_pairs(const net *n)
{
    const size_t size = (size_t)n->n_out * saga_mlp_pad(n->n_in);
    FREED int8_t *const narrow = zeroed(size, 1);

    check_pairs(n, n->row, 0);
    for (size_t i = 0; i < size; i++)
        narrow[i] = (int8_t)n->row[i];
    if (n->fits8)
        check_pairs(n, narrow, 1);
}

static void check(net *n)
{
    place_weights(n);
    for (uint32_t row = 0; row < n->n_out; row++)
        assert_true(saga_mlp_row_is_valid(row_abs_sum(n, row), n->bias[row],
                                          n->shift[row]));
    check_variant(n, 0, 0);
    check_variant(n, 0, 1);
    check_both_pairs(n);
    if (!n->fits8)
        return;
    check_variant(n, 1, 0);
    check_variant(n, 1, 1);
}

/* Fills a layer with random weights, shrunk until each row is valid, and a
 * random bias. */
static void fill_random(net *n, uint64_t *seed)
{
    for (uint32_t row = 0; row < n->n_out; row++) {
        const int32_t top = n->fits8 ? 127 : random_in(seed, 1, 32767);
        int16_t *const w = row_of(n, row);
        int32_t room;

        n->shift[row] = (uint8_t)random_in(seed, 0, 24);
        for (uint32_t k = 0; k < n->n_in; k++)
            w[k] = (int16_t)random_in(seed, -top, top);
        while (row_room(n, row) < 0)
            for (uint32_t k = 0; k < n->n_in; k++)
                w[k] /= 2;
        room = (int32_t)row_room(n, row);
        n->bias[row] = random_in(seed, -room, room);
        if (random_bits(seed) & 1u)
            n->bias[row] /= 65536;
    }
}

/* Fills the inputs with random values, also after n_in, where they must not
 * count. */
static void fill_x(net *n, uint64_t *seed, int32_t top)
{
    for (uint32_t k = 0; k < POINTS * saga_mlp_pad(n->n_in); k++)
        n->x[k] = (int16_t)random_in(seed, -top, top);
}

/* Makes every row as large as is valid: weights have the sign of x and the
 * largest magnitude, and the bias takes the rest. The sum, the bias and the
 * rounding constant of row 0 are 2^31 - 1, of row 1 -(2^31 - 1) + 2^shift, and
 * so on. */
static void fill_largest(net *n)
{
    const int32_t top = n->fits8 ? 127 : 32767;

    for (uint32_t row = 0; row < n->n_out; row++) {
        int16_t *const w = row_of(n, row);
        const int sign = row & 1u ? -1 : 1;
        int64_t left;

        n->shift[row] = (uint8_t)(row % 25);
        memset(w, 0, n->n_in * sizeof *w);
        left = row_room(n, row) / 32767;
        for (uint32_t k = 0; k < n->n_in; k++) {
            const int32_t v = (int32_t)(left < top ? left : top);

            w[k] = (int16_t)(n->x[k] < 0 ? -sign * v : sign * v);
            left -= v;
        }
        n->bias[row] = (int32_t)(sign * row_room(n, row));
    }
}

static const uint16_t sizes_in[] = { 0,  1,  2,  15, 16,  17,  31,  32, 33,
                                     48, 63, 64, 65, 100, 128, 511, 512 };
static const uint16_t sizes_out[] = { 0,  1,  2,  3,  4,  5,  7,  8,   15, 16,
                                      17, 24, 31, 63, 64, 65, 67, 128, 131 };

#define COUNT(a) (sizeof(a) / sizeof(a)[0])

/* Each weight must have a place of its own, and all places must be used. */
TEST(weights_should_have_a_place_each)
{
    size_t at;

    for (size_t i = 0; i < COUNT(sizes_in); i++)
        for (size_t j = 0; j < COUNT(sizes_out); j++) {
            const uint32_t n = saga_mlp_pad(sizes_in[i]);
            FREED uint8_t *const taken = zeroed((size_t)n * sizes_out[j], 1);

            for (uint32_t row = 0; row < sizes_out[j]; row++)
                for (uint32_t k = 0; k < n; k++) {
                    at = saga_mlp_weight_at(sizes_in[i], sizes_out[j], row, k);
                    assert_true(at < (size_t)n * sizes_out[j]);
                    assert_int_equal(taken[at]++, 0);
                }
        }
}

TEST(layer_should_match_the_reference_for_all_sizes)
{
    uint64_t seed = 1;

    for (size_t i = 0; i < COUNT(sizes_in); i++) {
        for (size_t j = 0; j < COUNT(sizes_out); j++) {
            for (int fits8 = 0; fits8 < 2; fits8++) {
                net n = net_new(sizes_in[i], sizes_out[j], fits8);

                fill_random(&n, &seed);
                fill_x(&n, &seed, 32767);
                check(&n);
                fill_x(&n, &seed, 300);
                check(&n);
                net_free(&n);
            }
        }
    }
}

TEST(layer_should_not_overflow_on_the_largest_valid_rows)
{
    for (size_t i = 0; i < COUNT(sizes_in); i++) {
        for (int fits8 = 0; fits8 < 2; fits8++) {
            FREED_BY(net_free) net n = net_new(sizes_in[i], 50, fits8);

            for (int pattern = 0; pattern < 3; pattern++) {
                for (uint32_t k = 0; k < POINTS * saga_mlp_pad(n.n_in); k++)
                    n.x[k] = pattern == 0 || (pattern == 2 && k % 3 == 0)
                                 ? 32767
                                 : -32767;
                fill_largest(&n);
                check(&n);
            }
        }
    }
}

TEST(row_should_be_valid_up_to_exactly_the_bound)
{
    for (int shift = 0; shift <= 24; shift++) {
        const int64_t half = shift ? (int64_t)1 << (shift - 1) : 0;

        for (int64_t sum = 0; sum <= 65538; sum += sum < 65000 ? 499 : 1) {
            const int64_t room = INT32_MAX - half - sum * 32767;

            assert_int_equal(saga_mlp_row_is_valid(sum, room, shift),
                             room >= 0);
            assert_int_equal(saga_mlp_row_is_valid(sum, -room, shift),
                             room >= 0);
            assert_false(saga_mlp_row_is_valid(sum, room + 1, shift));
            assert_false(saga_mlp_row_is_valid(sum, -room - 1, shift));
            assert_int_equal(saga_mlp_row_is_valid(sum, 0, shift), room >= 0);
        }
        assert_false(saga_mlp_row_is_valid(65539, 0, shift));
    }
}

TEST(row_should_be_refused_whatever_the_nonsense)
{
    assert_true(saga_mlp_row_is_valid(0, 0, 0));
    assert_true(saga_mlp_row_is_valid(0, INT32_MAX, 0));
    assert_true(saga_mlp_row_is_valid(0, -INT32_MAX, 0));
    assert_false(saga_mlp_row_is_valid(0, INT32_MIN, 0));
    assert_false(saga_mlp_row_is_valid(0, 0, -1));
    assert_false(saga_mlp_row_is_valid(0, 0, 25));
    assert_false(saga_mlp_row_is_valid(0, 0, INT32_MAX));
    assert_false(saga_mlp_row_is_valid(0, 0, INT32_MIN));
    assert_false(saga_mlp_row_is_valid(-1, 0, 0));
    assert_false(saga_mlp_row_is_valid(INT64_MIN, 0, 0));
    assert_false(saga_mlp_row_is_valid(INT64_MAX, 0, 0));
    assert_false(saga_mlp_row_is_valid((int64_t)1 << 32, 0, 0));
    assert_false(saga_mlp_row_is_valid(0, INT64_MAX, 0));
    assert_false(saga_mlp_row_is_valid(0, INT64_MIN, 0));
    assert_false(saga_mlp_row_is_valid(0, (int64_t)1 << 32, 0));
}

int main(void)
{
    int failed = 0;

    for (cpu = SAGA_CPU_PLAIN; cpu <= saga_cpu_best(); cpu++)
        if (cpu != SAGA_CPU_X4)
            failed += testing_run();
    return failed;
}
