/* SPDX-License-Identifier: MIT
 *
 * The state of a verification. verify.c runs it, beginning at each stage;
 * verify_stages.c compares the results of the stages, verify_pixels.c the
 * pictures.
 */
#ifndef VERIFY_SESSION_H
#define VERIFY_SESSION_H

#include "ref_scene.h"
#include "verify.h"

#include <math.h>

/* The base or a layer. Its primitives begin at index `first`. */
typedef struct {
    ref_file file;
    ref_scene scene; /* its values in double */
    uint32_t first;
} part;

/* The results of the integer decoder. */
typedef struct {
    uint32_t n; /* primitives of all parts */
    const saga_model *model;
    saga_prim_format format;
    saga_primitive *prim;
    int16_t *colour; /* (prim, stride) */
    uint32_t stride;
    saga_animated *moved; /* (prim) at the picture's time */
    saga_splat *splat;    /* (prim) */
    uint8_t *visible;     /* (prim) */
    uint8_t *rgb;         /* the decoder's picture */
} exact;

/* The same results computed in double. */
typedef struct {
    ref_animated *moved;
    ref_splat *splat;
    uint8_t *visible;
} real;

typedef struct {
    double sum, peak; /* sum of squared errors; largest reference */
} tally;

/* A splat that at least one of the two pictures blends. */
typedef struct {
    double depth;
    uint32_t prim;
} drawn;

enum { CUT = 1, STOP = 2 };

/* The two pictures while they are drawn. */
typedef struct {
    uint32_t *t; /* T and sums of the integer reference */
    uint64_t (*sum)[3];
    double *trans, (*rgb)[3];
    uint8_t *otherwise; /* CUT, STOP: why only one picture blends a splat
                         * in the pixel */
    drawn *order;
    uint32_t n_order;
    uint32_t tools; /* the file's SAGA_TOOL_* */
} canvas;

typedef struct {
    saga_verify *v;
    const char *name;
    const saga_camera *camera;
    saga_verify_progress *progress;
    void *user;
    part part[1 + SAGA_MAX_LAYERS]; /* the base, if the file has one; the
                                     * segment's layers */
    int n_parts;
    exact e;
    real r;
    canvas c;
    tally alone[SAGA_VERIFY_MAX_ROWS], chain[SAGA_VERIFY_MAX_ROWS];
    saga_error *error;
} session;

static inline uint32_t n_prims(const session *s)
{
    return s->e.n;
}

static inline const part *part_of(const session *s, uint32_t prim)
{
    const part *p = &s->part[s->n_parts - 1];

    while (prim < p->first)
        p--;
    return p;
}

static inline const ref_primitive *prim_of(const session *s, uint32_t prim)
{
    const part *const p = part_of(s, prim);

    return &p->scene.prim[prim - p->first];
}

/* The row of a table to which differences are being added. */
typedef struct {
    saga_verify_error *to;
    tally *sum;
} column;

/* Returns the row with this name, which is added if no run has made it yet. */
column verify_row(session *s, int stage, const char *name, const char *unit,
                  double step, int is_alone);

static inline void note_error(column c, double error, double reference)
{
    c.to->n++;
    c.to->max = fmax(c.to->max, fabs(error));
    c.sum->sum += error * error;
    c.sum->peak = fmax(c.sum->peak, fabs(reference));
}

static inline void note(column c, double value, double reference)
{
    note_error(c, value - reference, reference);
}

/* Computes rms and PSNR from a row's sums. */
void verify_finish(saga_verify_error *e, const tally *t);

/* Compares a stage in integers with the same in double; does nothing for the
 * pixels, which are compared while they are blended. */
void verify_stage(session *s, int stage, int is_alone);

/* verify_blend draws both pictures pixel by pixel, verify_pixels compares them.
 * verify_norm compares the integer reference with what the decoder drew, and
 * returns false if a pixel differs. */
void verify_blend(session *s, int from);
void verify_pixels(session *s, int from);
bool verify_norm(session *s);

#endif
