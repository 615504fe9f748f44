/* SPDX-License-Identifier: MIT */
#include "bytes_table.h"

#include "json_memory.h"

#include <inttypes.h>
#include <stdio.h>

enum { N_ROWS = 11 };

typedef struct {
    const char *name, *key;
    uint64_t nbytes;
} row;

static void fill(row rows[N_ROWS], const saga_layout *l)
{
    const row all[N_ROWS] = {
        { "header and rig", "header", l->header_nbytes },
        { "index", "index", l->index_nbytes },
        { "networks", "networks", l->nets_nbytes },
        { "base", "base", (uint64_t)l->base_nbytes[SAGA_PART_COARSE] +
          l->base_nbytes[SAGA_PART_FINE] + l->base_nbytes[SAGA_PART_PRIM] },
        { "names", "names", l->names_nbytes },
        { "coarse anchors", "coarse", l->part_nbytes[SAGA_PART_COARSE] },
        { "fine anchors", "fine", l->part_nbytes[SAGA_PART_FINE] },
        { "primitives", "primitives", l->part_nbytes[SAGA_PART_PRIM] },
        { "segment headers", "segment_headers",
          l->part_nbytes[SAGA_PART_SEGMENT] },
        { "chunk headers", "chunk_headers", l->framing_nbytes },
        { "in no sound chunk", "other", l->other_nbytes }
    };

    for (int i = 0; i < N_ROWS; i++)
        rows[i] = all[i];
}

void saga_bytes_table_print(const saga_layout *layout)
{
    row rows[N_ROWS];

    fill(rows, layout);
    puts("\nbytes");
    for (int i = 0; i < N_ROWS; i++)
        if (rows[i].nbytes)
            printf("  %-18s %12" PRIu64 "  %5.1f %%\n", rows[i].name,
                   rows[i].nbytes, 100.0 * (double)rows[i].nbytes /
                   (double)layout->file_nbytes);
}

json_t *saga_bytes_table_json(const saga_layout *layout)
{
    json_t *const o = json_object();
    row rows[N_ROWS];

    fill(rows, layout);
    for (int i = 0; i < N_ROWS; i++)
        saga_json_set_value(o, rows[i].key,
                            json_integer((json_int_t)rows[i].nbytes));
    return o;
}
