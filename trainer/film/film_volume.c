/* SPDX-License-Identifier: MIT */
#include "film_volume.h"

#include "alloc.h"
#include "container.h"
#include "film_aside.h"
#include "orbit.h"
#include "order.h"
#include "put.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

/* A camera straight above or below the pivot, up to this sine, is in no level
 * direction. */
#define LEAST_LEVEL 1e-3

#define LEAST_MARGIN (1 * pi / 180)
#define MOST_MARGIN (5 * pi / 180)
#define MOST_ELEVATION \
    (85 * pi / 180) /* up must not be the viewing direction */
#define NEAREST 0.5
#define FARTHEST 1.05
#define BELOW_FLOOR 0.05 /* part of the opaque primitives that are below it */

enum { OPAQUE_Q20 = 4 << 20 }; /* 3 - log2 of an opacity of one half */

/* A camera as seen from the pivot. */
typedef struct {
    double to[3]; /* unit vector, from the pivot */
    double distance;
    double inwards; /* cosine between its viewing direction and the pivot */
} place;

static double clamp(double x, double lo, double hi)
{
    return fmin(fmax(x, lo), hi);
}

static double between(const place *a, const place *b)
{
    return acos(clamp(dot3(a->to, b->to), -1, 1));
}

static bool find_places(place *p, const saga_film *film,
                        const saga_orbit *orbit, saga_error *error)
{
    for (uint32_t i = 0; i < film->info.n_cameras; i++) {
        saga_source_view view = { .name = "" };
        saga_camera camera;
        uint32_t number;

        if (!saga_film_rig(film, i, &camera, &number, error))
            return false;
        saga_source_view_of_camera(&view, &film->metric, &camera);
        saga_source_view_centre(p[i].to, &view);
        for (int k = 0; k < 3; k++)
            p[i].to[k] -= orbit->focus[k];
        p[i].distance = sqrt(dot3(p[i].to, p[i].to));
        p[i].inwards = -dot3(p[i].to, view.rotation + 6) /
                       fmax(p[i].distance, 1e-300);
        for (int k = 0; k < 3; k++)
            p[i].to[k] /= fmax(p[i].distance, 1e-300);
    }
    return true;
}

/* Returns by how much the volume is wider than the cameras stand. */
static double find_margin(const place *p, int n, double *nearest)
{
    double spacing;

    if (n < 2)
        return LEAST_MARGIN;
    for (int i = 0; i < n; i++) {
        nearest[i] = pi;
        for (int k = 0; k < n; k++)
            if (k != i)
                nearest[i] = fmin(nearest[i], between(&p[i], &p[k]));
    }
    qsort(nearest, (size_t)n, sizeof *nearest, saga_by_value);
    spacing = nearest[n / 2];
    return clamp(spacing / 4, LEAST_MARGIN, MOST_MARGIN);
}

/* --- Values in the file's units ------------------------------------------ */

static int32_t to_units(double metres, const saga_metric *metric)
{
    return (int32_t)rint(clamp(metres / metric->unit, -(1 << 29), 1 << 29));
}

/* Returns an angle in pi / 32768. */
static int32_t to_turns(double angle)
{
    return (int32_t)rint(angle * 32768 / pi);
}

static void to_direction(int16_t q14[3], const double a[3])
{
    for (int i = 0; i < 3; i++)
        q14[i] = (int16_t)rint(16384 * a[i]);
}

/* --- The floor ----------------------------------------------------------- */

/* Sets *floor to the height, above the pivot, below which BELOW_FLOOR of the
 * primitives are that are opaque in the first frame. */
static bool find_floor(int32_t *floor, saga_film *film, const saga_orbit *orbit,
                       saga_error *error)
{
    const saga_metric *const m = &film->metric;
    saga_report report;
    double *height;
    size_t n = 0;
    int32_t t;

    if (!saga_film_seek(film, 0, 1, &t, error))
        return false;
    saga_tell(&report, film->dec);
    height = saga_alloc(report.n_primitives + 1u, sizeof *height, "the floor",
                        error);
    if (!height)
        return false;
    for (uint32_t i = 0; i < report.n_primitives; i++) {
        saga_animated a;
        double x[3];

        if (saga_primitive_at(&a, film->dec, i, t) || a.q0_q20 > OPAQUE_Q20)
            continue;
        for (int k = 0; k < 3; k++)
            x[k] = m->centre[k] + a.x[k] * m->unit - orbit->focus[k];
        height[n++] = dot3(x, orbit->up);
    }
    qsort(height, n, sizeof *height, saga_by_value);
    *floor = n ? to_units(height[(size_t)(BELOW_FLOOR * (double)n)], m)
               : INT32_MIN;
    free(height);
    return true;
}

/* --- The volume ---------------------------------------------------------- */

/* Sets `front` to the direction of azimuth 0, which is perpendicular to up: the
 * middle of the cameras' arc, or the first camera if they stand all round. */
static void find_front(double front[3], const saga_orbit *orbit,
                       const place *first)
{
    double height = dot3(first->to, orbit->up), n;

    for (int k = 0; k < 3; k++)
        front[k] = first->to[k] - height * orbit->up[k];
    n = length3(front);
    for (int k = 0; k < 3; k++)
        front[k] = orbit->closed && n > LEAST_LEVEL
                       ? front[k] / n
                       : cos(orbit->middle) * orbit->ahead[k] +
                             sin(orbit->middle) * orbit->side[k];
}

/* Sets the directions that may be looked from to those of the cameras, and the
 * margin. */
static void set_sector(saga_volume *v, const saga_orbit *orbit, const place *p,
                       int n, double margin)
{
    double low = pi / 2, high = -pi / 2;

    for (int i = 0; i < n; i++) {
        const double elevation = asin(clamp(dot3(p[i].to, orbit->up), -1, 1));

        low = fmin(low, elevation);
        high = fmax(high, elevation);
    }
    low = clamp(low - margin, -MOST_ELEVATION, MOST_ELEVATION);
    high = clamp(high + margin, -MOST_ELEVATION, MOST_ELEVATION);
    v->elevation_min = (int16_t)to_turns(low);
    v->elevation_max = (int16_t)to_turns(high);
    v->azimuth = (uint16_t)to_turns(
        orbit->closed ? pi : fmin(orbit->half + margin, pi));
    /* A quarter of the angle that the picture's shorter side spans. */
    v->turn = (uint16_t)to_turns(
        0.5 *
        fmin(atan(32768.0 * orbit->lens.width / orbit->lens.focal_q16[0]),
             atan(32768.0 * orbit->lens.height / orbit->lens.focal_q16[1])));
}

/* Sets all fields but the floor. */
static void set_volume(saga_volume *v, const saga_film *film,
                       const saga_orbit *orbit, const place *p, double margin)
{
    const int n = (int)film->info.n_cameras;
    const saga_metric *const m = &film->metric;
    double front[3], near = INFINITY, far = 0, inwards = 0;

    *v = (saga_volume){ .start = 0 };
    find_front(front, orbit, &p[0]);
    for (int i = 0; i < n; i++) {
        near = fmin(near, p[i].distance);
        far = fmax(far, p[i].distance);
        inwards += p[i].inwards / n;
        if (dot3(p[i].to, front) > dot3(p[v->start].to, front))
            v->start = (uint16_t)i;
    }
    to_direction(v->up, orbit->up);
    to_direction(v->front, front);
    for (int k = 0; k < 3; k++)
        v->pivot[k] = to_units(orbit->focus[k] - m->centre[k], m);
    v->distance_max = (uint32_t)to_units(FARTHEST * far, m);
    if (inwards > 0) {
        v->distance_min = (uint32_t)to_units(NEAREST * near, m);
        set_sector(v, orbit, p, n, margin);
        return;
    }
    /* The cameras look outwards: a ball. */
    v->azimuth = v->turn = 32768;
    v->elevation_min = -16384;
    v->elevation_max = 16384;
}

bool saga_volume_of(saga_volume *volume, saga_film *film, saga_error *error)
{
    const size_t n = film->info.n_cameras;
    place *const p = saga_calloc(n + 1, sizeof *p, "the cameras", error);
    double *const nearest = saga_calloc(n + 1, sizeof *nearest, "the cameras",
                                        error);
    saga_orbit orbit;
    const bool ok = p && nearest && saga_orbit_of(&orbit, film, error) &&
                    find_places(p, film, &orbit, error);

    if (ok)
        set_volume(volume, film, &orbit, p, find_margin(p, (int)n, nearest));
    free(p);
    free(nearest);
    return ok && find_floor(&volume->floor, film, &orbit, error);
}

/* --- In a file ----------------------------------------------------------- */

static void put_direction(uint8_t **at, const int16_t a[3])
{
    for (int i = 0; i < 3; i++)
        saga_put_le(at, (uint16_t)a[i], 2);
}

/* Writes the fields in the order of docs/bitstream.md. */
static void put_fields(uint8_t bytes[SAGA_VOLUME_NBYTES], const saga_volume *v)
{
    uint8_t *at = bytes;

    for (int i = 0; i < 3; i++)
        saga_put_le(&at, (uint32_t)v->pivot[i], 4);
    saga_put_le(&at, v->distance_min, 4);
    saga_put_le(&at, v->distance_max, 4);
    saga_put_le(&at, (uint32_t)v->floor, 4);
    put_direction(&at, v->up);
    put_direction(&at, v->front);
    saga_put_le(&at, v->azimuth, 2);
    saga_put_le(&at, (uint16_t)v->elevation_min, 2);
    saga_put_le(&at, (uint16_t)v->elevation_max, 2);
    saga_put_le(&at, v->turn, 2);
    saga_put_le(&at, v->start, 2);
    saga_put_le(&at, v->quality_q8[0], 2);
    saga_put_le(&at, v->quality_q8[1], 2);
}

bool saga_volume_put(saga_bytes *out, const char *name, const saga_bytes *film,
                     const saga_volume *volume, saga_error *error)
{
    uint8_t bytes[SAGA_VOLUME_NBYTES];
    saga_bytes payload = { NULL, 0 };
    saga_volume back;

    if (volume) {
        put_fields(bytes, volume);
        payload = (saga_bytes){ bytes, sizeof bytes };
    }
    if (!saga_aside_put(out, name, film, SAGA_CHUNK_VOLUME, &payload, error))
        return false;
    /* A decoder has to accept the file. */
    if (!volume || saga_find_volume(&back, out->data, out->nbytes) == SAGA_OK)
        return true;
    saga_bytes_free(out);
    return saga_fail(error, name, "see docs/bitstream.md, Volume",
                     "a value of the viewing volume is out of its range");
}

bool saga_volume_add(saga_bytes *film, const char *name,
                     const uint16_t quality_q8[2], saga_error *none,
                     saga_error *error)
{
    saga_film opened;
    saga_bytes whole;
    saga_volume v;
    bool found;

    if (!saga_film_open(&opened, name, film->data, film->nbytes, 1, error))
        return false;
    found = saga_volume_of(&v, &opened, none);
    saga_film_close(&opened);
    if (!found)
        return true;
    memcpy(v.quality_q8, quality_q8, sizeof v.quality_q8);
    if (!saga_volume_put(&whole, name, film, &v, error))
        return false;
    saga_bytes_free(film);
    *film = whole;
    return true;
}
