/* SPDX-License-Identifier: MIT
 *
 * make_refit IN.saga OUT.saga [--ablate LIST] [--keep] [--iterations N]
 *     [--seed N]
 *
 * make_refit codes the scene of IN with newly trained entropy networks
 * (lab/gen_refit.h). Its options are those of `saga encode`, and --keep, which
 * keeps sources even if their weights take more than they save. It prints JSON:
 * the bytes of each component before and after, and the sources that were kept.
 */
#include "file_json.h"
#include "gen_refit.h"

#include "error.h"
#include "file.h"
#include "output.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int fail(const char *why)
{
    fprintf(stderr, "make_refit: %s\n", why);
    return 1;
}

static int usage(const saga_error *error)
{
    if (saga_failed(error))
        fail(error->message);
    fprintf(stderr, "usage: make_refit IN.saga OUT.saga [--ablate LIST] "
                    "[--keep]\n    [--iterations N] [--seed N]\n");
    return 2;
}

/* --- Options ------------------------------------------------------------- */

static bool set_number(refit_options *o, const char *name, const char *value)
{
    char *rest;
    const long n = strtol(value, &rest, 10);

    if (*rest || rest == value)
        return false;
    if (!strcmp(name, "--iterations")) {
        o->iterations = (int)n;
        return n >= 3 && n <= 1000000;
    }
    o->seed = (uint64_t)n;
    return !strcmp(name, "--seed") && n >= 0;
}

static bool read_options(refit_options *o, int argc, char **argv,
                         saga_error *error)
{
    for (int i = 0; i < argc; i++) {
        const char *const name = argv[i];

        if (!strcmp(name, "--keep")) {
            o->keep = true;
            continue;
        }
        if (++i == argc ||
            !(strcmp(name, "--ablate")
                  ? set_number(o, name, argv[i])
                  : saga_ablation_read(&o->ablation, argv[i], error)))
            return false;
    }
    return true;
}

/* --- Report -------------------------------------------------------------- */

/* Returns the estimated bytes of a kind, in the form of `saga encode --json`.
 */
static json_t *kind_of(const refit_report *r, int kind)
{
    const saga_rate_gain *const g = &r->decision.gain[kind];

    return json_pack("{sisfsfsfsf}", "sources", (int)r->sources[kind],
                     "constants", g->constants / 8, "networks", g->networks / 8,
                     "chosen", g->chosen / 8, "weights", g->weights / 8);
}

static void print(const ref_file *in, const ref_file *out, size_t n_in,
                  size_t n_out, const refit_report *r)
{
    static const char *const keys[SAGA_N_KINDS] = { "coarse", "fine",
                                                    "primitives" };
    json_t *const o = json_pack("{sososIsI}", "before", file_json_parts(in),
                                "after", file_json_parts(out), "bytes_before",
                                (json_int_t)n_in, "bytes", (json_int_t)n_out);
    json_t *const kinds = json_object();

    for (int i = 0; i < SAGA_N_KINDS; i++)
        json_object_set_new(kinds, keys[i], kind_of(r, i));
    json_object_set_new(kinds, "hyperprior_weights",
                        json_real(r->decision.hyper_weights / 8));
    json_object_set_new(o, "entropy_model", kinds);
    json_dumpf(o, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    putchar('\n');
    json_decref(o);
}

static int write_bytes(const char *name, const uint8_t *bytes, size_t n)
{
    saga_error error = { "" };
    saga_output out;

    return saga_output_open(&out, name, &error) &&
                   saga_output_close(&out, fwrite(bytes, 1, n, out.file) == n,
                                     &error)
               ? 0
               : fail(error.message);
}

/* --- Main ---------------------------------------------------------------- */

static int refit(const ref_file *in, size_t n_in, const char *name,
                 const refit_options *o)
{
    refit_report report;
    ref_file again;
    uint8_t *bytes;
    size_t n;
    const char *why = refit_make(&bytes, &n, &report, in, o);
    int status;

    if (why)
        return fail(why);
    /* The new file is decoded before it is written. */
    why = ref_file_read(&again, bytes, n);
    status = why ? fail(why) : write_bytes(name, bytes, n);
    free(bytes);
    if (why)
        return status;
    if (!status)
        print(in, &again, n_in, n, &report);
    ref_file_free(&again);
    return status;
}

int main(int argc, char **argv)
{
    refit_options o = refit_defaults();
    saga_error error = { "" };
    saga_bytes bytes;
    ref_file in;
    const char *why;
    int status;

    if (argc < 3 || !read_options(&o, argc - 3, argv + 3, &error))
        return usage(&error);
    if (!saga_read_file(&bytes, argv[1], &error))
        return fail(error.message);
    why = ref_file_read(&in, bytes.data, bytes.nbytes);
    if (why)
        return fail(why);
    status = refit(&in, bytes.nbytes, argv[2], &o);
    ref_file_free(&in);
    saga_bytes_free(&bytes);
    return status;
}
