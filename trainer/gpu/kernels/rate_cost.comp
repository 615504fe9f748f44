/* SPDX-License-Identifier: MIT
 *
 * Bits of values and their gradients: entropy/rate_evaluate.c,
 * take_parameters() and parameters_backward(), and entropy/rate_loss.c,
 * add_block(). A thread for each channel of a row, which is for block
 * first + every row. The first four channels are of a position; then come
 * features. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "group.glsl"
#include "exp2_neg.glsl"
#include "rng.glsl"

layout(push_constant) uniform push_block
{
    uint n_rows;
    uint n_channels;
    uint first;
    uint every;
    uint learned;   /* the first channel that learns, and has a mu */
    uint rounds;    /* 1: values of positions are rounded */
    uint has_noise; /* 1: or get noise of one step */
    uint key_low;
    uint key_high;
    float weight;   /* of a bit */
    float mu_scale; /* the format of mu: 2^q */
    float log2_lo;  /* bounds of log2 sigma */
    float log2_hi;
};

layout(std430, set = 0, binding = 0) readonly buffer out_block
{
    float outputs[]; /* (n_rows, 2 n_channels) mu in its unit, log2 sigma */
};
layout(std430, set = 0, binding = 1) readonly buffer scale_block
{
    float scale[]; /* (n_channels, 3) unit of mu, its bound, step */
};
layout(std430, set = 0, binding = 2) readonly buffer position_block
{
    float position[]; /* (blocks, 4) */
};
layout(std430, set = 0, binding = 3) readonly buffer feature_block
{
    float feature[]; /* (blocks, n_channels - 4) */
};
layout(std430, set = 0, binding = 4) readonly buffer span_block
{
    uint span[]; /* (blocks) first + 256 n of the features that are coded */
};
layout(std430, set = 0, binding = 5) writeonly buffer d_out_block
{
    float d_outputs[]; /* (n_rows, 2 n_channels) */
};
layout(std430, set = 0, binding = 6) writeonly buffer bits_block
{
    float bits_of[]; /* (n_rows, n_channels) */
};
layout(std430, set = 0, binding = 7) writeonly buffer mu_block
{
    float mu_of[]; /* (blocks, n_channels - learned) */
};
layout(std430, set = 0, binding = 8) buffer d_value_block
{
    float d_value[]; /* (blocks, n_channels - learned) */
};

struct cost {
    float bits, d_v, d_log2_sigma;
};

/* Returns e^(-x^2 / 2), or 2^-100 where it is smaller. */
float bell(float x)
{
    return exp2_neg(min(0.72134752 * x * x, 100));
}

/* Returns P(X > x), where e is bell(x), by the fit of entropy/rate_row.h. */
float tail(float x, float e)
{
    const float t = 1 / (0.285 * abs(x) + 1);
    const float p = (((((((0.0245692317 * t - 0.0865910795) * t +
                          0.0739156356) * t + 0.00350077213) * t +
                        0.0675775346) * t + 0.0851255849) * t +
                      0.104505289) * t + 0.113698579) * t + 0.113698532;

    return x < 0 ? 1 - e * t * p : e * t * p;
}

/* Returns log2 x for positive normal numbers. */
float log2_of(float x)
{
    const uint from = floatBitsToUint(x) - 0x3f3504f3u;
    const int octaves = int(from) >> 23;
    const float u = uintBitsToFloat(floatBitsToUint(x) -
                                    (uint(octaves) << 23)) - 1;

    return float(octaves) +
           u * (((((((-0.149733233 * u + 0.235709691) * u - 0.248322839) * u +
                    0.286868871) * u - 0.36026346) * u + 0.480931162) * u -
                 0.721352487) * u + 1.44269492);
}

/* entropy/rate_row.c */
cost cost_of(float v, float log2_sigma)
{
    /* log2 sigma is at least -22 / 7; the 4 makes the argument positive. */
    const float per_sigma = exp2_neg(log2_sigma + 4) * 16;
    const float near = (abs(v) - 0.5) * per_sigma;
    const float far = (abs(v) + 0.5) * per_sigma;
    const float e_near = bell(near), e_far = bell(far), density = 0.39894228;
    const float p = tail(near, e_near) - tail(far, e_far);
    const float spread = v * v / 64 + 1, escape = 4.76837158203125e-7 / spread;
    /* The difference of two fits may be slightly negative. */
    const float sum = max(p, 0) + escape;
    const float slope = (e_far - e_near) * density * per_sigma;
    const float d_p = v < 0 ? -slope : slope;

    return cost(-log2_of(sum),
                (escape * v / (spread * 32) - d_p) * 1.44269504 / sum,
                (far * e_far - near * e_near) * density / sum);
}

bool is_coded(uint block, uint c)
{
    const uint begin = span[block] & 255, n = span[block] >> 8;

    return c < 4 || (c - 4 >= begin && c - 4 < begin + n);
}

/* Returns a value's distance from mu in steps. */
float steps_from(float mu, float step, uint block, uint c)
{
    const float y = c < 4 ? position[4 * block + c]
                          : feature[block * (n_channels - 4) + c - 4];
    const float off = (y - mu) / step;

    if (c < 4 && rounds != 0)
        return floor(off + 0.5);
    return c < 4 && has_noise != 0
               ? off + noise(uvec2(key_low, key_high),
                             uvec2(block << 16 | c, block >> 16))
               : off;
}

void main()
{
    const uint k = thread_index(), row = k / n_channels, c = k % n_channels;
    const uint block = first + every * row, mu_at = 2 * row * n_channels + c;
    const uint sigma_at = mu_at + n_channels;
    cost is = cost(0, 0, 0);
    float unit, most, step, mu, log2_sigma, d;

    if (row >= n_rows)
        return;
    unit = scale[3 * c];
    most = scale[3 * c + 1];
    step = scale[3 * c + 2];
    mu = clamp(unit * outputs[mu_at], -most, most);
    log2_sigma = clamp(outputs[sigma_at], log2_lo, log2_hi);
    if (is_coded(block, c))
        is = cost_of(steps_from(mu, step, block, c), log2_sigma);
    d = weight * is.d_v / step;
    bits_of[k] = is.bits;
    d_outputs[mu_at] = unit * inward(-d, mu, -most, most);
    d_outputs[sigma_at] = inward(weight * is.d_log2_sigma, log2_sigma, log2_lo,
                                 log2_hi);
    if (c >= learned) {
        const uint at = block * (n_channels - learned) + c - learned;

        mu_of[at] = roundEven(mu_scale * mu) / mu_scale;
        d_value[at] += d;
    }
}
