/* SPDX-License-Identifier: MIT
 *
 * This file reads the tables of docs/bitstream.md, and every good vector by
 * these tables. It has its own loads and CRC and uses nothing of
 * common/container.c, which the page describes.
 *
 * SAGA_ROOT is the repository's folder, by default ".".
 */
#ifndef BITSTREAM_PAGE_H
#define BITSTREAM_PAGE_H

#include "saga.h"
#include "testing.h"

#include <dirent.h>

enum { MAX_FIELDS = 80, MAX_FILES = 64, MAX_EXAMPLES = 40, N_COLUMNS = 6 };

typedef struct {
    char type[16], name[32], range[64];
    /* count: number of elements of an array; 1 if it is no array. */
    uint32_t offset, nbytes, count;
} field;

typedef struct {
    const char *name; /* its heading */
    uint32_t nbytes;  /* end of its last field */
    int n;
    field f[MAX_FIELDS];
    uint32_t size; /* according to the table of sizes */
} table;

static table tables[] = {
    { .name = "Header" },         { .name = "Tier" },
    { .name = "Network" },        { .name = "Camera" },
    { .name = "Chunk header" },   { .name = "Index entry" },
    { .name = "Segment header" }, { .name = "Bank networks" },
    { .name = "Base" },           { .name = "Names" },
    { .name = "Name" },           { .name = "Layer" },
    { .name = "Sound" },          { .name = "Hash network" },
    { .name = "Exposure" }
};
enum {
    HEADER,
    TIER,
    NETWORK,
    CAMERA,
    CHUNK,
    ENTRY,
    SEGMENT,
    BANK,
    BASE,
    NAMES,
    NAME,
    LAYER,
    SOUND,
    HASH,
    EXPOSURE,
    N_TABLES
};

typedef struct {
    char name[64];
    uint8_t *p;
    size_t n;
} file;

static file files[MAX_FILES];
static int n_files;

/* An example of the names' table: bytes that follow the structure Names, and
 * the status that a decoder must return. */
typedef struct {
    uint8_t p[32];
    uint32_t n;
    saga_status status;
} example;

static example examples[MAX_EXAMPLES];
static int n_examples, n_sizes;

/* --- The page ------------------------------------------------------------ */

static inline table *table_named(const char *name)
{
    for (int i = 0; i < N_TABLES; i++)
        if (strcmp(tables[i].name, name) == 0)
            return &tables[i];
    return NULL;
}

/* Returns the number of bytes of an element, or 0 if there is no such type. */
static inline uint32_t size_of_type(const char *type)
{
    const table *const t = table_named(type);

    return strcmp(type, "u8") == 0                                ? 1
           : strcmp(type, "u16") == 0                             ? 2
           : strcmp(type, "u32") == 0 || strcmp(type, "i32") == 0 ? 4
           : strcmp(type, "u64") == 0                             ? 8
           : t                                                    ? t->nbytes
                                                                  : 0;
}

/* Splits a table row `| a | b |` into its cells, without the blanks around
 * them, and returns the number of cells. */
static inline int split_row(char *line, char *cell[N_COLUMNS + 1])
{
    int n = 0;
    char *p = strchr(line, '|');

    while (p && n <= N_COLUMNS) {
        char *const end = strchr(p + 1, '|');
        char *last = end;

        if (!end)
            break;
        p++;
        while (*p == ' ')
            p++;
        while (last > p && last[-1] == ' ')
            last--;
        *last = 0;
        cell[n++] = p;
        p = end;
    }
    return n;
}

static inline uint32_t number_of(const char *s)
{
    char *end;
    const unsigned long v = strtoul(s, &end, 10);

    assert_true(*s >= '0' && *s <= '9' && *end == 0);
    return (uint32_t)v;
}

static inline void copy_text(char *to, size_t n, const char *from)
{
    assert_true(strlen(from) < n);
    strcpy(to, from);
}

static inline void add_row(table *t, char *line)
{
    char *cell[N_COLUMNS + 1], *bracket;
    field *const f = &t->f[t->n];

    assert_true(t->n < MAX_FIELDS);
    assert_int_equal(split_row(line, cell), N_COLUMNS);
    f->offset = number_of(cell[0]);
    f->nbytes = number_of(cell[1]);
    f->count = 1;
    bracket = strchr(cell[2], '[');
    if (bracket) {
        *strchr(bracket, ']') = 0;
        *bracket = 0;
        f->count = number_of(bracket + 1);
    }
    copy_text(f->type, sizeof f->type, cell[2]);
    copy_text(f->name, sizeof f->name, cell[3]);
    copy_text(f->range, sizeof f->range, cell[4]);
    t->nbytes = f->offset + f->nbytes;
    t->n++;
}

static inline void add_size(char *line)
{
    char *cell[N_COLUMNS + 1];
    table *t;

    assert_int_equal(split_row(line, cell), 2);
    t = table_named(cell[0]);
    assert_non_null(t);
    t->size = number_of(cell[1]);
    n_sizes++;
}

/* Adds a row of the table of examples: `00 01 61` | text | OK or DATA. */
static inline void add_example(char *line)
{
    char *cell[N_COLUMNS + 1], *s;
    example *const e = &examples[n_examples++];

    assert_true(n_examples <= MAX_EXAMPLES);
    assert_int_equal(split_row(line, cell), 3);
    s = cell[0];
    assert_int_equal(*s, '`');
    while (*s != 0 && s[1] != 0) {
        assert_true(e->n < sizeof e->p);
        e->p[e->n++] = (uint8_t)strtoul(s + 1, &s, 16);
    }
    assert_true(strcmp(cell[2], "OK") == 0 || strcmp(cell[2], "DATA") == 0);
    e->status = strcmp(cell[2], "OK") == 0 ? SAGA_OK : SAGA_ERR_DATA;
}

/* Reads the tables of fields, of sizes and of names. A table begins at its
 * known first line, ends at an empty line, and belongs to the heading before
 * it. */
static inline void read_page(FILE *page)
{
    static const char *const first[] = {
        "| offset | bytes | type | name | range | meaning |",
        "| structure | size |", "| payload | what it is | status |"
    };
    char line[512];
    table *t = NULL;
    int inside = 0;

    while (fgets(line, sizeof line, page)) {
        line[strcspn(line, "\n")] = 0;
        if (line[0] == '#')
            t = strncmp(line, "### ", 4) == 0 ? table_named(line + 4) : NULL;
        if (strcmp(line, first[0]) == 0) {
            assert_non_null(t);
            assert_int_equal(t->n, 0);
            inside = 1;
        } else if (strcmp(line, first[1]) == 0) {
            inside = 2;
        } else if (strcmp(line, first[2]) == 0) {
            inside = 3;
        } else if (line[0] != '|') {
            inside = 0;
        } else if (inside && strncmp(line, "|-", 2) != 0) {
            if (inside == 1)
                add_row(t, line);
            else if (inside == 2)
                add_size(line);
            else
                add_example(line);
        }
    }
}

/* --- Ranges -------------------------------------------------------------- */

/* Reads a whole number (also negative), 2^k or 2^k-1, and moves *s after it. */
static inline int64_t read_bound(const char **s)
{
    const int negative = **s == '-';
    char *end;
    int64_t v;

    *s += negative;
    assert_true(**s >= '0' && **s <= '9');
    v = strtoll(*s, &end, 10);
    if (*end == '^') {
        assert_int_equal(v, 2);
        v = (int64_t)1 << strtol(end + 1, &end, 10);
        if (strncmp(end, "-1", 2) == 0) {
            v--;
            end += 2;
        }
    }
    *s = end;
    return negative ? -v : v;
}

static inline int is_plain(const field *f)
{
    return f->range[0] == '-' || (f->range[0] >= '0' && f->range[0] <= '9');
}

/* Returns whether v is in the range of a field. Sets *lo and *hi to the least
 * and the greatest value of the range. */
static inline int in_range(const field *f, int64_t v, int64_t *lo, int64_t *hi)
{
    const char *s = f->range;
    int found = 0;

    *lo = INT64_MAX;
    *hi = INT64_MIN;
    for (;;) {
        const int64_t a = read_bound(&s);
        int64_t b = a;

        if (strncmp(s, "..", 2) == 0) {
            s += 2;
            b = read_bound(&s);
        }
        assert_true(a <= b);
        found |= v >= a && v <= b;
        *lo = a < *lo ? a : *lo;
        *hi = b > *hi ? b : *hi;
        if (*s == 0)
            return found;
        assert_int_equal(strncmp(s, ", ", 2), 0);
        s += 2;
    }
}

static inline int64_t type_min(const field *f)
{
    return strcmp(f->type, "i32") == 0 ? INT32_MIN : 0;
}

static inline int64_t type_max(const field *f)
{
    const uint32_t size = size_of_type(f->type);

    return strcmp(f->type, "i32") == 0 ? INT32_MAX
           : size == 8                 ? INT64_MAX
                                       : ((int64_t)1 << 8 * size) - 1;
}

/* --- Bytes --------------------------------------------------------------- */

static inline uint64_t load(const uint8_t *p, uint32_t nbytes)
{
    uint64_t v = 0;

    while (nbytes-- > 0)
        v = v << 8 | p[nbytes];
    return v;
}

static inline void store(uint8_t *p, uint32_t nbytes, uint64_t v)
{
    for (uint32_t i = 0; i < nbytes; i++)
        p[i] = (uint8_t)(v >> 8 * i & 255u);
}

/* Computes the CRC bit by bit, from its definition. */
static inline uint32_t crc_of(uint32_t crc, const uint8_t *p, size_t n)
{
    crc = ~crc;
    for (size_t i = 0; i < n; i++) {
        crc ^= p[i];
        for (int k = 0; k < 8; k++)
            crc = crc & 1u ? crc >> 1 ^ 0x82f63b78u : crc >> 1;
    }
    return ~crc;
}

/* Returns element i of a field of the structure at p. */
static inline int64_t element(const field *f, const uint8_t *p, uint32_t i)
{
    const uint32_t size = f->nbytes / f->count;
    const uint64_t v = load(p + f->offset + i * size, size);

    return strcmp(f->type, "i32") == 0 ? (int32_t)(uint32_t)v : (int64_t)v;
}

static inline const field *field_named(int t, const char *name)
{
    for (int k = 0; k < tables[t].n; k++)
        if (strcmp(tables[t].f[k].name, name) == 0)
            return &tables[t].f[k];
    fail_msg("the table %s has no field %s", tables[t].name, name);
    return NULL;
}

static inline int64_t get(int t, const uint8_t *p, const char *name, uint32_t i)
{
    const field *const f = field_named(t, name);

    assert_true(i < f->count);
    return element(f, p, i);
}

/* --- The header's parts -------------------------------------------------- */

enum {
    TOOL_BASE = 1 << 5,
    TOOL_HASH = 1 << 8,
    TOOL_BANK = 1 << 9,
    TOOL_PLAIN = 1 << 10,
    SOURCE_BANK = 8
};

static inline int has_bank(const uint8_t *header)
{
    return (get(HEADER, header, "tools", 0) & TOOL_BANK) != 0;
}

static inline int has_hash(const uint8_t *header)
{
    return (get(HEADER, header, "tools", 0) & TOOL_HASH) != 0;
}

static inline int has_base(const uint8_t *header)
{
    return (get(HEADER, header, "tools", 0) & TOOL_BASE) != 0;
}

static inline uint32_t hash_at(const uint8_t *header)
{
    return tables[HEADER].nbytes + (has_bank(header) ? tables[BANK].nbytes : 0);
}

static inline uint32_t base_at(const uint8_t *header)
{
    return hash_at(header) + (has_hash(header) ? tables[HASH].nbytes : 0);
}

/* Returns a field of the structure Base, or 0 if the header has none. */
static inline uint32_t base_of(const uint8_t *header, const char *name)
{
    return has_base(header)
               ? (uint32_t)get(BASE, header + base_at(header), name, 0)
               : 0;
}

static inline uint32_t rig_at(const uint8_t *header)
{
    return base_at(header) + (has_base(header) ? tables[BASE].nbytes : 0);
}

/* Returns the offset of the header's CRC, which follows the rig. */
static inline uint32_t rig_end(const uint8_t *header)
{
    return rig_at(header) + tables[CAMERA].nbytes *
                                (uint32_t)get(HEADER, header, "n_cameras", 0);
}

/* Returns whether the header's fields of the memory bank obey section 3. */
static inline int bank_is_consistent(const uint8_t *p)
{
    const int64_t slots = get(HEADER, p, "bank_slots", 0);
    const int64_t width = get(HEADER, p, "bank_width", 0);
    const int64_t blocks = get(HEADER, p, "bank_blocks", 0);
    const int read = ((get(HEADER, p, "sources_coarse", 0) |
                       get(HEADER, p, "sources_fine", 0) |
                       get(HEADER, p, "sources_prim", 0)) &
                      SOURCE_BANK) != 0;

    if (has_bank(p))
        return read && slots && width && blocks &&
               !(slots == 512 && width == 8);
    return !read && !slots && !width && !blocks &&
           !(get(HEADER, p, "tools", 0) & TOOL_PLAIN);
}

/* Returns whether the fields that depend on the hash's tool obey section 3. */
static inline int hash_is_consistent(const uint8_t *p)
{
    const int64_t levels = get(HEADER, p, "hash_levels", 0);
    const int64_t bits = get(HEADER, p, "hash_log2_entries", 0);

    /* A shift by more than 9 is above 512 for every number of levels. */
    return has_hash(p) ? levels && bits && bits <= 9 && levels << bits <= 512
                       : !levels && !bits;
}

/* --- Every field of a structure ------------------------------------------ */

/* A function that is called for each field of a plain type. Structures within
 * structures are visited, too. */
typedef void (*visitor)(const table *t, const field *f, uint8_t *p, void *user);

static inline void visit(const table *t, uint8_t *p, visitor each, void *user)
{
    for (int k = 0; k < t->n; k++) {
        const field *const f = &t->f[k];
        const table *const inner = table_named(f->type);

        for (int m = 0; inner && m < inner->n; m++)
            each(t, &inner->f[m], p + f->offset, user);
        if (!inner)
            each(t, f, p, user);
    }
}

/* --- Chunks and segments ------------------------------------------------- */

/* Returns the CRC with which the CRC of a chunk begins: that of the header for
 * INDX and NETS, of the preceding chunk for those of the base, of NETS for
 * NAME, EXPO and OPUS, of the head's last chunk for those of a segment. */
static inline uint32_t owner_of(const file *f, size_t at)
{
    const size_t index = (size_t)get(HEADER, f->p, "header_nbytes", 0);
    const size_t nets = index + tables[CHUNK].nbytes +
                        tables[ENTRY].nbytes *
                            (size_t)get(HEADER, f->p, "n_segments", 0);
    const size_t base = nets + tables[CHUNK].nbytes +
                        (size_t)get(HEADER, f->p, "nets_nbytes", 0);
    const size_t end = base + base_of(f->p, "nbytes");
    size_t k = nets, next = base;

    if (at <= nets)
        return (uint32_t)load(f->p + index - 4, 4);
    while (next < at && next < end && memcmp(f->p + at, "NAME", 4) != 0 &&
           memcmp(f->p + at, "EXPO", 4) != 0 &&
           memcmp(f->p + at, "OPUS", 4) != 0) {
        k = next;
        next += tables[CHUNK].nbytes +
                (size_t)get(CHUNK, f->p + k, "nbytes", 0);
    }
    return (uint32_t)get(CHUNK, f->p + k, "crc", 0);
}

static inline uint32_t n_layers_of(const file *f)
{
    return (uint32_t)get(HEADER, f->p, "more_layers", 0) + 1;
}

/* Returns the number of bytes of SEGM's payload. A single layer has no length
 * field. */
static inline uint32_t segment_nbytes(const file *f)
{
    const uint32_t n = n_layers_of(f);

    return tables[SEGMENT].nbytes + n * tables[LAYER].nbytes - (n == 1 ? 4 : 0);
}

/* Returns layer i of the SEGM payload at p. */
static inline uint8_t *layer_at(uint8_t *p, uint32_t i)
{
    return p + tables[SEGMENT].nbytes + i * tables[LAYER].nbytes;
}

/* Returns the sum of a count over all layers. */
static inline uint32_t sum_of(const file *f, const uint8_t *segment,
                              const char *name)
{
    uint32_t sum = 0;

    for (uint32_t i = 0; i < n_layers_of(f); i++)
        sum += (uint32_t)get(
            LAYER, segment + tables[SEGMENT].nbytes + i * tables[LAYER].nbytes,
            name, 0);
    return sum;
}

/* --- Before the tests ---------------------------------------------------- */

static inline const char *root(void)
{
    const char *const r = getenv("SAGA_ROOT");

    return r ? r : ".";
}

static inline void load_file(const char *name)
{
    file *const f = &files[n_files++];
    char path[1024];
    FILE *in;
    long size;

    assert_true(n_files <= MAX_FILES);
    copy_text(f->name, sizeof f->name, name);
    snprintf(path, sizeof path, "%s/vectors/good/%s", root(), name);
    in = must(fopen(path, "rb"));
    fseek(in, 0, SEEK_END);
    size = ftell(in);
    fseek(in, 0, SEEK_SET);
    assert_true(size > 0);
    f->p = must(malloc((size_t)size));
    f->n = fread(f->p, 1, (size_t)size, in);
    assert_int_equal(f->n, size);
    fclose(in);
}

static inline int load_all(void **state)
{
    char path[1024];
    FILE *page;
    DIR *dir;
    const struct dirent *e;

    (void)state;
    snprintf(path, sizeof path, "%s/docs/bitstream.md", root());
    page = must(fopen(path, "r"));
    read_page(page);
    fclose(page);
    snprintf(path, sizeof path, "%s/vectors/good", root());
    dir = opendir(path);
    assert_non_null(dir);
    while ((e = readdir(dir)) != NULL)
        if (strstr(e->d_name, ".saga"))
            load_file(e->d_name);
    closedir(dir);
    return 0;
}

static inline int free_all(void **state)
{
    (void)state;
    while (n_files > 0)
        free(files[--n_files].p);
    return 0;
}

TEST_GROUP(load_all, free_all);

#endif
