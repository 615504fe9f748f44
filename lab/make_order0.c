/* SPDX-License-Identifier: MIT
 *
 * make_order0 FILE.saga: prints, as JSON, the bytes of each component in the
 * file and by an adaptive order-0 coder (lab/gen_order0.h). `saving` is the
 * fraction of the order-0 bytes that the file saves, after the bytes of its
 * entropy networks are added to it.
 */
#include "file_json.h"
#include "gen_order0.h"

#include "error.h"
#include "file.h"

#include <jansson.h>
#include <stdio.h>

static json_t *row_of(const order0_row *r)
{
    return json_pack("{sIsfsfsf}", "symbols", (json_int_t)r->n, "saga",
                     r->saga / 8, "order0", r->adaptive / 8, "entropy0",
                     r->entropy / 8);
}

static void add(order0_row *sum, const order0_row *r)
{
    sum->n += r->n;
    sum->saga += r->saga;
    sum->adaptive += r->adaptive;
    sum->entropy += r->entropy;
}

static json_t *total_of(const order0_row *r, double networks)
{
    json_t *const o = row_of(r);

    json_object_set_new(o, "saving",
                        json_real(1 - (r->saga + networks) / r->adaptive));
    return o;
}

static void print(const ref_file *f, size_t n)
{
    json_t *const o = json_object(), *const kinds = json_object();
    order0_row row[SAGA_N_COMPONENTS], values = { 0 }, structure = { 0 }, all;
    const double networks = file_json_nets(f, true).bits;

    /* Structure and values have sums of their own (gen_order0.h). */
    order0_file(row, f);
    for (int i = SAGA_COMPONENT_TREE; i < SAGA_N_COMPONENTS; i++) {
        const saga_component c = (saga_component)i;

        add(order0_is_structure(c) ? &structure : &values, &row[i]);
        json_object_set_new(kinds, saga_component_key(c), row_of(&row[i]));
    }
    all = structure;
    add(&all, &values);
    json_object_set_new(o, "bytes", json_integer((json_int_t)n));
    json_object_set_new(o, "kinds", kinds);
    json_object_set_new(o, "values", total_of(&values, networks));
    json_object_set_new(o, "structure", total_of(&structure, 0));
    json_object_set_new(o, "all", total_of(&all, networks));
    json_object_set_new(o, "networks", file_json_networks(f));
    json_dumpf(o, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    putchar('\n');
    json_decref(o);
}

int main(int argc, char **argv)
{
    saga_error error = { "" };
    saga_bytes in;
    ref_file f;
    const char *why;

    if (argc != 2) {
        fprintf(stderr, "usage: make_order0 FILE.saga\n");
        return 2;
    }
    if (!saga_read_file(&in, argv[1], &error))
        why = error.message;
    else
        why = ref_file_read(&f, in.data, in.nbytes);
    if (why) {
        fprintf(stderr, "make_order0: %s\n", why);
        return 1;
    }
    print(&f, in.nbytes);
    ref_file_free(&f);
    saga_bytes_free(&in);
    return 0;
}
