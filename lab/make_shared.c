/* SPDX-License-Identifier: MIT
 *
 * make_shared CAPTURE PRIMITIVES ITERATIONS: what sharing anchors by place is
 * worth. One warm-up; from its end a process of its own for each hierarchy and
 * lambda, so that primitives and pictures are the same. Prints a line of JSON
 * for each: row, factor (of the rule's lambda), bytes, and PSNR of the decoded
 * symbols and weights on the sampled pictures.
 *
 *     own      an anchor of each level for a primitive; K 1, as saga encodes
 *     shared   1:2:2, a coarse anchor for two; primitives take 4 fine anchors
 *     nearest  the same, each takes its own fine anchor alone: K 1
 *
 * One fine anchor less than primitives is what tells the trainer that they are
 * shared. One segment, seed 1, one thread: a process is forked.
 */
#include "capture_load.h"
#include "error.h"
#include "fit_state.h"
#include "policy.h"
#include "start.h"
#include "train.h"
#include "train_state.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static const char *const names[] = { "own", "shared", "nearest" };
/* Shared anchors end where anchors of one's own have a quarter of the bits. */
static const double factors[] = { 0.5, 1, 2, 4, 8, 16 };
enum { N_ROWS = 3, N_SHARED = 4, N_OWN = 6, OWN = 0, NEAREST = 2 };

static int fail(const char *why)
{
    fprintf(stderr, "make_shared: %s\n", why);
    return 1;
}

/* Stops at the end of the warm-up, before what follows from it. */
static bool until_warm(void *user, const saga_train_progress *p)
{
    (void)user;
    return p->stage != SAGA_TRAIN_WARM || p->iteration < p->n_iterations;
}

static void take_nearest(saga_model *m)
{
    m->tier[SAGA_TIER_FINE].neighbours = 1;
    m->tier[SAGA_TIER_FINE].window = 0;
}

/* Begins the rendering, as the trainer does after the warm-up, with anchors
 * and neighbours of a row and a price beside the rule's. */
static bool begin(saga_train *t, int row, double factor, saga_error *error)
{
    const double n_pixels = saga_pictures_pixels(&t->pictures);

    if (row != OWN) {
        t->o.n_coarse = (t->o.n_primitives + 1) / 2;
        t->o.n_fine = t->o.n_primitives - 1;
    }
    t->n_pixels = n_pixels;
    t->lambda = factor * saga_policy_lambda(t->recent_mse, n_pixels,
                                            t->o.n_primitives);
    t->policy = saga_policy_of(t->lambda, n_pixels, t->o.n_primitives);
    if (!saga_train_decide(t, error) || !saga_train_begin_fit(t, error))
        return false;
    if (row == NEAREST) {
        take_nearest(&t->scene.model);
        take_nearest(&t->fit->used.model);
    }
    if (!saga_fit_start(t->fit, &t->target, error))
        return false;
    t->recent_mse = 0;
    t->stage = SAGA_TRAIN_RENDER;
    return true;
}

/* Trains and tells one row. */
static int train_row(saga_train *t, int row, double factor)
{
    saga_error error = { "" };
    const saga_train_report *r;
    size_t n;

    if (!begin(t, row, factor, &error) ||
        saga_train_run(t, &error) != SAGA_DONE)
        return fail(error.message);
    r = saga_train_report_of(t);
    saga_train_bytes(t, &n);
    printf("{\"row\": \"%s\", \"factor\": %g, \"coarse\": %u, \"fine\": %u, "
           "\"primitives\": %u, \"bytes\": %zu, \"training\": %.3f, "
           "\"held_out\": %.3f}\n", names[row], factor, r->n.coarse,
           r->n.fine, r->n.prim, n, r->coded.training, r->coded.held_out);
    return fflush(stdout) ? fail("no room for the output") : 0;
}

/* The child has the warm-up's memory as it is. */
static int fork_row(saga_train *t, int row, double factor)
{
    const pid_t child = fork();
    int status;

    if (child < 0)
        return fail("no process more can be started");
    if (!child)
        _exit(train_row(t, row, factor));
    return waitpid(child, &status, 0) != child || status
        ? fail("a row failed") : 0;
}

static int train_rows(saga_train *t)
{
    for (int i = 0; i < N_OWN; i++) {
        for (int row = 0; row < (i < N_SHARED ? N_ROWS : 1); row++) {
            if (fork_row(t, row, factors[i]))
                return 1;
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    saga_capture_options c = saga_capture_defaults();
    saga_train_options o = saga_train_defaults();
    saga_error error = { "" };
    saga_capture capture;
    saga_train *t;
    int status;

    if (argc != 4 || atoi(argv[2]) < 4 || atoi(argv[3]) < 5) {
        fprintf(stderr, "usage: make_shared CAPTURE PRIMITIVES ITERATIONS\n"
                "with 4 and 5 at least\n");
        return 2;
    }
    o.n_primitives = (uint32_t)atoi(argv[2]);
    o.n_iterations = atoi(argv[3]);
    o.seed = 1;
    o.progress = until_warm;
    if (!saga_capture_load(&capture, argv[1], &c, &error))
        return fail(error.message);
    t = saga_train_new(&capture, &o, &error);
    status = !t || saga_train_run(t, &error) != SAGA_STOPPED
        ? fail(error.message) : train_rows(t);
    saga_train_free(t);
    saga_capture_free(&capture);
    return status;
}
