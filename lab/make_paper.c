/* SPDX-License-Identifier: MIT
 *
 * make_paper CAPTURE PRIMITIVES WARM RENDER JOBS ROW:FACTOR...: trains the
 * paper's whole model (`saga encode --model paper`) without one part after the
 * other. After one warm-up of WARM iterations, a process is forked for each
 * row, JOBS at once, so that all rows start from the same primitives and
 * pictures. Each has RENDER iterations and prints a line of JSON: the row, its
 * factor of the rule's lambda, its tools, bytes, those of networks, and PSNR
 * of the sampled pictures with decoded symbols and weights.
 *
 * A row is "full", or "flat", where each primitive has features of its own
 * (`--model auto`), or a word of --ablate such as "no-hash" or "slots=32".
 *
 * There are one segment, seed 1, and one thread, since a process with several
 * threads cannot be forked.
 */
#include "capture_load.h"
#include "error.h"
#include "train.h"
#include "train_state.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static int fail(const char *why)
{
    fprintf(stderr, "make_paper: %s\n", why);
    return 1;
}

/* Stops the training at the end of the warm-up. */
static bool until_warm(void *user, const saga_train_progress *p)
{
    (void)user;
    return p->stage != SAGA_TRAIN_WARM || p->iteration < p->n_iterations;
}

/* Gives the training a row's model and price. The warm-up depends on neither,
 * so this is what it would have if it had been started with them. */
static bool choose(saga_train *t, const char *row, double factor,
                   saga_error *error)
{
    t->o.paper = strcmp(row, "flat") != 0;
    t->o.ablate = t->o.paper && strcmp(row, "full") != 0 ? row : NULL;
    if (!saga_options_ablation(&t->ablation, &t->o, error))
        return false;
    /* The numbers of anchors are derived again for this model. */
    t->o.n_coarse = t->o.n_fine = 0;
    saga_options_derive(&t->o);
    t->o.progress = NULL;
    saga_train_settle_price(t);
    t->policy.lambda *= factor;
    return true;
}

/* Trains one row and prints its line. */
static int train_row(saga_train *t, const char *row, double factor)
{
    saga_error error = { "" };
    const saga_train_report *r;
    size_t n;

    if (!choose(t, row, factor, &error) ||
        saga_train_run(t, &error) != SAGA_DONE)
        return fail(error.message);
    r = saga_train_report_of(t);
    saga_train_bytes(t, &n);
    printf("{\"row\": \"%s\", \"factor\": %g, \"lambda\": %g, "
           "\"fine\": %u, \"primitives\": %u, \"tools\": %u, "
           "\"iterations\": [%d, %d], \"bytes\": %zu, \"networks\": %zu, "
           "\"warm_up\": %.3f, \"training\": %.3f, \"held_out\": %.3f}\n",
           row, factor, r->lambda, r->n.fine, r->n.prim,
           t->render.scene.model.tools, t->o.n_warm, t->o.n_render, n,
           r->sizes.networks, r->warm.training, r->coded.training,
           r->coded.held_out);
    return fflush(stdout) ? fail("no room for the output") : 0;
}

/* Trains ROW:FACTOR in a process that starts from the warm-up's state. */
static bool fork_row(saga_train *t, char *text)
{
    char *const colon = strchr(text, ':');
    const double factor = colon ? strtod(colon + 1, NULL) : 1;
    const pid_t child = fork();

    if (child < 0)
        return fail("no process more can be started"), false;
    if (child)
        return true;
    if (colon)
        *colon = '\0';
    _exit(train_row(t, text, factor));
}

/* Trains all rows, `jobs` at once. A row that fails does not stop the rest. */
static int train_rows(saga_train *t, char **rows, int n, int jobs)
{
    int started = 0, failed = 0;

    for (int done = 0; done < n; done++) {
        int status;

        while (started < n && started - done < jobs) {
            if (!fork_row(t, rows[started++]))
                return 1;
        }
        if (wait(&status) < 0 || status)
            failed = 1;
    }
    return failed ? fail("a row failed") : 0;
}

int main(int argc, char **argv)
{
    saga_capture_options c = saga_capture_defaults();
    saga_train_options o = saga_train_defaults();
    saga_error error = { "" };
    saga_capture capture;
    saga_train *t;
    int status;

    for (int i = 2; i < 6; i++) {
        if (argc < 7 || atoi(argv[i]) < 1) {
            fprintf(stderr, "usage: make_paper CAPTURE PRIMITIVES WARM RENDER "
                            "JOBS ROW:FACTOR...\nwith numbers of 1 at least\n");
            return 2;
        }
    }
    o.n_primitives = (uint32_t)atoi(argv[2]);
    o.n_warm = atoi(argv[3]);
    o.n_render = atoi(argv[4]);
    o.seed = 1;
    o.level = 3; /* the lowest with 256 and 512 slots */
    o.progress = until_warm;
    if (!saga_capture_load(&capture, argv[1], &c, &error))
        return fail(error.message);
    t = saga_train_new(&capture, &o, &error);
    status = !t || saga_train_run(t, &error) != SAGA_STOPPED
                 ? fail(error.message)
                 : train_rows(t, argv + 6, argc - 6, atoi(argv[5]));
    saga_train_free(t);
    saga_capture_free(&capture);
    return status;
}
