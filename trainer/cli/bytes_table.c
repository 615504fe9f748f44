/* SPDX-License-Identifier: MIT */
#include "bytes_table.h"

enum { N_ROWS = 14 };

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
        { "base", "base",
          (uint64_t)l->base_nbytes[SAGA_PART_COARSE] +
              l->base_nbytes[SAGA_PART_FINE] + l->base_nbytes[SAGA_PART_PRIM] },
        { "names", "names", l->names_nbytes },
        { "exposures", "exposures", l->exposures_nbytes },
        { "sound", "sound", l->sound_nbytes },
        { "viewing volume", "volume", l->volume_nbytes },
        { "coarse anchors", "coarse", l->part_nbytes[SAGA_PART_COARSE] },
        { "fine anchors", "fine", l->part_nbytes[SAGA_PART_FINE] },
        { "primitives", "primitives", l->part_nbytes[SAGA_PART_PRIM] },
        { "segment headers", "segment_headers",
          l->part_nbytes[SAGA_PART_SEGMENT] },
        { "chunk headers", "chunk_headers", l->framing_nbytes },
        { "in no whole chunk", "other", l->other_nbytes }
    };

    for (int i = 0; i < N_ROWS; i++)
        rows[i] = all[i];
}

void saga_put_bytes(json_t *report, const saga_layout *layout)
{
    json_t *const o = json_object(), *const list = json_array();
    row rows[N_ROWS];

    fill(rows, layout);
    for (int i = 0; i < N_ROWS; i++) {
        const json_int_t n = (json_int_t)rows[i].nbytes;

        saga_put_int(o, rows[i].key, n);
        saga_put_item(list, json_pack("{sssIsf}", "name", rows[i].name,
                                      "nbytes", n, "part",
                                      (double)n / (double)layout->file_nbytes));
    }
    saga_put(report, "bytes", o);
    saga_put(report, "/bytes", list);
}
