/* SPDX-License-Identifier: MIT
 *
 * What the next pass compares with: a stored picture, which the device has or
 * gets, or that of teachers.
 */
#include "gpu_state.h"

/* Teachers are drawn by a canvas of their own, since the warm-up's primitives
 * stay on g. It keeps their attributes, and adds to the mean on g. */
static const char what[] = "teachers";

static size_t teacher_nbytes(uint32_t attrs, uint32_t n)
{
    return saga_attrs_width(attrs) * n * sizeof(real);
}

static bool make_teachers(saga_gpu_canvas *g, saga_error *error)
{
    if (!g->teachers)
        g->teachers = saga_gpu_canvas_new(g->gpu, g->pictures, error);
    return g->teachers;
}

static bool teacher_room(saga_gpu_canvas *t, int k, uint32_t attrs, uint32_t n,
                         saga_error *error)
{
    const size_t nbytes = teacher_nbytes(attrs, n);

    return saga_gpu_grow(&t->teacher[k], t->gpu, nbytes, SAGA_GPU_LOCAL, what,
                         error) &&
           saga_gpu_room(t, GPU_VALUE, nbytes, what, error) &&
           saga_gpu_grow(&t->up, t->gpu, nbytes, SAGA_GPU_UP, what, error) &&
           saga_gpu_grow(&t->down, t->gpu, SAGA_GPU_N_TOTALS * sizeof(uint32_t),
                         SAGA_GPU_DOWN, what, error);
}

/* Copies teacher k to the device when it is first drawn. */
static bool keep_teacher(saga_gpu_canvas *t, int k, const saga_novel *o,
                         saga_error *error)
{
    const uint32_t attrs = saga_attrs_of(&o->teacher[k]);

    if (t->teacher[k].buffer)
        return true;
    if (!teacher_room(t, k, attrs, o->n[k], error))
        return false;
    saga_gpu_pack(t->up.map, &o->teacher[k], o->n[k]);
    saga_gpu_begin(t->gpu);
    saga_gpu_copy(t->gpu, &t->teacher[k], 0, &t->up, 0,
                  teacher_nbytes(attrs, o->n[k]));
    return saga_gpu_finish(t->gpu, error);
}

/* Draws teacher k as the canvas o->canvas sees it. */
static bool draw_teacher(saga_gpu_canvas *t, int k, const saga_novel *o,
                         saga_error *error)
{
    const uint32_t attrs = saga_attrs_of(&o->teacher[k]);
    saga_gpu_pass pass = { .canvas = &o->canvas };

    if (!keep_teacher(t, k, o, error))
        return false;
    saga_gpu_set_frame(t, &o->canvas, attrs, o->n[k]);
    t->frame.draws = 1;
    t->from = &t->teacher[k];
    t->n_from = teacher_nbytes(attrs, o->n[k]);
    while (saga_gpu_begin_pass(&pass, t, error)) {
        saga_gpu_record_lists(t);
        saga_gpu_record_tiles(t);
        saga_gpu_end_pass(&pass, t, error);
    }
    return pass.is_done;
}

/* Adds the picture that the teachers' canvas has to the truth of g. */
static bool add_picture(saga_gpu_canvas *g, int k, const saga_novel *o,
                        saga_error *error)
{
    const saga_gpu_canvas *const t = g->teachers;
    const size_t pixels = (size_t)t->frame.width * t->frame.height;
    const uint32_t push[] = { (uint32_t)o->n_teachers, (uint32_t)k };

    saga_gpu_begin(g->gpu);
    saga_gpu_run(
        g->gpu,
        &(saga_gpu_job){ .kernel = SAGA_KERNEL_MEAN,
                         .buffer = { &t->on[GPU_FRAME], &t->on[GPU_IMAGE],
                                     &g->on[GPU_TRUTH] },
                         .push = push,
                         .push_nbytes = sizeof push,
                         .n_groups = (uint32_t)saga_gpu_groups(3 * pixels) });
    return saga_gpu_finish(g->gpu, error);
}

/* Has the teachers' mean picture as the truth. */
static bool draw_teachers(saga_gpu_canvas *g, saga_canvas *canvas,
                          saga_error *error)
{
    saga_novel *const o = g->pictures->novel;

    if (!make_teachers(g, error))
        return false;
    o->canvas.camera = canvas->camera;
    o->canvas.t = canvas->t;
    for (int k = 0; k < o->n_teachers; k++)
        if (!draw_teacher(g->teachers, k, o, error) ||
            !add_picture(g, k, o, error))
            return false;
    canvas->n_unseen = 0;
    g->is_stored = g->is_new = false;
    return true;
}

bool saga_gpu_show(saga_gpu_canvas *g, saga_canvas *canvas, saga_sample sample,
                   saga_error *error)
{
    const saga_pictures *const p = g->pictures;

    saga_pictures_aim(canvas, p, sample);
    return saga_novel_is(p, sample)
               ? draw_teachers(g, canvas, error)
               : saga_gpu_show_stored(g, canvas, sample, error);
}

bool saga_gpu_teachers_room(saga_gpu_canvas *g, const saga_canvas *c,
                            uint32_t attrs, uint32_t n, int n_teachers,
                            saga_error *error)
{
    if (n_teachers > 0 && !make_teachers(g, error))
        return false;
    for (int k = 0; k < n_teachers; k++)
        if (!teacher_room(g->teachers, k, attrs, n, error) ||
            !saga_gpu_pass_room(g->teachers, c, attrs, n, error))
            return false;
    return true;
}
