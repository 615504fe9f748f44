/* SPDX-License-Identifier: MIT */
#include "gen_refit.h"

#include "adam.h"
#include "encode.h"
#include "freed.h"
#include "morton.h"
#include "pack.h"
#include "quantise.h"
#include "train_state.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *must(void *p)
{
    if (!p) {
        fprintf(stderr, "refit: out of memory\n");
        exit(2);
    }
    return p;
}

static void need(bool done, const saga_error *error)
{
    if (done)
        return;
    fprintf(stderr, "refit: %s\n", error->message);
    exit(2);
}

/* A refit in progress. The reconstruction networks are not trained, so their
 * outputs in `twin` (the trainer's floating-point copy of the decoder's values)
 * are set from the file and are not computed again. */
typedef struct {
    const ref_file *in;
    refit_options o;
    saga_scene s, d;
    saga_twin twin;
    saga_rate rate;
    float *feature; /* (coarse, F) quantised from `decide` on */
    float *m, *v;   /* Adam's moments (params) */
} fit;

/* --- The file as a scene ------------------------------------------------- */

static void set_structure(saga_scene *s, const ref_file *in)
{
    const saga_tier *const l = s->model.tier;
    uint32_t v[4];

    memcpy(s->split, in->s.split, s->n_nodes);
    memcpy(s->occupancy, in->s.occupancy, s->n_nodes * sizeof *s->occupancy);
    memcpy(s->coarse, in->sc.coarse, s->n.coarse * sizeof *s->coarse);
    memcpy(s->fine, in->sc.fine, s->n.fine * sizeof *s->fine);
    /* The groups of anchors depend on the new model, so they are computed
     * again, from the parity of cells and suffixes. */
    for (uint32_t i = 0; i < s->n.coarse; i++) {
        for (uint32_t k = 0; k < 3; k++)
            v[k] = s->coarse[i].cell[k];
        v[3] = s->coarse[i].cell_t;
        s->coarse[i].group = (uint8_t)saga_morton_group(
            v, l[SAGA_TIER_COARSE].n_groups);
    }
    for (uint32_t i = 0; i < s->n.fine; i++) {
        for (uint32_t k = 0; k < 4; k++)
            v[k] = saga_morton_axis(in->s.fine_suffix[i], k);
        s->fine[i].group = (uint8_t)saga_morton_group(
            v, l[SAGA_TIER_FINE].n_groups);
        for (uint32_t k = 0; k < s->fine[i].n_prim; k++)
            s->prim_fine[s->fine[i].first_prim + k] = i;
    }
}

/* Converts a position from the decoder's units to those of a scene. */
static void set_place(float to[4], const int32_t x[3], int32_t t)
{
    for (int k = 0; k < 3; k++)
        to[k] = (float)x[k] / 8388608;
    to[3] = (float)t / 65536;
}

static void set_places(saga_scene *s, const ref_file *in)
{
    for (uint32_t i = 0; i < s->n.coarse; i++)
        set_place(s->coarse_x + 4 * (size_t)i, in->sc.coarse[i].x,
                  in->sc.coarse[i].t);
    for (uint32_t i = 0; i < s->n.fine; i++)
        set_place(s->fine_x + 4 * (size_t)i, in->sc.fine[i].x,
                  in->sc.fine[i].t);
    for (size_t i = 0; i < (size_t)s->n.coarse * s->model.features; i++)
        s->coarse_feature[i] = (float)ldexp(in->value[SAGA_STEP_FEATURE][i],
                                            -s->model.out_q[SAGA_OUT_COARSE]);
}

/* Returns a primitive's offset, clamped to its suffix cell. Rounding may have
 * put it outside, and the rate finds the cell from the offset. */
static float prim_offset(const ref_file *in, size_t prim, uint32_t axis)
{
    const uint32_t bits = in->h.model.tier[SAGA_TIER_FINE].suffix_bits;
    const double most = bits ? ldexp(1, -(int)bits) - ldexp(1, -14) : 2;
    const double residual = in->value[SAGA_STEP_PRIM][4 * prim + axis] /
                            16384.0;

    return (float)(saga_suffix_centre(in->s.prim_suffix[prim], bits, axis) +
                   fmin(fmax(residual, -most), most));
}

static void set_twin(saga_twin *w, const ref_file *in)
{
    const size_t f = in->h.model.features;

    for (size_t i = 0; i < in->s.n.fine; i++) {
        const saga_fine *const fine = &in->sc.fine[i];

        for (size_t k = 0; k < f; k++)
            w->fine_feature[i * f + k] = (float)ldexp(
                in->sc.fine_feature[i * f + k] * saga_fine_unit(in->params)[k],
                -3 - in->h.model.out_q[SAGA_OUT_FINE]);
        for (size_t k = 0; k < 4; k++) {
            const float unit = k < 3 ? 8388608 : 65536;

            w->log2_support[4 * i + k] = (float)fine->local[k] / 1024 -
                                         (k < 3 ? 23 : 16);
            w->support[4 * i + k] = (float)fine->support[k] / unit;
        }
        set_place(w->fine_phase + 4 * i, fine->x, fine->t);
        w->fine_phase[4 * i + 3] = 2 * w->fine_phase[4 * i + 3] - 1;
    }
    for (size_t i = 0; i < in->s.n.prim; i++)
        for (uint32_t k = 0; k < 4; k++)
            w->prim_offset[4 * i + k] = prim_offset(in, i, k);
}

/* Sets the anchors' values to exactly those of the file. Computed from float
 * positions they would differ by rounding. */
static void set_values(saga_rate *r, const ref_file *in)
{
    for (size_t i = 0; i < 4 * (size_t)in->s.n.coarse; i++)
        r->centre[i] = (float)in->value[SAGA_STEP_CENTRE][i] / 16384;
    for (size_t i = 0; i < in->s.n.fine; i++)
        for (size_t k = 0; k < 4; k++)
            r->offset[SAGA_RATE_OFFSETS * i + k] =
                (float)in->value[SAGA_STEP_FINE][4 * i + k] / 16384;
}

/* Returns the file's model with the entropy model of the options in place of
 * its own. */
static saga_model model_of(const ref_file *in, const refit_options *o)
{
    saga_model m = in->h.model;
    const saga_policy p = saga_policy_of(0, 1, in->s.n.prim);
    saga_ablation a = o->ablation;

    if (!a.no_bank && !a.slots)
        a.slots = 64;
    m.tools &= ~(uint32_t)(SAGA_TOOL_BANK | SAGA_TOOL_PLAIN_WRITE);
    m.bank_slots = 0;
    m.bank_width = 0;
    m.bank_blocks = 0;
    saga_plan_entropy_model(&m, &a, &p, SAGA_MAX_SLOTS);
    return m;
}

static void begin_fit(fit *f)
{
    const ref_file *const in = f->in;
    const saga_model m = model_of(in, &f->o);
    saga_error error = { "" };
    size_t n;

    need(
        saga_scene_init(&f->s, &m, in->s.n, in->s.n_nodes, f->o.seed, &error) &&
            saga_scene_init(&f->d, &m, in->s.n, in->s.n_nodes, 0, &error),
        &error);
    /* Everything that stays comes from the file. */
    set_structure(&f->s, in);
    set_places(&f->s, in);
    need(saga_twin_init(&f->twin, &f->s, &error), &error);
    set_twin(&f->twin, in);
    need(saga_rate_init(&f->rate, &f->s, &error) &&
             saga_rate_refresh(&f->rate, &f->s, &error),
         &error);
    set_values(&f->rate, in);
    if (f->o.ablation.raw_networks)
        saga_rate_keep_raw(&f->rate);
    f->rate.decision.keep = f->o.keep;
    n = (size_t)f->s.n.coarse * m.features;
    f->feature = must(malloc((n + 1) * sizeof *f->feature));
    memcpy(f->feature, f->s.coarse_feature, n * sizeof *f->feature);
    n = f->s.n_reals - (size_t)(f->s.params - f->s.reals);
    f->m = must(calloc(n + 1, sizeof *f->m));
    f->v = must(calloc(n + 1, sizeof *f->v));
}

static void free_fit(fit *f)
{
    saga_rate_free(&f->rate);
    saga_twin_free(&f->twin);
    saga_scene_free(&f->s);
    saga_scene_free(&f->d);
    free(f->feature);
    free(f->m);
    free(f->v);
}

/* --- Fitting ------------------------------------------------------------- */

/* The learning rate falls by a half cosine to 0.03 of its maximum, as in the
 * rendering stage. Its ramp has a third of that stage's length, because there
 * are fewer iterations and the features are already trained. */
static float learning_rate(const fit *f, int i)
{
    enum { RAMP = 100 };
    const double x = (double)i / f->o.iterations;
    const double ramp = i < RAMP ? (i + 1.0) / RAMP : 1;

    return (float)(0.004 * ramp * (0.03 + 0.97 * 0.5 * (1 + cos(M_PI * x))));
}

/* Sets t to the consecutive parameters of networks from..to-1. Returns the
 * number of tensors: 0 if the model has none of these networks, else 1. */
static size_t tensor_of(saga_adam_tensor *t, fit *f, int from, int to,
                        float rate)
{
    const float *first = NULL;
    size_t n = 0;

    for (int net = from; net < to; net++) {
        const saga_net *const x = &f->s.net[net];

        if (x->n_layers && !first)
            first = x->w[0];
        n += x->n_layers ? saga_net_n_params(x) : 0;
    }
    if (n == 0)
        return 0;
    t->name = "entropy networks";
    t->x = f->s.params + (first - f->s.params);
    t->g = f->d.params + (first - f->s.params);
    t->m = f->m + (first - f->s.params);
    t->v = f->v + (first - f->s.params);
    t->n = n;
    t->rate = rate;
    return 1;
}

/* Makes iteration i. From iteration `decide` on, when sources are chosen, the
 * features are rounded as they will be coded. Returns NULL or an error. */
static const char *fit_step(fit *f, int i, int decide)
{
    const saga_rate_input x = { &f->s, &f->twin, f->feature };
    const bool remember = saga_rate_readers(&f->rate.context, &f->s) &&
                          (i % SAGA_RATE_REMEMBER_EVERY == 0 || i == decide);
    saga_rate_options o = { .rounding = true, .weight = 1 };
    const saga_adam adam = saga_adam_default();
    const float rate = learning_rate(f, i);
    double bits[SAGA_N_STEPS];
    saga_error error = { "" };
    saga_adam_tensor t[2];
    size_t n;

    /* Gradients are computed, then Adam takes a step. The memory bank's
     * networks are trained only if the bank is read. */
    memset(f->d.reals, 0, f->d.n_reals * sizeof *f->d.reals);
    saga_twin_clear(&f->twin, &f->s);
    saga_rate_look(&o, i, remember);
    if (i == decide)
        need(saga_rate_decide(&f->rate, &f->s, &x, &error), &error);
    n = (size_t)f->s.n.coarse * f->s.model.features;
    if (i >= decide)
        saga_rate_round(f->feature, &f->rate, &f->s, (saga_range){ 0, n });
    saga_rate_add(bits, &f->rate, &f->d, &x, &o);
    n = tensor_of(&t[0], f, SAGA_NET_HYPER, SAGA_NET_FUSE_C, rate);
    n += tensor_of(&t[n], f, SAGA_NET_QUERY, SAGA_NET_RES,
                   remember ? SAGA_BANK_TWIN_PACE * rate : 0);
    return saga_adam_update(&adam, t, n, (uint64_t)i + 1, &error)
               ? NULL
               : "the fit left the finite numbers";
}

static const char *fit_all(fit *f)
{
    const saga_rate_input x = { &f->s, &f->twin, f->feature };
    const int decide = 2 * f->o.iterations / 3;
    const char *why = NULL;

    saga_rate_start(&f->rate, &f->s, &x);
    for (int i = 0; !why && i < f->o.iterations; i++)
        why = fit_step(f, i, decide);
    return why;
}

/* --- The file ------------------------------------------------------------ */

/* Returns symbols that share the file's structure and have their own residuals.
 */
static saga_symbols begin_symbols(const ref_file *in)
{
    saga_symbols y = in->s;

    y.centre = must(calloc(in->s.n.coarse + 1u, 4 * sizeof *y.centre));
    y.feature = must(
        calloc(in->s.n.coarse + 1u, in->h.model.features * sizeof *y.feature));
    y.fine_offset = must(calloc(in->s.n.fine + 1u, 4 * sizeof *y.fine_offset));
    y.prim_offset = must(calloc(in->s.n.prim + 1u, 4 * sizeof *y.prim_offset));
    return y;
}

static void end_symbols(saga_symbols *y)
{
    free(y->centre);
    free(y->feature);
    free(y->fine_offset);
    free(y->prim_offset);
}

static bool write_segment(saga_encoder *e, const ref_file *in,
                          saga_error *error)
{
    const saga_targets t = { .value = (const int16_t *const *)in->value };
    FREED_BY(end_symbols) saga_symbols y = begin_symbols(in);
    saga_quantise_report report;
    const bool ok = saga_quantise_segment(&y, &report, e, &t, NULL, error) &&
                    saga_encoder_segment(e, &y, in->segment.n_frames, error);

    return ok;
}

/* Returns the lowest level, at least the file's, that allows the model's slots.
 */
static uint8_t level_for(const ref_file *in, const saga_model *m)
{
    uint8_t level = in->h.level;

    while (level < SAGA_N_PROFILES - 1 &&
           saga_caps[level].n_slots < m->bank_slots)
        level++;
    return level;
}

static const char *write_file(uint8_t **out, size_t *n, const fit *f,
                              const saga_rate_choice *c)
{
    saga_header h = f->in->h;
    saga_net_symbols entropy, nets;
    saga_encode_sizes sizes;
    saga_encoder *e;
    saga_error error = { "" };
    bool ok;

    /* The entropy networks are the new ones, all others are the file's. */
    h.model = c->scene.model;
    h.level = level_for(f->in, &h.model);
    if (!saga_pack_entropy(&entropy, &h.model, c, &f->twin, &error))
        return "out of memory";
    for (int net = 0; net < SAGA_N_NETS; net++)
        memcpy(nets.layer[net],
               saga_is_entropy_net(net) ? entropy.layer[net]
                                        : f->in->nets.layer[net],
               sizeof nets.layer[net]);
    e = saga_encoder_open(&h, f->in->rig, &nets, &error);
    ok = e && write_segment(e, f->in, &error) &&
         saga_encoder_finish(e, out, n, &sizes, &error);
    saga_encoder_free(e);
    saga_net_symbols_free(&entropy);
    return ok ? NULL : "the file's values cannot be coded again";
}

static const char *write_fit(uint8_t **out, size_t *n, refit_report *r, fit *f)
{
    const saga_rate_input x = { &f->s, &f->twin, f->feature };
    saga_error error = { "" };
    FREED_BY(saga_rate_choice_free) saga_rate_choice c;
    const char *why;

    need(saga_rate_choice_init(&c, &f->rate, &x, &error), &error);
    memcpy(f->feature, f->s.coarse_feature,
           (size_t)f->s.n.coarse * f->s.model.features * sizeof *f->feature);
    saga_rate_choice_code(&c, &f->rate, &x, 0, SAGA_N_KINDS - 1);
    memcpy(r->sources, c.scene.model.sources, sizeof r->sources);
    memcpy(r->estimate, c.bits, sizeof r->estimate);
    r->decision = f->rate.decision;
    why = write_file(out, n, f, &c);
    return why;
}

refit_options refit_defaults(void)
{
    return (refit_options){ .iterations = 3000, .seed = 1 };
}

const char *refit_make(uint8_t **out, size_t *n, refit_report *report,
                       const ref_file *in, const refit_options *options)
{
    FREED_BY(free_fit) fit f = { .in = in, .o = *options };
    const char *why;

    begin_fit(&f);
    why = fit_all(&f);
    if (!why)
        why = write_fit(out, n, report, &f);
    return why;
}
