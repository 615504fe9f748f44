/* SPDX-License-Identifier: MIT
 *
 * Teachers are warm-ups from other seeds, each with a share of the iterations.
 * They are trained before the warm-up of a segment if its cameras are far apart
 * (rig/novel.h), and freed when the segment ends. A still needs their pictures
 * until its rendering ends. In a moving scene only the warm-up sees them.
 */
#include "train_state.h"

#include "rng.h"
#include "warm_up.h"

/* Stream of random numbers (rng.h). */
enum { STREAM_TEACHER = 600 };

bool saga_train_place_teachers(saga_train *t, saga_error *error)
{
    t->warm.n_teachers = 0;
    if (saga_train_in_base(t) ||
        !saga_plan_may_teach(&t->o, &t->ablation, &t->pictures))
        return true;
    if (!saga_novel_init(&t->warm.novel, &t->pictures, error))
        return false;
    if (t->warm.novel.n_views > 0)
        t->warm.n_teachers = t->o.n_teachers;
    return true;
}

bool saga_train_is_teaching(const saga_train *t)
{
    return t->warm.novel.n_teachers < t->warm.n_teachers;
}

int saga_train_warm_iterations(const saga_train *t)
{
    return t->warm.n_teachers * saga_plan_teacher_length(t->o.n_warm) +
           t->o.n_warm;
}

int saga_train_warm_iteration(const saga_train *t)
{
    return t->warm.novel.n_teachers * saga_plan_teacher_length(t->o.n_warm) +
           saga_flat_iteration(t->warm.flat);
}

static saga_flat_options lesson(const saga_train *t)
{
    const saga_rng r = saga_rng_stream(t->o.seed, STREAM_TEACHER);
    saga_flat_options o = t->warm.options;

    o.n_iterations = saga_plan_teacher_length(t->o.n_warm);
    o.seed = saga_rng_bits(r, (uint64_t)t->warm.novel.n_teachers);
    return o;
}

/* Returns the options of the set in training: the next teacher, or the
 * warm-up. */
static saga_flat_options options_of(const saga_train *t)
{
    return saga_train_is_teaching(t) ? lesson(t) : t->warm.options;
}

double saga_train_warm_work(const saga_train *t, bool all)
{
    const saga_flat_options taught = lesson(t), now = options_of(t);
    const int n = all ? t->warm.n_teachers : t->warm.novel.n_teachers;
    const double before = n * saga_flat_work(&t->pictures, &taught,
                                             taught.n_iterations);

    return before + (all ? saga_flat_work(&t->pictures, &t->warm.options,
                                          t->warm.options.n_iterations)
                         : saga_flat_work(&t->pictures, &now,
                                          saga_flat_iteration(t->warm.flat)));
}

/* Only the warm-up sees the pictures that teachers draw; teachers do not. */
static void show(saga_train *t)
{
    t->pictures.novel = t->warm.n_teachers > 0 && !saga_train_is_teaching(t)
                            ? &t->warm.novel
                            : NULL;
}

bool saga_train_begin_warm(saga_train *t, saga_error *error)
{
    const saga_flat_options o = options_of(t);

    show(t);
    t->warm.flat = saga_flat_new(&t->pictures, &o, error);
    return t->warm.flat != NULL;
}

bool saga_train_end_teacher(saga_train *t, saga_error *error)
{
    saga_splat_params p;
    bool ok;

    if (!saga_train_is_teaching(t) || saga_flat_iteration(t->warm.flat) <
                                          saga_plan_teacher_length(t->o.n_warm))
        return true;
    p = saga_flat_params(t->warm.flat);
    ok = saga_novel_teach(&t->warm.novel, &p, saga_flat_count(t->warm.flat),
                          error);
    saga_flat_free(t->warm.flat);
    t->warm.flat = NULL;
    /* The mean error starts again with the next set. */
    t->recent_mse = 0;
    return ok && saga_train_begin_warm(t, error);
}

void saga_train_end_teaching(saga_train *t)
{
    if (!saga_plan_teaches_rendering(t->capture))
        t->pictures.novel = NULL;
}

void saga_train_save_warm(saga_train *t, saga_checkpoint *c)
{
    uint64_t n = (uint64_t)t->warm.n_teachers;

    saga_checkpoint_walk(c, &n, sizeof n);
    saga_novel_walk(&t->warm.novel, 0, c, NULL);
    saga_flat_save(t->warm.flat, c);
}

bool saga_train_load_warm(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    uint64_t n = 0;
    saga_flat_options o;

    /* The cameras of the teachers are placed again. The number of teachers is
     * read, because saga_train_peek has no pictures from which to decide it. */
    if (!saga_train_place_teachers(t, error))
        return false;
    saga_checkpoint_walk(c, &n, sizeof n);
    saga_novel_walk(&t->warm.novel, saga_caps[t->o.level].n_prim, c, error);
    if (n > SAGA_NOVEL_MOST_TEACHERS || (int)n < t->warm.novel.n_teachers ||
        (n > 0 && t->warm.novel.n_views == 0))
        c->failed = true;
    if (c->failed)
        return false;
    t->warm.n_teachers = (int)n;
    o = options_of(t);
    show(t);
    t->warm.flat = saga_flat_restore(&t->pictures, &o, c, error);
    return t->warm.flat != NULL;
}
