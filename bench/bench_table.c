/* SPDX-License-Identifier: MIT
 *
 * This program times the operators of decoder and trainer, and iterations of
 * the training, all or those of the given parts, and prints one table, and
 * JSON.
 *
 *     bench_table [-o OUT.json] [-b BEFORE.json] [PART...]
 *
 * Each row has the best and the median repetition in ms of CPU time of one
 * thread; the time for one unit; the rate, and its share of this machine's
 * ceiling (the first rows); the target time; and how many times faster it is
 * than in an earlier result.
 */
#include "bench_table.h"

#include <stdio.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

enum { MAX_ROWS = 160, REPETITIONS = 15 };

static bench_row rows[MAX_ROWS];
static int n_rows;

static const struct {
    const char *name;
    void (*run)(void);
} parts[] = { { "ceilings", bench_ceilings }, { "mlp", bench_mlp },
              { "coder", bench_coder },       { "stages", bench_stages },
              { "net", bench_net },           { "splat", bench_splat },
              { "train", bench_train },       { "gpu", bench_gpu } };

enum { N_PARTS = sizeof parts / sizeof *parts };

bench_row *bench_row_add(const char *name, bench_times *times)
{
    bench_row *const r = rows + n_rows;

    if (n_rows + 1 < MAX_ROWS)
        n_rows++;
    memset(r, 0, sizeof *r);
    snprintf(r->name, sizeof r->name, "%s", name);
    r->median = bench_median(times);
    r->best = times->ms[0];
    r->count = 1;
    r->each = "";
    return r;
}

bench_row *bench_measure(const char *name, void (*stage)(void *), void *data)
{
    bench_times times = { .n = 0 };

    for (int i = 0; i < REPETITIONS; i++) {
        const double start = bench_now_ms();

        stage(data);
        bench_add(&times, bench_now_ms() - start);
    }
    return bench_row_add(name, &times);
}

void *bench_need(size_t nbytes)
{
    void *const p = aligned_alloc(64, (nbytes + 63) & ~(size_t)63);

    if (!p) {
        fprintf(stderr, "bench_table: out of memory\n");
        exit(1);
    }
    memset(p, 1, nbytes);
    return p;
}

/* --- The table ----------------------------------------------------------- */

static int is_ceiling(const bench_row *r)
{
    return !strncmp(r->name, "ceiling", 7);
}

/* Returns the most work of a kind that this machine does in a millisecond, by
 * the first row of bench_ceilings for it. */
static double ceiling(bench_kind kind)
{
    for (int i = 0; i < n_rows; i++)
        if (rows[i].kind == kind && is_ceiling(rows + i))
            return rows[i].work / rows[i].best;
    return 0;
}

/* Returns the best time of a row in an earlier result, or 0 if it has no such
 * row. */
static double before(const char *path, const char *name)
{
    FILE *const f = path ? fopen(path, "r") : NULL;
    char line[300], found[56];
    double best, answer = 0;

    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, " {\"name\": \"%55[^\"]\", \"best_ms\": %lf", found,
                   &best) == 2 &&
            !strcmp(found, name))
            answer = best;
    if (f)
        fclose(f);
    return answer;
}

static void print_row(const bench_row *r, const char *path)
{
    static const char *const unit[BENCH_N_KINDS] = { "", "Gadd/s", "GB/s",
                                                     "GMAC/s", "GFLOP/s" };
    const double top = ceiling(r->kind), old = before(path, r->name);
    const double cycle = ceiling(BENCH_CYCLES);

    /* A column without a value is left blank. */
    printf("%-40s %9.3f %9.3f", r->name, r->best, r->median);
    if (r->each[0])
        printf(" %9.2f %-11s %9.1f", 1e6 * r->best / r->count, r->each,
               r->best / r->count * cycle);
    else
        printf(" %9s %-11s %9s", "", "", "");
    if (r->work > 0)
        printf(" %7.1f %-7s", 1e-6 * r->work / r->best, unit[r->kind]);
    else
        printf(" %7s %-7s", "", "");
    if (r->work > 0 && top > 0 && !is_ceiling(r))
        printf(" %5.0f %%", 100 * r->work / r->best / top);
    else
        printf(" %7s", "");
    if (r->wanted > 0)
        printf(" %8.2f", r->wanted);
    else
        printf(" %8s", "");
    if (old > 0)
        printf(" %6.2fx", old / r->best);
    printf("%s%s\n", r->note[0] ? "  " : "", r->note);
}

static void print_table(const char *path)
{
    printf("%-40s %9s %9s %9s %-11s %9s %15s %7s %8s %s\n", "", "best ms",
           "median", "ns", "", "cycles", "rate", "of top", "wanted",
           path ? "before" : "");
    for (int i = 0; i < n_rows; i++)
        print_row(rows + i, path);
}

static int write_json(const char *path)
{
    FILE *const f = fopen(path, "w");

    if (!f)
        return 0;
    fprintf(f, "[\n");
    for (int i = 0; i < n_rows; i++) {
        const bench_row *const r = rows + i;
        const double top = ceiling(r->kind);

        fprintf(f,
                "  {\"name\": \"%s\", \"best_ms\": %.6f, "
                "\"median_ms\": %.6f, \"count\": %.0f, \"work\": %.0f, "
                "\"of_ceiling\": %.4f, \"wanted_ms\": %.3f}%s\n",
                r->name, r->best, r->median, r->count, r->work,
                top > 0 ? r->work / r->best / top : 0, r->wanted,
                i + 1 < n_rows ? "," : "");
    }
    fprintf(f, "]\n");
    return fclose(f) == 0;
}

static int is_part(const char *name)
{
    for (int i = 0; i < N_PARTS; i++)
        if (!strcmp(name, parts[i].name))
            return 1;
    return 0;
}

/* Runs the named parts, or all if none is named. The ceilings always run. */
static void run_parts(char **names, int n)
{
    for (int i = 0; i < N_PARTS; i++) {
        int wanted = n == 0 || i == 0;

        for (int k = 0; k < n; k++)
            wanted |= !strcmp(names[k], parts[i].name);
        if (wanted)
            parts[i].run();
    }
}

static int usage(void)
{
    fprintf(stderr, "usage: bench_table [-o OUT.json] [-b BEFORE.json] "
                    "[PART...]\nparts:");
    for (int i = 0; i < N_PARTS; i++)
        fprintf(stderr, " %s", parts[i].name);
    fprintf(stderr, "\n");
    return 2;
}

int main(int argc, char **argv)
{
    const char *out = NULL, *old = NULL;
    int i = 1;

    for (; i < argc && argv[i][0] == '-'; i += 2) {
        const char **const path = !strcmp(argv[i], "-o")   ? &out
                                  : !strcmp(argv[i], "-b") ? &old
                                                           : NULL;

        if (!path) {
            fprintf(stderr, "bench_table: unknown option '%s'\n", argv[i]);
            return usage();
        }
        if (i + 1 == argc) {
            fprintf(stderr, "bench_table: %s needs a file name\n", argv[i]);
            return usage();
        }
        *path = argv[i + 1];
    }
    for (int k = i; k < argc; k++)
        if (!is_part(argv[k])) {
            fprintf(stderr, "bench_table: unknown part '%s'\n", argv[k]);
            return usage();
        }
#ifdef _OPENMP
    omp_set_num_threads(1);
#endif
    run_parts(argv + i, argc - i);
    print_table(old);
    if (out && !write_json(out)) {
        fprintf(stderr, "bench_table: %s: cannot be written\n", out);
        return 2;
    }
    return 0;
}
