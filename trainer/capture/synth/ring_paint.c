/* SPDX-License-Identifier: MIT */
#include "ring_paint.h"

#include "synth_math.h"

#include <string.h>

/* Indices of the plan's colours. */
enum {
    C_SHIRT,
    C_STRIPE,
    C_TROUSERS,
    C_CHECK,
    C_HAIR,
    C_SHOE,
    C_BALL,
    C_SEAM,
    C_COMER,
    C_GOER,
    C_CRATE,
    C_GROUND,
    C_MAT,
    C_WALL /* and those that
            * follow */
};

static void dye(double rgb[3], const saga_ring_plan *p, int colour,
                double amount)
{
    const double *const c = p->colour[colour % SAGA_RING_N_COLOURS];
    paint(rgb, c[0], c[1], c[2], amount);
}

/* Returns 0 or 1 for stripes of width 1/2, whose edges are soft over `soft`. */
static double stripes(double x, double soft)
{
    const double d = fabs(x - floor(x + 0.5));
    return ramp(0.25 - soft, 0.25 + soft, d);
}

/* ------------------------------------------------------------------ clothes */

static void shirt(const saga_ring_plan *p, const double at[3], double rgb[3])
{
    dye(rgb, p, C_SHIRT, 1.0);
    dye(rgb, p, C_STRIPE, stripes(at[0] / 0.085, 0.06));
    brighten(rgb, 1.0 + 0.6 * grain(22.0 * at[0], 2.5 * at[1] + 4.0 * at[2],
                                    p->salt + 1));
}

static void trousers(const saga_ring_plan *p, const double at[3], double rgb[3])
{
    dye(rgb, p, C_TROUSERS, 1.0);
    dye(rgb, p, C_CHECK, 0.6 * stripes(at[0] / 0.12, 0.08));
    dye(rgb, p, C_CHECK, 0.6 * stripes(1.6 * at[1] + 0.3, 0.10));
    brighten(rgb, 1.0 + 0.5 * grain(18.0 * at[0], 3.0 * at[2], p->salt + 2));
}

/* Sets rgb to the colour of the head at a place, whose coordinates are forward,
 * left and up. */
static void head(const saga_ring_plan *p, const double at[3], double rgb[3])
{
    const double l = fabs(at[1]), u = at[2], f = at[0];
    const double side = l - 0.36, high = u - 0.12;
    const double eye = sqrt(side * side + high * high);
    const double front = ramp(0.25, 0.35, f);
    const double hair = ramp(
        -0.06, 0.06,
        u - 0.35 - 0.9 * f + 0.25 * grain(4.0 * at[1], 4.0 * u, p->salt + 3));
    paint(rgb, 0.60, 0.40, 0.28, 1.0);
    paint(rgb, 0.04, 0.04, 0.05, front * (1.0 - ramp(0.12, 0.17, eye)));
    paint(rgb, 0.50, 0.10, 0.10,
          front * (1.0 - ramp(0.05, 0.10, fabs(u + 0.42))) *
              (1.0 - ramp(0.22, 0.30, l)));
    dye(rgb, p, C_HAIR, hair);
    brighten(rgb,
             1.0 + 0.7 * hair *
                       grain(12.0 * at[1], 3.0 * u + 5.0 * f, p->salt + 4));
}

/* ------------------------------------------------------------------- things */

static void ball(const saga_ring_plan *p, const double at[3], double rgb[3])
{
    dye(rgb, p, C_BALL, 1.0);
    dye(rgb, p, C_SEAM, ramp(-0.08, 0.08, at[0] * at[1]));
    paint(rgb, 0.75, 0.75, 0.70, 1.0 - ramp(0.14, 0.20, fabs(at[2])));
    brighten(rgb,
             1.0 + 0.4 * grain(4.0 * at[0], 4.0 * at[1] + at[2], p->salt + 5));
}

static void goer(const saga_ring_plan *p, const double at[3], double rgb[3])
{
    dye(rgb, p, C_GOER, 1.0);
    paint(rgb, 0.08, 0.08, 0.10,
          stripes(2.5 * at[2] +
                      0.4 * noise(3.0 * at[0], 3.0 * at[1], p->salt + 6),
                  0.08));
}

/* Sets `at` to the coordinates on a box's face, and returns the face's
 * number. */
static int face_of(const saga_ring_shape *b, const saga_ring_hit *hit,
                   double at[2])
{
    double local[3], normal[3];
    int axis = 0;
    for (int i = 0; i < 3; i++) {
        const double v[3] = { hit->position[0] - b->a[0],
                              hit->position[1] - b->a[1],
                              hit->position[2] - b->a[2] };
        local[i] = dot3(b->frame[i], v);
        normal[i] = dot3(b->frame[i], hit->normal);
        /* In the box's own axes the normal is +-1 along one axis and 0 along
         * the others. */
        axis = fabs(normal[i]) > 0.5 ? i : axis;
    }
    at[0] = local[axis == 0 ? 1 : 0];
    at[1] = local[axis == 2 ? 1 : 2];
    return 2 * axis + (normal[axis] > 0.0);
}

static void comer(const saga_ring_plan *p, int face, const double at[2],
                  double rgb[3])
{
    const double r = sqrt(at[0] * at[0] + at[1] * at[1]);
    dye(rgb, p, C_COMER + face, 1.0);
    paint(rgb, 0.70, 0.68, 0.62, stripes(r / 0.11, 0.05));
    brighten(rgb,
             1.0 + 0.4 * grain(12.0 * at[0] + face, 12.0 * at[1], p->salt + 7));
}

static void crate(const saga_ring_plan *p, int face, const double at[2],
                  double rgb[3])
{
    dye(rgb, p, C_CRATE, 1.0);
    brighten(rgb, 1.0 + 0.9 * grain(2.5 * at[0] + 3.0 * face, 14.0 * at[1],
                                    p->salt + 8));
    brighten(rgb, 1.0 - 0.6 * lines(at[1], 0.12, 0.006));
    brighten(rgb, 1.0 - 0.5 * lines(at[0] - 0.1, 0.20, 0.008));
}

/* Paints picture `number`: a ramp between colours from a hash, with three discs
 * and a grid of cells. */
static void picture(int32_t number, const double at[2], uint32_t salt,
                    double rgb[3])
{
    /* Cells of 0.19 m have a brightness from their hash. */
    const int32_t x = (int32_t)floor(at[0] / 0.19);
    const int32_t y = (int32_t)floor(at[1] / 0.19);
    for (int c = 0; c < 3; c++) {
        rgb[c] = mix(0.1 + 0.6 * lattice(number, c, salt),
                     0.1 + 0.6 * lattice(number, c + 3, salt),
                     clamp01(0.5 + at[0] * 0.5));
        rgb[c] *= 0.6 + 0.8 * lattice(8 * x + number * 131, y + c, salt);
    }
    for (int i = 0; i < 3; i++) {
        const double dx = at[0] - 1.6 * (lattice(number, 6 + i, salt) - 0.5);
        const double dy = at[1] - 0.9 * (lattice(number, 9 + i, salt) - 0.5);
        const double r = 0.10 + 0.16 * lattice(number, 12 + i, salt);
        paint(rgb, lattice(number, 15 + i, salt), lattice(number, 18 + i, salt),
              lattice(number, 21 + i, salt),
              1.0 - ramp(r, r + 0.02, sqrt(dx * dx + dy * dy)));
    }
}

/* Paints a display, which shows a new picture 120 times per second. */
static bool display(const saga_ring_state *s, int shape, int face,
                    const double at[2], double rgb[3])
{
    const saga_ring_shape *const b = &s->shape[shape];
    const double rim = b->half[1] - fabs(at[0]) < b->half[2] - fabs(at[1])
                           ? b->half[1] - fabs(at[0])
                           : b->half[2] - fabs(at[1]);
    paint(rgb, 0.05, 0.05, 0.06, 1.0);
    /* Only the face towards the hall shows pictures, inside a rim. */
    if (face != 0 || rim < 0.05)
        return false;
    const double n = floor(120.0 * s->seconds + 0.5);
    picture((int32_t)(n - 65536.0 * floor(n / 65536.0)), at,
            s->plan.salt + 9u * (uint32_t)shape, rgb);
    return true;
}

/* --------------------------------------------------------------------- hall */

/* Paints boards, and a mat with light and dark cells in the middle. */
static void ground(const saga_ring_plan *p, double x, double y, double rgb[3])
{
    const double board = floor(x / 0.30);
    /* Boards are 0.30 m wide and 1.1 m long; each row is shifted by its own
     * hash. */
    const double along = y + 1.7 * lattice((int32_t)board, 1, p->salt + 10);
    const double tone = lattice((int32_t)board, (int32_t)floor(along / 1.1),
                                p->salt + 11);
    const double *const t = p->light; /* any direction would do */
    const double n = 1.0 / sqrt(t[0] * t[0] + t[1] * t[1]);
    /* The mat is turned relative to the boards. */
    const double u = n * (t[0] * x + t[1] * y), v = n * (t[0] * y - t[1] * x);
    const double cell = lattice((int32_t)floor(u / 0.16),
                                (int32_t)floor(v / 0.16), p->salt + 12);
    const double rim = 1.28 - (fabs(u) > fabs(v) ? fabs(u) : fabs(v));
    double mat[3] = { 0.55, 0.53, 0.48 };
    dye(rgb, p, C_GROUND, 1.0);
    brighten(rgb, 0.6 + 0.7 * tone);
    brighten(rgb, 1.0 + 0.7 * grain(9.0 * x, 1.6 * y, p->salt + 13));
    brighten(rgb, 1.0 - 0.5 * lines(x, 0.30, 0.008));
    dye(mat, p, C_MAT, cell < 0.45 ? 0.9 : 0.1);
    brighten(mat, 0.7 + 0.5 * cell);
    brighten(mat, 1.0 + 0.6 * grain(7.0 * u, 7.0 * v, p->salt + 14));
    paint(rgb, mat[0], mat[1], mat[2], ramp(-0.005, 0.005, rim));
}

static void bricks(const saga_ring_plan *p, double a, double z, double rgb[3])
{
    const double row = floor(z / 0.22);
    /* Every second row is shifted by half a brick. */
    const double shift = a / 0.5 + 0.5 * (row - 2.0 * floor(0.5 * row));
    brighten(rgb, 0.7 + 0.6 * lattice((int32_t)floor(shift), (int32_t)row,
                                      p->salt + 20));
    paint(rgb, 0.42, 0.40, 0.36,
          0.7 * fmax(lines(z, 0.22, 0.012), lines(shift + 0.5, 1.0, 0.024)));
}

static void boards(const saga_ring_plan *p, double a, double z, double rgb[3])
{
    const double board = floor(a / 0.42);
    brighten(rgb, 0.6 + 0.8 * lattice((int32_t)board, 3, p->salt + 21));
    brighten(rgb, 1.0 + 0.8 * grain(11.0 * a, 1.2 * z, p->salt + 22));
    brighten(rgb, 1.0 - 0.5 * lines(a, 0.42, 0.012));
}

static void waves(const saga_ring_plan *p, double a, double z, double rgb[3])
{
    dye(rgb, p, C_WALL + 1,
        stripes(z / 0.6 + 0.7 * noise(0.9 * a, 0.7 * z, p->salt + 23), 0.03));
}

static void tiles(const saga_ring_plan *p, double a, double z, double rgb[3])
{
    const int32_t x = (int32_t)floor(a / 0.45), y = (int32_t)floor(z / 0.45);
    dye(rgb, p, C_WALL + 2, lattice(x, y, p->salt + 24) < 0.4 ? 0.8 : 0.0);
    brighten(rgb, 0.7 + 0.5 * lattice(x, y, p->salt + 25));
    paint(rgb, 0.10, 0.10, 0.11,
          0.8 * fmax(lines(a, 0.45, 0.01), lines(z, 0.45, 0.01)));
}

/* Paints two posters on a wall, with rings or with cells. */
static void posters(const saga_ring_plan *p, int wall, const double at[2],
                    double rgb[3])
{
    for (int i = 0; i < 2; i++) {
        const int32_t k = 2 * wall + i;
        const double cx = (i ? 1.9 : -1.9) +
                          1.2 * (lattice(k, 1, p->salt) - 0.5);
        const double cz = 1.5 + 0.5 * (lattice(k, 2, p->salt) - 0.5);
        const double hx = 0.35 + 0.35 * lattice(k, 3, p->salt);
        const double dx = at[0] - cx, dz = at[1] - cz;
        const double r = sqrt(dx * dx + dz * dz);
        const double cell = lattice((int32_t)floor(dx / 0.12),
                                    (int32_t)floor(dz / 0.12), p->salt + 30);
        double c[3] = { 0.68, 0.66, 0.60 };
        dye(c, p, k, i ? stripes(r / 0.22, 0.04) : cell < 0.5 ? 1.0 : 0.0);
        brighten(c, 1.0 + 0.3 * grain(6.0 * dx, 6.0 * dz, p->salt + 31));
        paint(rgb, c[0], c[1], c[2],
              inside_rect(at[0], at[1], cx, cz, hx, 0.55));
    }
}

static void wall(const saga_ring_plan *p, const saga_ring_hit *hit,
                 double rgb[3])
{
    static void (*const kinds[4])(const saga_ring_plan *, double, double,
                                  double *) = { bricks, boards, waves, tiles };
    const double *const n = hit->normal;
    const int side = fabs(n[0]) > 0.5 ? 0 : 1;
    const int number = 2 * side + (n[side] > 0.0);
    const double at[2] = { hit->position[1 - side], hit->position[2] };
    if (fabs(n[2]) > 0.5) {
        paint(rgb, 0.45, 0.45, 0.44, 1.0);
        brighten(rgb, 1.0 + 0.3 * grain(hit->position[0], hit->position[1],
                                        p->salt + 26));
        return;
    }
    dye(rgb, p, C_WALL + number, 1.0);
    kinds[(number + (int)(p->salt >> 5)) & 3](p, at[0], at[1], rgb);
    brighten(rgb, 1.0 + 0.4 * grain(2.0 * at[0], 2.0 * at[1],
                                    p->salt + 27u + (uint32_t)number));
    posters(p, number, at, rgb);
}

/* Sets texture coordinates. For a capsule they are the position along it in
 * metres and the normal in its own axes; for a ball, the normal alone. */
static void around(const saga_ring_shape *s, const saga_ring_hit *hit,
                   double at[3])
{
    for (int i = 0; i < 3; i++)
        at[i] = dot3(s->frame[i], hit->normal);
    if (s->length > 0.0)
        at[0] = s->frame[0][0] * (hit->position[0] - s->a[0]) +
                s->frame[0][1] * (hit->position[1] - s->a[1]) +
                s->frame[0][2] * (hit->position[2] - s->a[2]);
}

bool saga_ring_albedo(const saga_ring_state *s, const saga_ring_hit *hit,
                      double rgb[3])
{
    const saga_ring_plan *const p = &s->plan;
    const saga_ring_shape *const shape = hit->shape < 0 ? NULL
                                                        : &s->shape[hit->shape];
    double at[3] = { 0.0 };
    int face = 0;
    /* Texture coordinates are relative to the shape, so that textures move and
     * turn with it. */
    if (shape && shape->is_box)
        face = face_of(shape, hit, at);
    else if (shape)
        around(shape, hit, at);
    switch (hit->object) {
    case SAGA_RING_SHIRT:
        shirt(p, at, rgb);
        break;
    case SAGA_RING_TROUSERS:
        trousers(p, at, rgb);
        break;
    case SAGA_RING_SKIN:
        paint(rgb, 0.58, 0.38, 0.27, 1.0);
        break;
    case SAGA_RING_HEAD:
        head(p, at, rgb);
        break;
    case SAGA_RING_SHOE:
        dye(rgb, p, C_SHOE, 1.0);
        break;
    case SAGA_RING_BATON:
        paint(rgb, 0.70, 0.66, 0.55, 1.0);
        paint(rgb, 0.60, 0.06, 0.06, stripes(at[0] / 0.2, 0.05));
        break;
    case SAGA_RING_BALL:
        ball(p, at, rgb);
        break;
    case SAGA_RING_COMER:
        comer(p, face, at, rgb);
        break;
    case SAGA_RING_GOER:
        goer(p, at, rgb);
        break;
    case SAGA_RING_POLE:
        paint(rgb, 0.10, 0.10, 0.11, 1.0);
        paint(rgb, 0.70, 0.62, 0.10, stripes(at[0] / 0.5, 0.02));
        break;
    case SAGA_RING_CRATE:
        crate(p, face, at, rgb);
        break;
    case SAGA_RING_DISPLAY:
        return display(s, hit->shape, face, at, rgb);
    case SAGA_RING_GROUND:
        ground(p, hit->position[0], hit->position[1], rgb);
        break;
    case SAGA_RING_WALL:
        wall(p, hit, rgb);
        break;
    }
    return false;
}
