/* SPDX-License-Identifier: MIT
 *
 * The schedule of the fit: when rounding begins, which noise values get, when
 * the bank's reads are evaluated, and how fast each tensor learns.
 */
#include "fit_state.h"

#include <math.h>

/* Iterations until the full learning rate, while Adam's moments build up. */
enum { RAMP = 300 };

int saga_fit_first_rounding(const saga_fit *f)
{
    return (2 * f->o.n_render + 2) / 3;
}

bool saga_fit_is_rounding(const saga_fit *f)
{
    return f->iteration >= saga_fit_first_rounding(f);
}

/* The bank's reads are evaluated at intervals, and where rounding begins, since
 * the reads before belong to another choice of sources. */
bool saga_fit_is_remembering(const saga_fit *f)
{
    /* Without a kind that reads it, there is no bank. */
    return saga_rate_readers(&f->rate.context, f->scene) &&
           (f->iteration % SAGA_RATE_REMEMBER_EVERY == 0 ||
            f->iteration == saga_fit_first_rounding(f));
}

/* Returns a factor that falls from 1 at i = 0 to `last` at i = n - 1, along
 * half a cosine. */
static real decay(int i, int n, real last)
{
    const double x = n > 1 ? (double)i / (double)(n - 1) : 0;

    return (real)((double)last +
                  (1 - (double)last) * 0.5 * (1 + cos(M_PI * x)));
}

/* Returns the factor on the rate of the features of a film with `frames`
 * pictures of each view. The longer a film is, the rarer are the pictures that
 * show a primitive, since it lives in a part p of them. Adam divides by the
 * root mean square over all pictures, p^(1/2) times that of those which show
 * it, so that each of them moves it p^(-1/2) times as far. Features then jump
 * over several steps of their quantiser, which takes bits. */
static double for_length(double frames)
{
    return fmin(1, sqrt(SAGA_SHORT_FILM / frames));
}

/* Returns the rate of the features. A rendering longer than 2,400 iterations
 * can use up to twice the rate. Steps are taken along each block's own axes,
 * where 0.018 gains 0.1 dB over 0.012, the best rate along the coordinates;
 * 0.024 gains as much for more bytes. */
static real feature_rate(const saga_fit *f)
{
    const double longer = fmin(fmax(f->o.n_render / 2400.0, 1), 2);
    const double frames = saga_is_dynamic(&f->scene->model)
                              ? (double)f->pictures->n_there /
                                    f->pictures->n_train
                              : 1;

    return R(0.018 * longer * for_length(frames));
}

/* Once features are rounded against the means that the entropy networks
 * predict, entropy networks and steps are frozen: a weight that oscillated
 * between two multiples of its step would move all features with it. */
saga_fit_rates saga_fit_rates_now(const saga_fit *f)
{
    const int turn = f->iteration;
    const real ramp = turn < RAMP ? R(turn + 1) / RAMP : 1;
    const real rate = ramp * decay(turn, f->o.n_render, R(0.03));
    const bool learns = !f->o.given;
    const bool noisy = learns && !saga_fit_is_rounding(f);

    return (saga_fit_rates){ .feature = rate * feature_rate(f),
                             .prim = rate * R(0.0001),
                             .entropy = noisy ? rate * R(0.004) : 0,
                             .networks = learns ? rate * R(0.0016) : 0,
                             .steps = noisy ? rate * R(0.01) : 0 };
}

saga_rng saga_fit_noise(const saga_fit *f, uint64_t stream)
{
    return saga_rng_stream(f->o.seed ^ ((uint64_t)f->iteration << 20), stream);
}

saga_rate_options saga_fit_rate_options(const saga_fit *f)
{
    saga_rate_options o = { .rounding = saga_fit_is_rounding(f),
                            .seed = f->o.seed ^ ((uint64_t)f->iteration << 20),
                            .weight = (real)f->o.price.residual };

    /* A quarter of the blocks is evaluated as a sample. All blocks are
     * evaluated in iterations that evaluate the memory bank's reads again. */
    saga_rate_look(&o, f->iteration, saga_fit_is_remembering(f));
    return o;
}

real saga_fit_size_price(const saga_fit *f)
{
    return SAGA_FIT_SIZE_PRICE / R(f->scene->n.prim);
}
