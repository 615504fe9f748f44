/* SPDX-License-Identifier: MIT
 *
 * docs/bitstream.md is compared with the decoder. The functions of saga.h must
 * give the statuses, sizes and ranges that the page states, for the good
 * vectors whole, cut, and with fields at their limits and beyond.
 */
#include "bitstream_page.h"
#include "testing.h"

/* --- The page and the decoder -------------------------------------------- */

static file *named_file(void)
{
    for (int i = 0; i < n_files; i++)
        if (strcmp(files[i].name, "names.saga") == 0)
            return &files[i];
    fail_msg("there is no names.saga");
    return NULL;
}

/* Each example replaces the payload of a file's chunk NAME and is the last part
 * of the file. saga_name_camera must return the page's status. */
TEST(examples_of_names_should_have_their_statuses)
{
    file *const f = named_file();
    saga_naming naming;
    saga_info info;
    int n_ok = 0;

    assert_ok(saga_probe(&info, f->p, f->n));
    assert_int_equal(info.n_cameras, 3);
    for (int i = 0; i < n_examples; i++) {
        const example *const e = &examples[i];
        const uint32_t n = tables[NAMES].nbytes + e->n;
        file copy = { .n = info.head_nbytes + tables[CHUNK].nbytes + n };
        uint8_t *chunk_at, *payload;

        copy.p = must(malloc(copy.n));
        memcpy(copy.p, f->p, info.head_nbytes);
        chunk_at = copy.p + info.head_nbytes;
        payload = chunk_at + tables[CHUNK].nbytes;
        memcpy(chunk_at, "NAME", 4);
        store(chunk_at + 4, 4, n);
        memset(payload, 0, tables[NAMES].nbytes);
        memcpy(payload + tables[NAMES].nbytes, e->p, e->n);
        store(chunk_at + 8, 4,
              crc_of(crc_of(owner_of(&copy, info.head_nbytes), chunk_at, 8),
                     payload, n));
        for (uint32_t k = 0; k < info.n_cameras; k++)
            if (saga_name_camera(&naming, copy.p, copy.n, k) != e->status)
                fail_msg("example %d of names, camera %u: not %d", i + 1, k,
                         (int)e->status);
        n_ok += e->status == SAGA_OK;
        free(copy.p);
    }
    assert_true(n_ok > 0 && n_ok < n_examples);
}

TEST(probe_should_report_the_same_values)
{
    for (int i = 0; i < n_files; i++) {
        const uint8_t *const p = files[i].p;
        saga_info a;

        assert_ok(saga_probe(&a, p, files[i].n));
        assert_int_equal(get(HEADER, p, "version", 0), a.version);
        assert_int_equal(get(HEADER, p, "level", 0), a.level);
        assert_int_equal(get(HEADER, p, "n_segments", 0), a.n_segments);
        assert_int_equal(get(HEADER, p, "n_frames", 0), a.n_frames);
        assert_int_equal(get(HEADER, p, "fps_num", 0), a.fps_num);
        assert_int_equal(get(HEADER, p, "fps_den", 0), a.fps_den);
        assert_int_equal(get(HEADER, p, "n_cameras", 0), a.n_cameras);
        assert_int_equal(get(HEADER, p, "max_coarse", 0), a.max_coarse);
        assert_int_equal(get(HEADER, p, "max_fine", 0), a.max_fine);
        assert_int_equal(get(HEADER, p, "max_prim", 0), a.max_primitives);
        assert_int_equal(get(HEADER, p, "nets_nbytes", 0), a.nets_nbytes);
        assert_int_equal(base_of(p, "n_coarse"), a.base_coarse);
        assert_int_equal(base_of(p, "n_fine"), a.base_fine);
        assert_int_equal(base_of(p, "n_prim"), a.base_primitives);
        assert_int_equal(base_of(p, "nbytes"), a.base_nbytes);
        assert_int_equal(get(HEADER, p, "tools", 0), a.tools);
        assert_int_equal(get(HEADER, p, "tools", 0) >> 3 & 3, a.motion_order);
        assert_int_equal(get(HEADER, p, "features", 0), a.features);
        assert_int_equal(get(HEADER, p, "unit_mantissa", 0), a.unit_mantissa);
        assert_int_equal(get(HEADER, p, "unit_exponent", 0), a.unit_exponent);
        for (int k = 0; k < 3; k++)
            assert_int_equal(get(HEADER, p, "centre_mantissa", (uint32_t)k),
                             a.centre_mantissa[k]);
        assert_int_equal(get(HEADER, p, "centre_exponent", 0),
                         a.centre_exponent);
        assert_int_equal(get(HEADER, p, "header_nbytes", 0) +
                             2 * tables[CHUNK].nbytes +
                             a.n_segments * tables[ENTRY].nbytes +
                             a.nets_nbytes + a.base_nbytes,
                         a.head_nbytes);
    }
}

static uint32_t width_of(const uint8_t *p, const char *net)
{
    return (uint32_t)get(NETWORK, p + field_named(HEADER, net)->offset, "width",
                         0);
}

static uint32_t bank_width_of(const uint8_t *p, const char *net)
{
    return (uint32_t)get(
        NETWORK, p + tables[HEADER].nbytes + field_named(BANK, net)->offset,
        "width", 0);
}

/* Returns the weights of networks 11 to 15. */
static uint32_t bank_weights_of(const uint8_t *p)
{
    const uint32_t in = 8 * (uint32_t)get(HEADER, p, "octaves", 0) + 6 +
                        (uint32_t)get(HEADER, p, "features", 0);
    const uint32_t l = (uint32_t)get(HEADER, p, "bank_slots", 0);
    const uint32_t d = (uint32_t)get(HEADER, p, "bank_width", 0);
    uint32_t v;

    if (!has_bank(p))
        return 0;
    v = bank_width_of(p, "net_write");
    return (in + d) *
               (bank_width_of(p, "net_query") + bank_width_of(p, "net_agg")) +
           (l + v) * bank_width_of(p, "net_slot") + d * v + v * (d + 1);
}

/* Returns the weights of network 16, whose outputs are `rows` corrections of
 * F_geo and C of the colour's first layer. */
static uint32_t hash_weights_of(const uint8_t *p, uint32_t rows)
{
    const uint32_t entries = (uint32_t)get(HEADER, p, "hash_levels", 0)
                             << get(HEADER, p, "hash_log2_entries", 0);

    return has_hash(p) ? (entries + rows + width_of(p, "net_colour")) *
                             (uint32_t)get(NETWORK, p + hash_at(p), "width", 0)
                       : 0;
}

/* Returns the inputs of an entropy network with the sources s. */
static uint32_t inputs_of(const uint8_t *p, uint32_t s)
{
    return (uint32_t)get(HEADER, p, "features", 0) *
               ((s & 1u) + (s >> 1 & 1u) + (s >> 2 & 1u)) +
           (s >> 3 & 1u) * (uint32_t)get(HEADER, p, "bank_width", 0);
}

/* Returns the weights of a network with two hidden layers of w units, or with
 * none if w is 0. */
static uint32_t layers_of(uint32_t n_in, uint32_t w, uint32_t n_out)
{
    return w ? n_in * w + w * w + w * n_out : n_in * n_out;
}

/* Returns the number of weights by section 9, with the fields' names; W of a
 * network is its own width. */
static uint32_t weights_of(const uint8_t *p)
{
    static const char *const sources[3] = { "sources_coarse", "sources_fine",
                                            "sources_prim" };
    static const char *const entropy[3] = { "net_e_coarse", "net_e_fine",
                                            "net_e_prim" };
    static const char *const fuse[2] = { "net_fuse_c", "net_fuse_f" };
    const uint32_t f = (uint32_t)get(HEADER, p, "features", 0);
    const uint32_t in = f + 8 * (uint32_t)get(HEADER, p, "octaves", 0);
    const uint32_t tools = (uint32_t)get(HEADER, p, "tools", 0);
    const uint32_t order = tools >> 3 & 3u;
    const uint32_t rows = 8 + (tools & 2u ? 4u : 0u) +
                          ((tools & 3u) || order ? 1u : 0u) + (tools & 1u) +
                          3 * order;
    uint32_t n = 0, any = 0, w;

    for (uint32_t i = 0; i < 3; i++) {
        const uint32_t s = (uint32_t)get(HEADER, p, sources[i], 0);
        const uint32_t n_in = inputs_of(p, s);

        any |= s;
        w = width_of(p, entropy[i]);
        if (n_in)
            n += n_in * w + w * w + w * (i ? 8u : 2 * (4 + f));
    }
    w = width_of(p, "net_hyper");
    if (any & 1u)
        n += (in - f + 5) * w + w * w + w * f;
    for (uint32_t i = 0; i < 2; i++)
        n += (in + f) * width_of(p, fuse[i]);
    n += layers_of(in, width_of(p, "net_fine"), f + 4) +
         layers_of(in, width_of(p, "net_geo"), rows);
    w = width_of(p, "net_colour");
    return n + in * w + (tools & 4u ? 3 * w : 0) + w * w + 3 * w +
           bank_weights_of(p) + hash_weights_of(p, rows);
}

TEST(networks_should_have_the_same_number_of_weights)
{
    for (int i = 0; i < n_files; i++) {
        saga_info info;

        assert_ok(saga_probe(&info, files[i].p, files[i].n));
        assert_int_equal(weights_of(files[i].p), info.n_weights);
    }
}

static void check_camera(const uint8_t *p, const saga_camera *c,
                         uint32_t number)
{
    assert_int_equal(get(CAMERA, p, "number", 0), number);
    for (uint32_t k = 0; k < 9; k++)
        assert_int_equal(get(CAMERA, p, "rotation_q30", k), c->rotation_q30[k]);
    for (uint32_t k = 0; k < 3; k++) {
        assert_int_equal(get(CAMERA, p, "centre", k), c->centre[k]);
        assert_int_equal(get(CAMERA, p, "background_q15", k),
                         c->background_q15[k]);
    }
    for (uint32_t k = 0; k < 2; k++) {
        assert_int_equal(get(CAMERA, p, "focal_q16", k), c->focal_q16[k]);
        assert_int_equal(get(CAMERA, p, "principal_q16", k),
                         c->principal_q16[k]);
    }
    assert_int_equal(get(CAMERA, p, "near_plane", 0), c->near_plane);
    assert_int_equal(get(CAMERA, p, "width", 0), c->width);
    assert_int_equal(get(CAMERA, p, "height", 0), c->height);
}

/* saga_rig must return the fields that the page describes, for the files' own
 * cameras, and for cameras in which all bytes differ, so that no field can be
 * mistaken for another. */
TEST(rig_should_hold_the_same_values)
{
    for (int i = 0; i < n_files; i++) {
        file *const f = &files[i];
        const uint32_t n = (uint32_t)get(HEADER, f->p, "n_cameras", 0);
        const uint32_t rig = rig_at(f->p), end = rig_end(f->p);
        FREED uint8_t *const copy = malloc(end + 4);
        uint32_t number;
        saga_camera cam;

        assert_non_null(copy);
        memcpy(copy, f->p, rig);
        for (uint32_t k = rig; k < end; k++)
            copy[k] = (uint8_t)(k * 167u >> 3 & 255u);
        store(copy + end, 4, crc_of(0, copy, end));
        for (uint32_t c = 0; c < n; c++) {
            const uint32_t at = rig + c * tables[CAMERA].nbytes;

            assert_ok(saga_rig(&cam, &number, f->p, f->n, c));
            check_camera(f->p + at, &cam, number);
            assert_ok(saga_rig(&cam, &number, copy, end + 4, c));
            check_camera(copy + at, &cam, number);
        }
    }
}

/* Opens a decoder at the beginning of a block, which the caller frees. */
static saga_decoder *open_file(saga_info *info, const file *f)
{
    saga_decoder *dec;
    void *work;

    assert_ok(saga_probe(info, f->p, f->n));
    work = must(aligned_alloc(SAGA_WORK_ALIGN, info->work_nbytes));
    assert_ok(saga_open(&dec, work, info->work_nbytes, f->p, info->head_nbytes,
                        NULL));
    assert_ptr_equal(dec, work);
    return dec;
}

static const uint8_t *index_of(const file *f)
{
    return f->p + get(HEADER, f->p, "header_nbytes", 0) + tables[CHUNK].nbytes;
}

/* Compares what saga_find reports of a segment with its index entry and with
 * the payload of its chunk SEGM. */
static void check_found(saga_decoder *dec, file *f, const uint8_t *entry,
                        uint32_t first_frame)
{
    const size_t offset = (size_t)get(ENTRY, entry, "offset", 0);
    const uint8_t *const seg = f->p + offset + tables[CHUNK].nbytes;
    saga_segment found;
    saga_report report;

    assert_ok(saga_find(&found, f->p, f->n, first_frame, 1));
    assert_int_equal(found.offset, offset);
    assert_int_equal(get(ENTRY, entry, "nbytes", 0), found.nbytes);
    assert_int_equal(get(SEGMENT, seg, "number", 0), found.number);
    assert_int_equal(get(SEGMENT, seg, "first_frame", 0), found.first_frame);
    assert_int_equal(get(SEGMENT, seg, "n_frames", 0), found.n_frames);
    assert_ok(saga_decode(dec, &found, f->p + offset, found.nbytes, NULL));
    assert_ok(saga_tell(&report, dec));
    assert_int_equal(report.n_layers, n_layers_of(f));
    assert_int_equal(sum_of(f, seg, "n_coarse"), report.n_coarse);
    assert_int_equal(sum_of(f, seg, "n_fine"), report.n_fine);
    assert_int_equal(sum_of(f, seg, "n_prim") + base_of(f->p, "n_prim"),
                     report.n_primitives);
}

/* Returns the number of layers that saga_decode finds in the first n bytes of a
 * segment, or 0 if it returns TRUNCATED. It reads a copy of exactly n bytes. */
static uint32_t layers_in(saga_decoder *dec, const saga_segment *seg,
                          const uint8_t *bytes, size_t n)
{
    uint8_t *const copy = malloc(n + 1);
    saga_report report = { .n_layers = 0 };
    saga_status s;

    assert_non_null(copy);
    memcpy(copy, bytes, n);
    s = saga_decode(dec, seg, copy, n, NULL);
    free(copy);
    assert_true(s == SAGA_OK || s == SAGA_ERR_TRUNCATED);
    if (s == SAGA_OK)
        assert_ok(saga_tell(&report, dec));
    return report.n_layers;
}

/* Checks a segment of an opened file, cut on both sides of each layer's end. */
static void check_cuts(saga_decoder *dec, file *f, const saga_segment *seg)
{
    const uint8_t *const p = f->p + seg->offset;
    size_t end = tables[CHUNK].nbytes + segment_nbytes(f);

    for (uint32_t i = 0; i < n_layers_of(f); i++) {
        saga_layer_report layer;
        const size_t begin = end;

        end += (size_t)get(
            LAYER, layer_at(f->p + seg->offset + tables[CHUNK].nbytes, i),
            "nbytes", 0);
        assert_ok(saga_find_layer(&layer, dec, seg, p, begin, i));
        assert_int_equal(layer.end, end);
        assert_int_equal(layers_in(dec, seg, p, end - 1), i);
        assert_int_equal(layers_in(dec, seg, p, begin + (end - begin) / 2), i);
        assert_int_equal(layers_in(dec, seg, p, end), i + 1);
    }
    assert_int_equal(end, seg->nbytes);
}

TEST(segments_should_be_cut_where_layers_end)
{
    for (int i = 0; i < n_files; i++) {
        file *const f = &files[i];
        saga_info info;
        FREED saga_decoder *const dec = open_file(&info, f);
        saga_segment seg = { .n_frames = 0 };

        assert_int_equal(info.n_layers, n_layers_of(f));
        for (uint32_t frame = 0; info.n_layers > 1 && frame < info.n_frames;
             frame += seg.n_frames) {
            assert_ok(saga_find(&seg, f->p, f->n, frame, 1));
            check_cuts(dec, f, &seg);
        }
    }
}

TEST(segments_should_be_found_with_the_same_values)
{
    for (int i = 0; i < n_files; i++) {
        file *const f = &files[i];
        const uint8_t *const index = index_of(f);
        uint32_t first_frame = 0;
        saga_info info;
        FREED saga_decoder *const dec = open_file(&info, f);

        for (uint32_t s = 0; s < info.n_segments; s++) {
            const uint8_t *const entry = index + s * tables[ENTRY].nbytes;

            check_found(dec, f, entry, first_frame);
            first_frame += (uint32_t)get(ENTRY, entry, "n_frames", 0);
        }
    }
}

/* --- Ranges and the decoder ---------------------------------------------- */

/* Returns whether the valid values of a field depend on other fields. Only
 * values outside of its range are then tried. */
static int is_coupled(const field *f)
{
    static const char *const names[] = { "header_nbytes", "n_cameras",
                                         "n_segments", "n_frames" };

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(f->name, names[i]) == 0)
            return 1;
    return 0;
}

/* Returns the status of a header with v in a field and a new CRC. Sets *fits to
 * whether the header still has the size that its tools need. */
static saga_status status_with(uint8_t *header, const field *f, uint8_t *p,
                               int64_t v, uint32_t end, int *fits)
{
    const uint64_t old = load(p + f->offset, f->nbytes);
    const uint32_t rig = rig_at(header);
    saga_info info;
    saga_status s;

    store(p + f->offset, f->nbytes, (uint64_t)v);
    *fits = rig_at(header) == rig && bank_is_consistent(header) &&
            hash_is_consistent(header);
    store(header + end, 4, crc_of(0, header, end));
    s = saga_probe(&info, header, end + 4);
    store(p + f->offset, f->nbytes, old);
    return s;
}

typedef struct {
    uint8_t *header;
    uint32_t end; /* offset of the header's CRC */
    uint32_t n_tried;
} trial;

static void try_value(trial *r, const field *f, uint8_t *p, int64_t v)
{
    int64_t lo, hi;
    const int in = in_range(f, v, &lo, &hi);
    saga_status s;
    int fits, inside;

    if (in && is_coupled(f))
        return;
    s = status_with(r->header, f, p, v, r->end, &fits);
    inside = in && fits;
    r->n_tried++;
    /* The highest level accepts whatever a lower level accepts. */
    if (strcmp(f->name, "level") == 0 && v == hi)
        assert_ok(s);
    if (inside ? s != SAGA_OK && s != SAGA_ERR_LEVEL
               : s != SAGA_ERR_DATA && s != SAGA_ERR_VERSION &&
                     s != SAGA_ERR_LEVEL)
        fail_msg("%s = %lld, range %s: %s", f->name, (long long)v, f->range,
                 saga_status_text(s));
}

/* Returns whether bitstream.md refuses this width in the sections on `width` or
 * on single networks, apart from its general range. */
static int is_refused_width(const trial *r, const field *f, const uint8_t *p,
                            int64_t v)
{
    static const char *const may_be_0[] = { "net_fuse_c", "net_fuse_f",
                                            "net_fine", "net_geo" };
    const uint8_t *const h = r->header;

    if (strcmp(f->name, "width") != 0)
        return 0;
    for (size_t i = 0; i < sizeof may_be_0 / sizeof *may_be_0; i++)
        if (p == h + field_named(HEADER, may_be_0[i])->offset)
            return 0;
    return v == 0 ||
           (v > 32 && p == h + field_named(HEADER, "net_colour")->offset);
}

/* Tries a field: a byte with all its values, a wider field at its bounds. */
static void try_field(const table *t, const field *f, uint8_t *p, void *user)
{
    trial *const r = user;
    int64_t lo, hi;
    int fits;

    (void)t;
    if (!is_plain(f) || f->count != 1)
        return;
    if (f->nbytes == 1) {
        for (int64_t v = 0; v < 256; v++)
            if (is_refused_width(r, f, p, v))
                assert_int_equal(status_with(r->header, f, p, v, r->end, &fits),
                                 SAGA_ERR_DATA);
            else
                try_value(r, f, p, v);
        return;
    }
    in_range(f, 0, &lo, &hi);
    try_value(r, f, p, lo);
    try_value(r, f, p, hi);
    if (lo > type_min(f))
        try_value(r, f, p, lo - 1);
    if (hi < type_max(f))
        try_value(r, f, p, hi + 1);
}

TEST(decoder_should_refuse_what_lies_outside_the_ranges)
{
    for (int i = 0; i < n_files; i++) {
        file *const f = &files[i];
        trial r;

        r.end = rig_end(f->p);
        r.n_tried = 0;
        r.header = must(malloc(r.end + 4));
        memcpy(r.header, f->p, r.end);
        visit(&tables[HEADER], r.header, try_field, &r);
        if (has_bank(r.header))
            visit(&tables[BANK], r.header + tables[HEADER].nbytes, try_field,
                  &r);
        if (has_hash(r.header))
            visit(&tables[HASH], r.header + hash_at(r.header), try_field, &r);
        if (has_base(r.header))
            visit(&tables[BASE], r.header + base_at(r.header), try_field, &r);
        assert_true(r.n_tried > 0);
        free(r.header);
    }
}

/* Returns the status of a view whose camera has v in element i of a field, and
 * 0 in the rest of its rotation. */
static saga_status status_of_view(saga_decoder *dec, uint8_t *header,
                                  const field *f, uint32_t i, int64_t v)
{
    const field *const r = field_named(CAMERA, "rotation_q30");
    uint8_t *const p = header + rig_at(header);
    const uint32_t end = (uint32_t)get(HEADER, header, "header_nbytes", 0) - 4;
    const uint32_t size = f->nbytes / f->count;
    uint8_t old[256];
    uint32_t number;
    saga_camera c;

    assert_true(tables[CAMERA].nbytes <= sizeof old);
    memcpy(old, p, tables[CAMERA].nbytes);
    memset(p + r->offset, 0, r->nbytes);
    store(p + f->offset + i * size, size, (uint64_t)v);
    store(header + end, 4, crc_of(0, header, end));
    assert_ok(saga_rig(&c, &number, header, end + 4, 0));
    memcpy(p, old, tables[CAMERA].nbytes);
    return saga_view(dec, &c, 0);
}

/* Tries the bounds of a field of the camera, and the values just outside. */
static void try_camera(saga_decoder *dec, uint8_t *header, const field *f,
                       uint32_t i)
{
    int64_t v[4], lo, hi;

    in_range(f, 0, &lo, &hi);
    v[0] = lo;
    v[1] = hi;
    v[2] = lo - 1;
    v[3] = hi + 1;
    for (int k = 0; k < 4; k++)
        if (v[k] >= type_min(f) && v[k] <= type_max(f))
            assert_int_equal(status_of_view(dec, header, f, i, v[k]),
                             k < 2 ? SAGA_OK : SAGA_ERR_ARG);
}

TEST(view_should_refuse_cameras_outside_the_ranges)
{
    file *const f = &files[0];
    const size_t n = (size_t)get(HEADER, f->p, "header_nbytes", 0);
    FREED uint8_t *const header = malloc(n);
    saga_segment seg;
    saga_info info;
    FREED saga_decoder *const dec = open_file(&info, f);

    assert_non_null(header);
    memcpy(header, f->p, n);
    assert_true(get(HEADER, header, "n_cameras", 0) >= 1);
    assert_ok(saga_find(&seg, f->p, f->n, 0, 1));
    assert_ok(saga_decode(dec, &seg, f->p + seg.offset, seg.nbytes, NULL));
    for (int k = 0; k < tables[CAMERA].n; k++) {
        const field *const c = &tables[CAMERA].f[k];

        for (uint32_t i = 0; is_plain(c) && i < c->count; i++)
            try_camera(dec, header, c, i);
    }
}
