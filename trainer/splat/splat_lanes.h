/* SPDX-License-Identifier: MIT
 *
 * Neighbouring primitives in the lanes of vectors. Rows of `width` numbers, one
 * for each primitive, become `width` columns, and back. The width is a constant
 * where these functions are called: 1, 3, 4 or 9.
 */
#ifndef SAGA_SPLAT_LANES_H
#define SAGA_SPLAT_LANES_H

#include "threads.h"
#include "vec.h"

#include <stddef.h>

enum { LANES_WIDEST = 9 }; /* largest width */

/* Primitives first to first + n - 1; n is VEC_LANES but at the end of a
 * range. */
typedef struct lanes {
    size_t first;
    size_t n;
} lanes;

/* Returns the lanes of a range from primitive i on. */
static inline lanes lanes_from(saga_range of, size_t i)
{
    return (lanes){ i, of.end - i < VEC_LANES ? of.end - i : VEC_LANES };
}

#if defined __AVX2__ && !defined SAGA_REAL_DOUBLE
#define LANES_BY_FOUR

/* Exchanges rows and columns of four rows of four, in both halves. */
static inline void lanes_turn(__m256 to[4], const __m256 from[4])
{
    const __m256 a = _mm256_unpacklo_ps(from[0], from[1]);
    const __m256 b = _mm256_unpackhi_ps(from[0], from[1]);
    const __m256 c = _mm256_unpacklo_ps(from[2], from[3]);
    const __m256 d = _mm256_unpackhi_ps(from[2], from[3]);

    to[0] = _mm256_shuffle_ps(a, c, 0x44);
    to[1] = _mm256_shuffle_ps(a, c, 0xee);
    to[2] = _mm256_shuffle_ps(b, d, 0x44);
    to[3] = _mm256_shuffle_ps(b, d, 0xee);
}

/* Sets four columns from the numbers at `row` and at every width-th after it; a
 * width of 3 has three of them. These are read as four, but in the last row. */
static inline void lanes_get_four(vec c[4], const real *row, size_t width)
{
    const real *const last = row + 7 * width;
    __m128 half[8];
    __m256 r[4], t[4];

    for (size_t l = 0; l < 7; l++)
        half[l] = _mm_loadu_ps(row + l * width);
    half[7] = width == 3 ? _mm_castsi128_ps(_mm_srli_si128(
                               _mm_castps_si128(_mm_loadu_ps(last - 1)), 4))
                         : _mm_loadu_ps(last);
    for (size_t l = 0; l < 4; l++)
        r[l] = _mm256_set_m128(half[4 + l], half[l]);
    lanes_turn(t, r);
    for (size_t k = 0; k < 4; k++)
        c[k] = (vec)t[k];
}

/* Writes four columns; of a width of 3 three, where the fourth number of a row
 * is the first of the next one, which is written after it. */
static inline void lanes_set_four(real *row, size_t width, const vec c[4])
{
    real *const last = row + 7 * width;
    const __m256 t[4] = { (__m256)c[0], (__m256)c[1], (__m256)c[2],
                          (__m256)c[3] };
    __m256 r[4];
    __m128 end;

    lanes_turn(r, t);
    for (size_t l = 0; l < 4; l++)
        _mm_storeu_ps(row + l * width, _mm256_castps256_ps128(r[l]));
    for (size_t l = 4; l < 7; l++)
        _mm_storeu_ps(row + l * width, _mm256_extractf128_ps(r[l - 4], 1));
    end = _mm256_extractf128_ps(r[3], 1);
    if (width == 3) {
        _mm_storel_pi((__m64 *)(void *)last, end);
        _mm_store_ss(last + 2, _mm_movehl_ps(end, end));
    } else {
        _mm_storeu_ps(last, end);
    }
}

#endif

/* Returns column k of the rows. Lanes beyond the last primitive repeat it. */
static inline vec lanes_column(const real *rows, size_t width, size_t k,
                               lanes at)
{
    const real *const row = rows + width * at.first + k;
    vec v = vec_zero();

    if (width == 1 && at.n == VEC_LANES)
        return vec_load(row);
    for (size_t l = 0; l < VEC_LANES; l++)
        v[l] = row[width * (l < at.n ? l : at.n - 1)];
    return v;
}

static inline void lanes_set_column(real *rows, size_t width, size_t k,
                                    lanes at, vec v)
{
    real *const row = rows + width * at.first + k;

    if (width == 1 && at.n == VEC_LANES) {
        vec_store(row, v);
        return;
    }
    for (size_t l = 0; l < at.n; l++)
        row[width * l] = v[l];
}

/* Sets columns from the rows of the primitives. */
static inline void lanes_get_rows(vec *columns, const real *rows, size_t width,
                                  lanes at)
{
    size_t k = 0;

#ifdef LANES_BY_FOUR
    for (; at.n == VEC_LANES && k + 3 <= width; k += 4) {
        vec c[4];

        lanes_get_four(c, rows + width * at.first + k, width);
        for (size_t j = 0; j < 4 && k + j < width; j++)
            columns[k + j] = c[j];
    }
#endif
    for (; k < width; k++)
        columns[k] = lanes_column(rows, width, k, at);
}

static inline void lanes_set_rows(real *rows, size_t width, lanes at,
                                  const vec *columns)
{
    size_t k = 0;

#ifdef LANES_BY_FOUR
    for (; at.n == VEC_LANES && k + 3 <= width; k += 4) {
        vec c[4] = { vec_zero(), vec_zero(), vec_zero(), vec_zero() };

        for (size_t j = 0; j < 4 && k + j < width; j++)
            c[j] = columns[k + j];
        lanes_set_four(rows + width * at.first + k, width, c);
    }
#endif
    for (; k < width; k++)
        lanes_set_column(rows, width, k, at, columns[k]);
}

/* Adds columns to the rows of the primitives that the mask has. */
static inline void lanes_add_rows(real *rows, size_t width, lanes at, veci mask,
                                  const vec *columns)
{
    vec sums[LANES_WIDEST];

    lanes_get_rows(sums, rows, width, at);
    for (size_t k = 0; k < width; k++)
        sums[k] += vec_and(mask, columns[k]);
    lanes_set_rows(rows, width, at, sums);
}

/* The same for one number of each primitive. */
static inline vec lanes_get(const real *values, lanes at)
{
    return lanes_column(values, 1, 0, at);
}

static inline void lanes_set(real *values, lanes at, vec v)
{
    lanes_set_column(values, 1, 0, at, v);
}

static inline void lanes_add(real *values, lanes at, veci mask, vec v)
{
    lanes_add_rows(values, 1, at, mask, &v);
}

#endif
