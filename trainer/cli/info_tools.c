/* SPDX-License-Identifier: MIT */
#include "info_tools.h"

#include "container.h"
#include "model.h"

#include <stdbool.h>
#include <stddef.h>

#define ROW(word, bit, name, key) { SAGA_TOOL_##word, name, key },

static const struct {
    uint32_t bit;
    const char *name, *key;
} tools[] = { SAGA_TOOL_LIST(ROW) SAGA_TOOL_LATER_LIST(ROW) };

enum { N_TOOLS = (int)(sizeof tools / sizeof tools[0]) };

json_t *saga_info_tools(const saga_info *info, json_t *line)
{
    json_t *const o = json_object();
    bool any = info->motion_order > 0;

    for (int i = 0; i < N_TOOLS; i++) {
        const bool has = info->tools & tools[i].bit;

        saga_put_flag(o, tools[i].key, has);
        if (has)
            saga_put_item(line, json_pack("{ssss}", "comma", any ? ", " : "",
                                          "name", tools[i].name));
        any = any || has;
    }
    saga_put_int(o, "motion_order", (json_int_t)info->motion_order);
    return o;
}

static json_t *class_of(const saga_model *m, uint32_t i)
{
    const saga_class c = m->classes[i];
    const bool has_one = c.one < m->features;
    json_t *const o = json_object();

    saga_put_int(o, "first", c.first);
    saga_put_int(o, "n_features", c.n);
    saga_put(o, "one", has_one ? json_integer(c.one) : json_null());
    saga_put_flag(o, "/has_one", has_one);
    return o;
}

json_t *saga_info_classes(const uint8_t *bytes)
{
    saga_io io = { bytes, NULL, SAGA_MAGIC_NBYTES };
    json_t *const list = json_array();
    saga_header h = { 0 };

    saga_header_io(&io, &h);
    saga_tools_io(&io, &h);
    for (uint32_t i = 0; i < h.model.n_classes; i++)
        saga_put_item(list, class_of(&h.model, i));
    return list;
}
