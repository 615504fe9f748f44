/* SPDX-License-Identifier: MIT
 *
 * Returns the axes of a primitive; warm/flat_set.c: saga_flat_axes. */
mat3 axes_of(vec4 q)
{
    const float n = dot(q, q);
    const float w = n > 0 ? q[0] : 1, x = q[1], y = q[2], z = q[3];
    const float s = n > 0 ? 2 / n : 2;

    return mat3(vec3(1 - s * (y * y + z * z), s * (x * y + w * z),
                     s * (x * z - w * y)),
                vec3(s * (x * y - w * z), 1 - s * (x * x + z * z),
                     s * (y * z + w * x)),
                vec3(s * (x * z + w * y), s * (y * z - w * x),
                     1 - s * (x * x + y * y)));
}
