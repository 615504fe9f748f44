/* SPDX-License-Identifier: MIT
 *
 * make_times FILE.saga [REPETITIONS]: prints, as JSON, how long the parts of a
 * file with one segment take to decode, in milliseconds of CPU time of one
 * thread, the best of REPETITIONS (default 9). `coarse`, `fine` and
 * `primitives` are the chunks of the tiers: coder, entropy networks and bank,
 * and for `fine` F_fine. `reconstruction` is the rest of the decoding time.
 */
#include "ref_file.h"

#include "error.h"
#include "file.h"
#include "range_dec.h"
#include "saga.h"
#include "syntax.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { DECODE = REF_N_CHUNKS, N_TIMES };

static double now_ms(void)
{
    struct timespec t;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static int fail(const char *why)
{
    fprintf(stderr, "make_times: %s\n", why);
    return 1;
}

static int run_chunk(const ref_file *f, int chunk)
{
    const ref_span at = f->chunk[chunk];
    saga_range_dec range;
    int ok;

    saga_range_dec_init(&range, at.p, at.n);
    ok = chunk == REF_NETWORKS
             ? saga_syntax_networks(&f->shapes, f->params, &range.coder)
             : saga_syntax_part(&f->sc, chunk - REF_COARSE, &range.coder);
    return ok && saga_range_dec_finish(&range);
}

/* Times the decoding of the segment by saga_decode. */
static int run_decoder(double *ms, const saga_bytes *in)
{
    saga_decoder *dec;
    saga_segment seg;
    saga_info info;
    void *work;
    double begin;
    int ok;

    if (saga_probe(&info, in->data, in->nbytes) ||
        saga_find(&seg, in->data, in->nbytes, 0, 1))
        return 0;
    work = aligned_alloc(64, (info.work_nbytes + 63) / 64 * 64);
    ok = work &&
         !saga_open(&dec, work, info.work_nbytes, in->data, in->nbytes, NULL);
    begin = now_ms();
    ok = ok && !saga_decode(dec, &seg, in->data + seg.offset, seg.nbytes, NULL);
    *ms = fmin(*ms, now_ms() - begin);
    free(work);
    return ok;
}

static int time_film(double best[N_TIMES], const ref_file *f,
                     const saga_bytes *in)
{
    saga_syntax_begin(&f->sc);
    for (int i = 0; i < REF_N_CHUNKS; i++) {
        const double begin = now_ms();

        if (!run_chunk(f, i))
            return 0;
        best[i] = fmin(best[i], now_ms() - begin);
    }
    return run_decoder(&best[DECODE], in);
}

static void print(const double best[N_TIMES])
{
    const double layers = best[REF_COARSE] + best[REF_FINE] + best[REF_PRIM];
    json_t *const o = json_pack(
        "{sfsfsfsfsfsf}", "networks", best[REF_NETWORKS], "coarse",
        best[REF_COARSE], "fine", best[REF_FINE], "primitives", best[REF_PRIM],
        "reconstruction", fmax(0, best[DECODE] - layers), "decode",
        best[DECODE]);

    json_dumpf(o, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(5));
    putchar('\n');
    json_decref(o);
}

int main(int argc, char **argv)
{
    const int repetitions = argc > 2 ? atoi(argv[2]) : 9;
    saga_error error = { "" };
    double best[N_TIMES];
    saga_bytes in;
    ref_file f;
    const char *why;
    int ok = 1;

    if (argc < 2 || argc > 3 || repetitions < 1) {
        fprintf(stderr, "usage: make_times FILE.saga [REPETITIONS]\n");
        return 2;
    }
    if (!saga_read_file(&in, argv[1], &error))
        return fail(error.message);
    why = ref_file_read(&f, in.data, in.nbytes);
    if (why)
        return fail(why);
    for (int i = 0; i < N_TIMES; i++)
        best[i] = HUGE_VAL;
    for (int i = 0; ok && i < repetitions; i++)
        ok = time_film(best, &f, &in);
    ref_file_free(&f);
    saga_bytes_free(&in);
    if (!ok)
        return fail("it cannot be decoded again");
    print(best);
    return 0;
}
