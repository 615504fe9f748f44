/* SPDX-License-Identifier: MIT
 *
 * docs/bitstream.md is compared with itself and with the files. A small reader
 * that uses only the page's tables takes every good vector apart.
 */
#include "bitstream_page.h"
#include "testing.h"

static int n_named, n_layered, n_sounds, n_exposed;

/* --- The page by itself -------------------------------------------------- */

TEST(every_structure_should_have_a_table_without_gaps)
{
    for (int t = 0; t < N_TABLES; t++) {
        uint32_t at = 0;

        assert_true(tables[t].n > 0);
        for (int k = 0; k < tables[t].n; k++) {
            const field *const f = &tables[t].f[k];

            if (f->offset != at)
                fail_msg("%s of %s: offset %u, not %u", f->name,
                         tables[t].name, f->offset, at);
            assert_true(f->count > 0);
            assert_int_equal(f->nbytes, f->count * size_of_type(f->type));
            at += f->nbytes;
        }
        assert_int_equal(tables[t].size, tables[t].nbytes);
    }
    assert_int_equal(n_sizes, N_TABLES);
}

TEST(every_range_should_be_readable_and_fit_its_type)
{
    for (int t = 0; t < N_TABLES; t++)
        for (int k = 0; k < tables[t].n; k++) {
            const field *const f = &tables[t].f[k];
            int64_t lo, hi;

            if (!is_plain(f)) {
                assert_true(strcmp(f->range, "any") == 0 ||
                            strncmp(f->range, "see ", 4) == 0 ||
                            (f->range[0] == '"' &&
                             strcmp(f->type, "u8") == 0));
                continue;
            }
            in_range(f, 0, &lo, &hi);
            assert_true(lo >= type_min(f) && hi <= type_max(f));
        }
}

/* --- The page and the files ---------------------------------------------- */

TEST(there_should_be_good_files)
{
    assert_true(n_files >= 1);
}

TEST(own_crc_should_have_the_check_value)
{
    assert_int_equal(crc_of(0, (const uint8_t *)"123456789", 9), 0xe3069283u);
}

TEST(headers_should_be_as_the_tables_say)
{
    for (int i = 0; i < n_files; i++) {
        uint8_t *const p = files[i].p;
        const uint32_t n = (uint32_t)get(HEADER, p, "n_cameras", 0);
        const uint32_t end = rig_end(p);

        check_values(HEADER, p, &files[i]);
        assert_true(bank_is_consistent(p));
        assert_true(hash_is_consistent(p));
        if (has_bank(p))
            check_values(BANK, p + tables[HEADER].nbytes, &files[i]);
        if (has_hash(p))
            check_values(HASH, p + hash_at(p), &files[i]);
        if (has_base(p))
            check_values(BASE, p + base_at(p), &files[i]);
        assert_int_equal(get(HEADER, p, "header_nbytes", 0), end + 4);
        assert_true(end + 4 <= files[i].n);
        assert_int_equal(load(p + end, 4), crc_of(0, p, end));
        for (uint32_t c = 0; c < n; c++)
            check_values(CAMERA, p + rig_at(p) + c * tables[CAMERA].nbytes,
                         &files[i]);
    }
}

/* Returns the payload of the chunk at p[at..n); moves *at past the chunk. */
static uint8_t *chunk(file *f, size_t *at, const char *type, uint32_t *nbytes)
{
    uint8_t *const head = f->p + *at;
    uint8_t *const payload = head + tables[CHUNK].nbytes;
    uint32_t crc;

    assert_true(tables[CHUNK].nbytes <= f->n - *at);
    assert_memory_equal(head + field_named(CHUNK, "type")->offset, type, 4);
    *nbytes = (uint32_t)get(CHUNK, head, "nbytes", 0);
    assert_true(*nbytes <= f->n - *at - tables[CHUNK].nbytes);
    crc = crc_of(owner_of(f, *at), head, field_named(CHUNK, "crc")->offset);
    assert_int_equal(get(CHUNK, head, "crc", 0), crc_of(crc, payload, *nbytes));
    *at += tables[CHUNK].nbytes + *nbytes;
    return payload;
}

static const char *const part[3] = { "COAR", "FINE", "PRIM" };

static void check_base(file *f, size_t *at)
{
    const size_t begin = *at;
    uint32_t nbytes;

    for (int k = 0; k < 3 && has_base(f->p); k++)
        chunk(f, at, part[k], &nbytes);
    assert_int_equal(base_of(f->p, "nbytes"), *at - begin);
}

/* Checks the three chunks of a layer at *at, and what its segment states about
 * it. */
static void check_layer(file *f, size_t *at, uint8_t *layer)
{
    const size_t begin = *at;
    uint32_t nbytes;

    assert_true(get(LAYER, layer, "n_coarse", 0) <=
                get(HEADER, f->p, "max_coarse", 0));
    assert_true(get(LAYER, layer, "n_fine", 0) <=
                get(HEADER, f->p, "max_fine", 0));
    check_values(LAYER, layer, f);
    for (int k = 0; k < 3; k++) {
        chunk(f, at, part[k], &nbytes);
        assert_true(nbytes >= 1);
    }
    if (n_layers_of(f) > 1)
        assert_int_equal(get(LAYER, layer, "nbytes", 0), *at - begin);
}

/* Checks the chunks of segment i at *at, and what the index states about it. */
static void check_segment(file *f, size_t *at, uint32_t i,
                          const uint8_t *entry, uint32_t first_frame)
{
    const size_t begin = *at;
    uint32_t nbytes;
    uint8_t *seg = chunk(f, at, "SEGM", &nbytes);

    assert_int_equal(nbytes, segment_nbytes(f));
    check_values(SEGMENT, seg, f);
    for (uint32_t k = 0; k < n_layers_of(f); k++)
        check_layer(f, at, layer_at(seg, k));
    assert_true(sum_of(f, seg, "n_prim") <=
                get(HEADER, f->p, "max_prim", 0));
    n_layered += n_layers_of(f) > 1;
    assert_int_equal(get(ENTRY, entry, "offset", 0), begin);
    assert_int_equal(get(ENTRY, entry, "nbytes", 0), *at - begin);
    assert_int_equal(get(ENTRY, entry, "n_frames", 0),
                     get(SEGMENT, seg, "n_frames", 0));
    assert_int_equal(get(SEGMENT, seg, "number", 0), i);
    assert_int_equal(get(SEGMENT, seg, "first_frame", 0), first_frame);
}

/* Checks the chunk of names, if there is one: it has a name for each camera. */
static void check_names(file *f, size_t *at)
{
    uint32_t nbytes, done = tables[NAMES].nbytes, length = 0;
    uint8_t *p;

    if (f->n - *at < 4 || memcmp(f->p + *at, "NAME", 4) != 0)
        return;
    p = chunk(f, at, "NAME", &nbytes);
    n_named++;
    for (uint32_t i = 0; i < get(HEADER, f->p, "n_cameras", 0); i++) {
        check_values(NAME, p + done, f);
        assert_true(get(NAME, p + done, "shared", 0) <= length);
        length = (uint32_t)(get(NAME, p + done, "shared", 0) +
                            get(NAME, p + done, "more", 0));
        assert_true(length <= 63);
        done += tables[NAME].nbytes +
                (uint32_t)get(NAME, p + done, "more", 0);
    }
    assert_int_equal(done, nbytes);
}

/* Checks the chunk of exposures, if there is one: each camera has one. */
static void check_exposures(file *f, size_t *at)
{
    uint32_t nbytes;
    uint8_t *p;

    if (f->n - *at < 4 || memcmp(f->p + *at, "EXPO", 4) != 0)
        return;
    p = chunk(f, at, "EXPO", &nbytes);
    n_exposed++;
    assert_int_equal(nbytes, tables[EXPOSURE].nbytes *
                             get(HEADER, f->p, "n_cameras", 0));
    for (uint32_t i = 0; i < nbytes; i += tables[EXPOSURE].nbytes)
        check_values(EXPOSURE, p + i, f);
}

/* Checks the chunk of sound, if there is one. */
static void check_sound(file *f, size_t *at)
{
    uint32_t nbytes;
    uint8_t *p;

    if (f->n - *at < 4 || memcmp(f->p + *at, "OPUS", 4) != 0)
        return;
    p = chunk(f, at, "OPUS", &nbytes);
    n_sounds++;
    check_values(SOUND, p, f);
    assert_true(nbytes >= tables[SOUND].nbytes + 4);
    assert_memory_equal(p + tables[SOUND].nbytes, "OggS", 4);
}

TEST(chunks_should_tile_every_file)
{
    for (int i = 0; i < n_files; i++) {
        file *const f = &files[i];
        const uint32_t n = (uint32_t)get(HEADER, f->p, "n_segments", 0);
        size_t at = (size_t)get(HEADER, f->p, "header_nbytes", 0);
        uint32_t nbytes, first_frame = 0;
        uint8_t *const index = chunk(f, &at, "INDX", &nbytes);

        assert_int_equal(nbytes, n * tables[ENTRY].nbytes);
        chunk(f, &at, "NETS", &nbytes);
        assert_int_equal(nbytes, get(HEADER, f->p, "nets_nbytes", 0));
        check_base(f, &at);
        check_names(f, &at);
        check_exposures(f, &at);
        check_sound(f, &at);
        for (uint32_t s = 0; s < n; s++) {
            uint8_t *const entry = index + s * tables[ENTRY].nbytes;

            check_values(ENTRY, entry, f);
            check_segment(f, &at, s, entry, first_frame);
            first_frame += (uint32_t)get(ENTRY, entry, "n_frames", 0);
        }
        assert_int_equal(first_frame, get(HEADER, f->p, "n_frames", 0));
        assert_int_equal(at, f->n);
    }
    assert_true(n_named > 0 && n_layered > 0 && n_sounds > 0 &&
                n_exposed > 0);
}
