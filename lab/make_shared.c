/* SPDX-License-Identifier: MIT
 *
 * make_shared CAPTURE PRIMITIVES ITERATIONS: measures whether sharing anchors
 * among neighbouring primitives pays. After one warm-up, a process is forked
 * for each hierarchy and lambda, so that all start from the same primitives and
 * pictures. Each prints a line of JSON: row, factor (of the rule's lambda),
 * bytes, and PSNR of the sampled pictures with decoded symbols and weights.
 *
 *     own      each primitive has its own fine and coarse anchor; K = 1, as
 *              saga encodes
 *     shared   a coarse anchor has two fine anchors; a primitive interpolates
 *              4 fine anchors
 *     nearest  like shared, but a primitive reads only its own fine anchor
 *
 * The trainer shares anchors if there are fewer fine anchors than primitives;
 * here there is one less. There are one segment, seed 1, and one thread, since
 * a process with several threads cannot be forked.
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
/* The lambdas, relative to the rule's. Own anchors take all of them, shared
 * anchors the first N_SHARED. */
static const double factors[] = { 0.5, 1, 2, 4, 8, 16 };
enum { N_ROWS = 3, N_SHARED = 4, N_OWN = 6, OWN = 0, NEAREST = 2 };

static int fail(const char *why)
{
    fprintf(stderr, "make_shared: %s\n", why);
    return 1;
}

/* Stops the training at the end of the warm-up. */
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

/* Begins the rendering stage as the trainer does after the warm-up, with the
 * anchors and neighbours of a row, and `factor` times the rule's lambda. */
static bool begin(saga_train *t, int row, double factor, saga_error *error)
{
    const double n_pixels = saga_pictures_pixels(&t->pictures);

    if (row != OWN) {
        t->o.n_coarse = (t->o.n_primitives + 1) / 2;
        t->o.n_fine = t->o.n_primitives - 1;
    }
    /* Neighbours are set after the hierarchy is made, before the fit starts. */
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

/* Trains one row and prints its line. */
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

/* Trains a row in a child process, which starts from the warm-up's state. */
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
