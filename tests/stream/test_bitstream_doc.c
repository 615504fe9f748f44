/* SPDX-License-Identifier: MIT
 *
 * docs/bitstream.md against the files and the decoder: the tables of the page
 * are parsed, and a small reader that knows nothing else takes every good
 * vector apart. It has its own loads and CRC; nothing of common/container.c is
 * used, since that is what the page describes.
 *
 * SAGA_ROOT is the repository's folder; "." without it.
 */
#include "saga.h"
#include "testing.h"

#include <dirent.h>

enum { MAX_FIELDS = 80, MAX_FILES = 64, MAX_EXAMPLES = 40, N_COLUMNS = 6 };

typedef struct {
    char type[16], name[32], range[64];
    uint32_t offset, nbytes, count;  /* count: elements of an array, or 1 */
} field;

typedef struct {
    const char *name;                /* its heading */
    uint32_t nbytes;                 /* end of its last field */
    int n;
    field f[MAX_FIELDS];
    uint32_t size;                   /* as the table of sizes has it */
} table;

static table tables[] = {
    { .name = "Header" }, { .name = "Tier" }, { .name = "Network" },
    { .name = "Camera" }, { .name = "Chunk header" },
    { .name = "Index entry" }, { .name = "Segment header" },
    { .name = "Bank networks" }, { .name = "Base" }, { .name = "Names" },
    { .name = "Name" }, { .name = "Layer" }
};
enum {
    HEADER, TIER, NETWORK, CAMERA, CHUNK, ENTRY, SEGMENT, BANK, BASE, NAMES,
    NAME, LAYER, N_TABLES
};

typedef struct {
    char name[64];
    uint8_t *p;
    size_t n;
} file;

static file files[MAX_FILES];
static int n_files, n_named, n_layered;

/* An example of names: what stands behind Names, and its status. */
typedef struct {
    uint8_t p[32];
    uint32_t n;
    saga_status status;
} example;

static example examples[MAX_EXAMPLES];
static int n_examples, n_sizes;

/* --- The page ------------------------------------------------------------ */

static table *table_named(const char *name)
{
    int i;

    for (i = 0; i < N_TABLES; i++)
        if (strcmp(tables[i].name, name) == 0)
            return &tables[i];
    return NULL;
}

/* Bytes of one element; 0 for a type that does not exist. */
static uint32_t size_of_type(const char *type)
{
    const table *const t = table_named(type);

    return strcmp(type, "u8") == 0 ? 1
         : strcmp(type, "u16") == 0 ? 2
         : strcmp(type, "u32") == 0 || strcmp(type, "i32") == 0 ? 4
         : strcmp(type, "u64") == 0 ? 8 : t ? t->nbytes : 0;
}

/* Cuts a line `| a | b |` into its cells, without the blanks around them;
 * returns their number. */
static int split_row(char *line, char *cell[N_COLUMNS + 1])
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

static uint32_t number_of(const char *s)
{
    char *end;
    const unsigned long v = strtoul(s, &end, 10);

    assert_true(*s >= '0' && *s <= '9' && *end == 0);
    return (uint32_t)v;
}

static void copy_text(char *to, size_t n, const char *from)
{
    assert_true(strlen(from) < n);
    strcpy(to, from);
}

static void add_row(table *t, char *line)
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

static void add_size(char *line)
{
    char *cell[N_COLUMNS + 1];
    table *t;

    assert_int_equal(split_row(line, cell), 2);
    t = table_named(cell[0]);
    assert_non_null(t);
    t->size = number_of(cell[1]);
    n_sizes++;
}

/* `00 01 61` | text | OK or DATA */
static void add_example(char *line)
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

/* A table of fields is known by its first line and ends with an empty one; it
 * belongs to the heading before it. So are those of sizes and of names. */
static void read_page(FILE *page)
{
    static const char *const first[] = {
        "| offset | bytes | type | name | range | meaning |",
        "| structure | size |",
        "| payload | what it is | status |"
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

/* A whole number, or 2^k, or 2^k-1, or the negative of one; moves *s on. */
static int64_t read_bound(const char **s)
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

static int is_plain(const field *f)
{
    return f->range[0] == '-' || (f->range[0] >= '0' && f->range[0] <= '9');
}

/* Whether v is in a plain range; the least and greatest value of it in *lo and
 * *hi. */
static int in_range(const field *f, int64_t v, int64_t *lo, int64_t *hi)
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

static int64_t type_min(const field *f)
{
    return strcmp(f->type, "i32") == 0 ? INT32_MIN : 0;
}

static int64_t type_max(const field *f)
{
    const uint32_t size = size_of_type(f->type);

    return strcmp(f->type, "i32") == 0 ? INT32_MAX
         : size == 8 ? INT64_MAX : ((int64_t)1 << 8 * size) - 1;
}

/* --- Bytes --------------------------------------------------------------- */

static uint64_t load(const uint8_t *p, uint32_t nbytes)
{
    uint64_t v = 0;

    while (nbytes-- > 0)
        v = v << 8 | p[nbytes];
    return v;
}

static void store(uint8_t *p, uint32_t nbytes, uint64_t v)
{
    uint32_t i;

    for (i = 0; i < nbytes; i++)
        p[i] = (uint8_t)(v >> 8 * i & 255u);
}

/* Bit by bit, from the definition. */
static uint32_t crc_of(uint32_t crc, const uint8_t *p, size_t n)
{
    size_t i;
    int k;

    crc = ~crc;
    for (i = 0; i < n; i++) {
        crc ^= p[i];
        for (k = 0; k < 8; k++)
            crc = crc & 1u ? crc >> 1 ^ 0x82f63b78u : crc >> 1;
    }
    return ~crc;
}

/* Element i of a field of a structure at p. */
static int64_t element(const field *f, const uint8_t *p, uint32_t i)
{
    const uint32_t size = f->nbytes / f->count;
    const uint64_t v = load(p + f->offset + i * size, size);

    return strcmp(f->type, "i32") == 0 ? (int32_t)(uint32_t)v : (int64_t)v;
}

static const field *field_named(int t, const char *name)
{
    int k;

    for (k = 0; k < tables[t].n; k++)
        if (strcmp(tables[t].f[k].name, name) == 0)
            return &tables[t].f[k];
    fail_msg("the table %s has no field %s", tables[t].name, name);
    return NULL;
}

static int64_t get(int t, const uint8_t *p, const char *name, uint32_t i)
{
    const field *const f = field_named(t, name);

    assert_true(i < f->count);
    return element(f, p, i);
}

/* --- The header's parts -------------------------------------------------- */

enum {
    TOOL_BASE = 1 << 5, TOOL_BANK = 1 << 9, TOOL_PLAIN = 1 << 10,
    SOURCE_BANK = 8
};

static int has_bank(const uint8_t *header)
{
    return (get(HEADER, header, "tools", 0) & TOOL_BANK) != 0;
}

static int has_base(const uint8_t *header)
{
    return (get(HEADER, header, "tools", 0) & TOOL_BASE) != 0;
}

static uint32_t base_at(const uint8_t *header)
{
    return tables[HEADER].nbytes +
           (has_bank(header) ? tables[BANK].nbytes : 0);
}

/* A field of Base; 0 without one. */
static uint32_t base_of(const uint8_t *header, const char *name)
{
    return has_base(header)
        ? (uint32_t)get(BASE, header + base_at(header), name, 0) : 0;
}

static uint32_t rig_at(const uint8_t *header)
{
    return base_at(header) + (has_base(header) ? tables[BASE].nbytes : 0);
}

/* Where the CRC stands. */
static uint32_t rig_end(const uint8_t *header)
{
    return rig_at(header) + tables[CAMERA].nbytes *
           (uint32_t)get(HEADER, header, "n_cameras", 0);
}

/* What section 3 says of the fields that hang on the bank's tool. */
static int bank_is_consistent(const uint8_t *p)
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

/* --- Every field of a structure ------------------------------------------ */

/* Structures in structures are entered; for each field of a plain type. */
typedef void (*visitor)(const table *t, const field *f, uint8_t *p,
                        void *user);

static void visit(const table *t, uint8_t *p, visitor each, void *user)
{
    int k;

    for (k = 0; k < t->n; k++) {
        const field *const f = &t->f[k];
        const table *const inner = table_named(f->type);
        int m;

        for (m = 0; inner && m < inner->n; m++)
            each(t, &inner->f[m], p + f->offset, user);
        if (!inner)
            each(t, f, p, user);
    }
}

static void check_value(const table *t, const field *f, uint8_t *p,
                        void *user)
{
    const file *const where = user;
    uint32_t i;

    if (f->range[0] == '"') {
        assert_int_equal(strlen(f->range), f->count + 2);
        assert_memory_equal(p + f->offset, f->range + 1, f->count);
    }
    for (i = 0; is_plain(f) && i < f->count; i++) {
        const int64_t v = element(f, p, i);
        int64_t lo, hi;

        if (!in_range(f, v, &lo, &hi))
            fail_msg("%s: %s of %s is %lld, not in %s", where->name, f->name,
                     t->name, (long long)v, f->range);
    }
}

static void check_values(int t, uint8_t *p, file *where)
{
    visit(&tables[t], p, check_value, where);
}

/* --- Before the tests ---------------------------------------------------- */

static const char *root(void)
{
    const char *const r = getenv("SAGA_ROOT");

    return r ? r : ".";
}

static void load_file(const char *name)
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

static int load_all(void **state)
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

static int free_all(void **state)
{
    (void)state;
    while (n_files > 0)
        free(files[--n_files].p);
    return 0;
}

/* --- The page by itself -------------------------------------------------- */

TEST(every_structure_should_have_a_table_without_gaps)
{
    int t, k;

    for (t = 0; t < N_TABLES; t++) {
        uint32_t at = 0;

        assert_true(tables[t].n > 0);
        for (k = 0; k < tables[t].n; k++) {
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
    int t, k;

    for (t = 0; t < N_TABLES; t++)
        for (k = 0; k < tables[t].n; k++) {
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
    int i;

    for (i = 0; i < n_files; i++) {
        uint8_t *const p = files[i].p;
        const uint32_t n = (uint32_t)get(HEADER, p, "n_cameras", 0);
        const uint32_t end = rig_end(p);
        uint32_t c;

        check_values(HEADER, p, &files[i]);
        assert_true(bank_is_consistent(p));
        if (has_bank(p))
            check_values(BANK, p + tables[HEADER].nbytes, &files[i]);
        if (has_base(p))
            check_values(BASE, p + base_at(p), &files[i]);
        assert_int_equal(get(HEADER, p, "header_nbytes", 0), end + 4);
        assert_true(end + 4 <= files[i].n);
        assert_int_equal(load(p + end, 4), crc_of(0, p, end));
        for (c = 0; c < n; c++)
            check_values(CAMERA, p + rig_at(p) + c * tables[CAMERA].nbytes,
                         &files[i]);
    }
}

/* The CRC that the one of a chunk goes on from: the header's for INDX and NETS,
 * that of the chunk before for the base's, that of NETS for NAME, that of the
 * head's last chunk for a segment's. */
static uint32_t owner_of(const file *f, size_t at)
{
    const size_t index = (size_t)get(HEADER, f->p, "header_nbytes", 0);
    const size_t nets = index + tables[CHUNK].nbytes + tables[ENTRY].nbytes *
                        (size_t)get(HEADER, f->p, "n_segments", 0);
    const size_t base = nets + tables[CHUNK].nbytes +
                        (size_t)get(HEADER, f->p, "nets_nbytes", 0);
    const size_t end = base + base_of(f->p, "nbytes");
    size_t k = nets, next = base;

    if (at <= nets)
        return (uint32_t)load(f->p + index - 4, 4);
    while (next < at && next < end && memcmp(f->p + at, "NAME", 4) != 0) {
        k = next;
        next += tables[CHUNK].nbytes + (size_t)get(CHUNK, f->p + k, "nbytes",
                                                   0);
    }
    return (uint32_t)get(CHUNK, f->p + k, "crc", 0);
}

/* A chunk at p[at..n): its payload; moves *at past it. */
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

static uint32_t n_layers_of(const file *f)
{
    return (uint32_t)get(HEADER, f->p, "more_layers", 0) + 1;
}

/* Bytes of SEGM's payload: a single layer has no length. */
static uint32_t segment_nbytes(const file *f)
{
    const uint32_t n = n_layers_of(f);

    return tables[SEGMENT].nbytes + n * tables[LAYER].nbytes -
           (n == 1 ? 4 : 0);
}

/* Layer i of a segment whose SEGM has its payload at p. */
static uint8_t *layer_at(uint8_t *p, uint32_t i)
{
    return p + tables[SEGMENT].nbytes + i * tables[LAYER].nbytes;
}

/* Counts of all layers together. */
static uint32_t sum_of(const file *f, const uint8_t *segment,
                       const char *name)
{
    uint32_t sum = 0, i;

    for (i = 0; i < n_layers_of(f); i++)
        sum += (uint32_t)get(LAYER, segment + tables[SEGMENT].nbytes +
                             i * tables[LAYER].nbytes, name, 0);
    return sum;
}

static void check_base(file *f, size_t *at)
{
    const size_t begin = *at;
    uint32_t nbytes;
    int k;

    for (k = 0; k < 3 && has_base(f->p); k++)
        chunk(f, at, part[k], &nbytes);
    assert_int_equal(base_of(f->p, "nbytes"), *at - begin);
}

/* The three chunks of a layer at *at, and what its segment says of it. */
static void check_layer(file *f, size_t *at, uint8_t *layer)
{
    const size_t begin = *at;
    uint32_t nbytes;
    int k;

    assert_true(get(LAYER, layer, "n_coarse", 0) <=
                get(HEADER, f->p, "max_coarse", 0));
    assert_true(get(LAYER, layer, "n_fine", 0) <=
                get(HEADER, f->p, "max_fine", 0));
    check_values(LAYER, layer, f);
    for (k = 0; k < 3; k++) {
        chunk(f, at, part[k], &nbytes);
        assert_true(nbytes >= 1);
    }
    if (n_layers_of(f) > 1)
        assert_int_equal(get(LAYER, layer, "nbytes", 0), *at - begin);
}

/* The chunks of segment i at *at, and what the index says of it. */
static void check_segment(file *f, size_t *at, uint32_t i,
                          const uint8_t *entry, uint32_t first_frame)
{
    const size_t begin = *at;
    uint8_t *seg;
    uint32_t nbytes, k;

    seg = chunk(f, at, "SEGM", &nbytes);
    assert_int_equal(nbytes, segment_nbytes(f));
    check_values(SEGMENT, seg, f);
    for (k = 0; k < n_layers_of(f); k++)
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

/* The chunk of names, where there is one: a name for each camera. */
static void check_names(file *f, size_t *at)
{
    uint32_t nbytes, done = tables[NAMES].nbytes, i, length = 0;
    uint8_t *p;

    if (f->n - *at < 4 || memcmp(f->p + *at, "NAME", 4) != 0)
        return;
    p = chunk(f, at, "NAME", &nbytes);
    n_named++;
    for (i = 0; i < get(HEADER, f->p, "n_cameras", 0); i++) {
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

TEST(chunks_should_tile_every_file)
{
    int i;

    for (i = 0; i < n_files; i++) {
        file *const f = &files[i];
        const uint32_t n = (uint32_t)get(HEADER, f->p, "n_segments", 0);
        size_t at = (size_t)get(HEADER, f->p, "header_nbytes", 0);
        uint32_t nbytes, s, first_frame = 0;
        uint8_t *const index = chunk(f, &at, "INDX", &nbytes);

        assert_int_equal(nbytes, n * tables[ENTRY].nbytes);
        chunk(f, &at, "NETS", &nbytes);
        assert_int_equal(nbytes, get(HEADER, f->p, "nets_nbytes", 0));
        check_base(f, &at);
        check_names(f, &at);
        for (s = 0; s < n; s++) {
            uint8_t *const entry = index + s * tables[ENTRY].nbytes;

            check_values(ENTRY, entry, f);
            check_segment(f, &at, s, entry, first_frame);
            first_frame += (uint32_t)get(ENTRY, entry, "n_frames", 0);
        }
        assert_int_equal(first_frame, get(HEADER, f->p, "n_frames", 0));
        assert_int_equal(at, f->n);
    }
    assert_true(n_named > 0 && n_layered > 0);
}

/* --- The page and the decoder -------------------------------------------- */

static file *named_file(void)
{
    int i;

    for (i = 0; i < n_files; i++)
        if (strcmp(files[i].name, "names.saga") == 0)
            return &files[i];
    fail_msg("there is no names.saga");
    return NULL;
}

/* The payload of NAME in the place of a file's own, and nothing behind it. */
TEST(examples_of_names_should_have_their_statuses)
{
    file *const f = named_file();
    saga_naming naming;
    saga_info info;
    uint32_t k;
    int i, n_ok = 0;

    assert_int_equal(saga_probe(&info, f->p, f->n), SAGA_OK);
    assert_int_equal(info.n_cameras, 3);
    for (i = 0; i < n_examples; i++) {
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
        for (k = 0; k < info.n_cameras; k++)
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
    int i, k;

    for (i = 0; i < n_files; i++) {
        const uint8_t *const p = files[i].p;
        saga_info a;

        assert_int_equal(saga_probe(&a, p, files[i].n), SAGA_OK);
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
        for (k = 0; k < 3; k++)
            assert_int_equal(get(HEADER, p, "centre_mantissa", (uint32_t)k),
                             a.centre_mantissa[k]);
        assert_int_equal(get(HEADER, p, "centre_exponent", 0),
                         a.centre_exponent);
        assert_int_equal(get(HEADER, p, "header_nbytes", 0) +
                         2 * tables[CHUNK].nbytes + a.n_segments *
                         tables[ENTRY].nbytes + a.nets_nbytes + a.base_nbytes,
                         a.head_nbytes);
    }
}

static uint32_t width_of(const uint8_t *p, const char *net)
{
    return (uint32_t)get(NETWORK, p + field_named(HEADER, net)->offset,
                         "width", 0);
}

static uint32_t bank_width_of(const uint8_t *p, const char *net)
{
    return (uint32_t)get(NETWORK, p + tables[HEADER].nbytes +
                         field_named(BANK, net)->offset, "width", 0);
}

/* Networks 11 to 15. */
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
    return (in + d) * (bank_width_of(p, "net_query") +
                       bank_width_of(p, "net_agg")) +
           (l + v) * bank_width_of(p, "net_slot") + d * v + v * (d + 1);
}

/* Inputs of a network with sources s. */
static uint32_t inputs_of(const uint8_t *p, uint32_t s)
{
    return (uint32_t)get(HEADER, p, "features", 0) *
           ((s & 1u) + (s >> 1 & 1u) + (s >> 2 & 1u)) +
           (s >> 3 & 1u) * (uint32_t)get(HEADER, p, "bank_width", 0);
}

/* Weights of a network with two hidden layers of w units, none if w is 0. */
static uint32_t layers_of(uint32_t n_in, uint32_t w, uint32_t n_out)
{
    return w ? n_in * w + w * w + w * n_out : n_in * n_out;
}

/* Section 9, with the fields' names; W of a network is its own width. */
static uint32_t weights_of(const uint8_t *p)
{
    static const char *const sources[3] = {
        "sources_coarse", "sources_fine", "sources_prim"
    };
    static const char *const entropy[3] = {
        "net_e_coarse", "net_e_fine", "net_e_prim"
    };
    static const char *const fuse[2] = { "net_fuse_c", "net_fuse_f" };
    const uint32_t f = (uint32_t)get(HEADER, p, "features", 0);
    const uint32_t in = f + 8 * (uint32_t)get(HEADER, p, "octaves", 0);
    const uint32_t tools = (uint32_t)get(HEADER, p, "tools", 0);
    const uint32_t order = tools >> 3 & 3u;
    const uint32_t rows = 8 + (tools & 2u ? 4u : 0u) +
                          ((tools & 3u) || order ? 1u : 0u) + (tools & 1u) +
                          3 * order;
    uint32_t n = 0, any = 0, w, i;

    for (i = 0; i < 3; i++) {
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
    for (i = 0; i < 2; i++)
        n += (in + f) * width_of(p, fuse[i]);
    n += layers_of(in, width_of(p, "net_fine"), f + 4) +
         layers_of(in, width_of(p, "net_geo"), rows);
    w = width_of(p, "net_colour");
    return n + in * w + (tools & 4u ? 3 * w : 0) + w * w + 3 * w +
           bank_weights_of(p);
}

TEST(networks_should_have_the_same_number_of_weights)
{
    int i;

    for (i = 0; i < n_files; i++) {
        saga_info info;

        assert_int_equal(saga_probe(&info, files[i].p, files[i].n), SAGA_OK);
        assert_int_equal(weights_of(files[i].p), info.n_weights);
    }
}

static void check_camera(const uint8_t *p, const saga_camera *c,
                         uint32_t number)
{
    uint32_t k;

    assert_int_equal(get(CAMERA, p, "number", 0), number);
    for (k = 0; k < 9; k++)
        assert_int_equal(get(CAMERA, p, "rotation_q30", k),
                         c->rotation_q30[k]);
    for (k = 0; k < 3; k++) {
        assert_int_equal(get(CAMERA, p, "centre", k), c->centre[k]);
        assert_int_equal(get(CAMERA, p, "background_q15", k),
                         c->background_q15[k]);
    }
    for (k = 0; k < 2; k++) {
        assert_int_equal(get(CAMERA, p, "focal_q16", k), c->focal_q16[k]);
        assert_int_equal(get(CAMERA, p, "principal_q16", k),
                         c->principal_q16[k]);
    }
    assert_int_equal(get(CAMERA, p, "near_plane", 0), c->near_plane);
    assert_int_equal(get(CAMERA, p, "width", 0), c->width);
    assert_int_equal(get(CAMERA, p, "height", 0), c->height);
}

/* The files' own cameras, and then cameras of different bytes throughout, in
 * which no field can be mistaken for another. */
TEST(rig_should_hold_the_same_values)
{
    int i;

    for (i = 0; i < n_files; i++) {
        file *const f = &files[i];
        const uint32_t n = (uint32_t)get(HEADER, f->p, "n_cameras", 0);
        const uint32_t rig = rig_at(f->p), end = rig_end(f->p);
        uint8_t *const copy = malloc(end + 4);
        uint32_t c, k, number;
        saga_camera cam;

        assert_non_null(copy);
        memcpy(copy, f->p, rig);
        for (k = rig; k < end; k++)
            copy[k] = (uint8_t)(k * 167u >> 3 & 255u);
        store(copy + end, 4, crc_of(0, copy, end));
        for (c = 0; c < n; c++) {
            const uint32_t at = rig + c * tables[CAMERA].nbytes;

            assert_int_equal(saga_rig(&cam, &number, f->p, f->n, c), SAGA_OK);
            check_camera(f->p + at, &cam, number);
            assert_int_equal(saga_rig(&cam, &number, copy, end + 4, c),
                             SAGA_OK);
            check_camera(copy + at, &cam, number);
        }
        free(copy);
    }
}

/* A decoder in a block that begins with it: free it. */
static saga_decoder *open_file(saga_info *info, const file *f)
{
    saga_decoder *dec;
    void *work;

    assert_int_equal(saga_probe(info, f->p, f->n), SAGA_OK);
    work = must(aligned_alloc(SAGA_WORK_ALIGN, info->work_nbytes));
    assert_int_equal(saga_open(&dec, work, info->work_nbytes, f->p,
                               info->head_nbytes, NULL), SAGA_OK);
    assert_ptr_equal(dec, work);
    return dec;
}

static const uint8_t *index_of(const file *f)
{
    return f->p + get(HEADER, f->p, "header_nbytes", 0) + tables[CHUNK].nbytes;
}

/* A segment of an opened file; its SEGM's payload follows the chunk header. */
static void check_found(saga_decoder *dec, file *f, const uint8_t *entry,
                        uint32_t first_frame)
{
    const size_t offset = (size_t)get(ENTRY, entry, "offset", 0);
    const uint8_t *const seg = f->p + offset + tables[CHUNK].nbytes;
    saga_segment found;
    saga_report report;

    assert_int_equal(saga_find(&found, f->p, f->n, first_frame, 1), SAGA_OK);
    assert_int_equal(found.offset, offset);
    assert_int_equal(get(ENTRY, entry, "nbytes", 0), found.nbytes);
    assert_int_equal(get(SEGMENT, seg, "number", 0), found.number);
    assert_int_equal(get(SEGMENT, seg, "first_frame", 0), found.first_frame);
    assert_int_equal(get(SEGMENT, seg, "n_frames", 0), found.n_frames);
    assert_int_equal(saga_decode(dec, &found, f->p + offset,
                                 found.nbytes, NULL), SAGA_OK);
    assert_int_equal(saga_tell(&report, dec), SAGA_OK);
    assert_int_equal(report.n_layers, n_layers_of(f));
    assert_int_equal(sum_of(f, seg, "n_coarse"), report.n_coarse);
    assert_int_equal(sum_of(f, seg, "n_fine"), report.n_fine);
    assert_int_equal(sum_of(f, seg, "n_prim") + base_of(f->p, "n_prim"),
                     report.n_primitives);
}

/* What saga_decode makes of n bytes of a segment: the layers it decodes, 0 if
 * it is TRUNCATED. An exact copy shows what is read. */
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
        assert_int_equal(saga_tell(&report, dec), SAGA_OK);
    return report.n_layers;
}

/* A segment of an opened file, cut on both sides of each layer's end. */
static void check_cuts(saga_decoder *dec, file *f, const saga_segment *seg)
{
    const uint8_t *const p = f->p + seg->offset;
    size_t end = tables[CHUNK].nbytes + segment_nbytes(f);
    uint32_t i;

    for (i = 0; i < n_layers_of(f); i++) {
        saga_layer_report layer;
        const size_t begin = end;

        end += (size_t)get(LAYER, layer_at(f->p + seg->offset +
                                           tables[CHUNK].nbytes, i),
                           "nbytes", 0);
        assert_int_equal(saga_find_layer(&layer, dec, seg, p, begin, i),
                         SAGA_OK);
        assert_int_equal(layer.end, end);
        assert_int_equal(layers_in(dec, seg, p, end - 1), i);
        assert_int_equal(layers_in(dec, seg, p, begin + (end - begin) / 2), i);
        assert_int_equal(layers_in(dec, seg, p, end), i + 1);
    }
    assert_int_equal(end, seg->nbytes);
}

TEST(segments_should_be_cut_where_layers_end)
{
    int i;

    for (i = 0; i < n_files; i++) {
        file *const f = &files[i];
        saga_info info;
        saga_decoder *const dec = open_file(&info, f);
        saga_segment seg = { .n_frames = 0 };
        uint32_t frame;

        assert_int_equal(info.n_layers, n_layers_of(f));
        for (frame = 0; info.n_layers > 1 && frame < info.n_frames;
             frame += seg.n_frames) {
            assert_int_equal(saga_find(&seg, f->p, f->n, frame, 1), SAGA_OK);
            check_cuts(dec, f, &seg);
        }
        free(dec);
    }
}

TEST(segments_should_be_found_with_the_same_values)
{
    int i;

    for (i = 0; i < n_files; i++) {
        file *const f = &files[i];
        const uint8_t *const index = index_of(f);
        uint32_t s, first_frame = 0;
        saga_info info;
        saga_decoder *const dec = open_file(&info, f);

        for (s = 0; s < info.n_segments; s++) {
            const uint8_t *const entry = index + s * tables[ENTRY].nbytes;

            check_found(dec, f, entry, first_frame);
            first_frame += (uint32_t)get(ENTRY, entry, "n_frames", 0);
        }
        free(dec);
    }
}

/* --- Ranges and the decoder ---------------------------------------------- */

/* Fields whose values hang on others: only what is outside is tried. */
static int is_coupled(const field *f)
{
    static const char *const names[] = {
        "header_nbytes", "n_cameras", "n_segments", "n_frames"
    };
    size_t i;

    for (i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(f->name, names[i]) == 0)
            return 1;
    return 0;
}

/* The status of a header with v in a field, signed anew; *fits tells whether
 * the tools' fields still go together, and the header has their size. */
static saga_status status_with(uint8_t *header, const field *f, uint8_t *p,
                               int64_t v, uint32_t end, int *fits)
{
    const uint64_t old = load(p + f->offset, f->nbytes);
    const uint32_t rig = rig_at(header);
    saga_info info;
    saga_status s;

    store(p + f->offset, f->nbytes, (uint64_t)v);
    *fits = rig_at(header) == rig && bank_is_consistent(header);
    store(header + end, 4, crc_of(0, header, end));
    s = saga_probe(&info, header, end + 4);
    store(p + f->offset, f->nbytes, old);
    return s;
}

typedef struct {
    uint8_t *header;
    uint32_t end;            /* where its CRC stands */
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
    /* What fits a level fits the highest. */
    if (strcmp(f->name, "level") == 0 && v == hi)
        assert_int_equal(s, SAGA_OK);
    if (inside ? s != SAGA_OK && s != SAGA_ERR_LEVEL
               : s != SAGA_ERR_DATA && s != SAGA_ERR_VERSION &&
                 s != SAGA_ERR_LEVEL)
        fail_msg("%s = %lld, range %s: %s", f->name, (long long)v, f->range,
                 saga_status_text(s));
}

/* Widths with limits of their own: bitstream.md says so in the meanings of
 * width and of these networks. */
static int is_refused_width(const trial *r, const field *f, const uint8_t *p,
                            int64_t v)
{
    static const char *const may_be_0[] = {
        "net_fuse_c", "net_fuse_f", "net_fine", "net_geo"
    };
    const uint8_t *const h = r->header;
    size_t i;

    if (strcmp(f->name, "width") != 0)
        return 0;
    for (i = 0; i < sizeof may_be_0 / sizeof *may_be_0; i++)
        if (p == h + field_named(HEADER, may_be_0[i])->offset)
            return 0;
    return v == 0 ||
           (v > 32 && p == h + field_named(HEADER, "net_colour")->offset);
}

/* Bytes are tried with all their values, wider fields at the bounds. */
static void try_field(const table *t, const field *f, uint8_t *p, void *user)
{
    trial *const r = user;
    int64_t lo, hi, v;
    int fits;

    (void)t;
    if (!is_plain(f) || f->count != 1)
        return;
    if (f->nbytes == 1) {
        for (v = 0; v < 256; v++)
            if (is_refused_width(r, f, p, v))
                assert_int_equal(status_with(r->header, f, p, v, r->end,
                                             &fits), SAGA_ERR_DATA);
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
    int i;

    for (i = 0; i < n_files; i++) {
        file *const f = &files[i];
        trial r;

        r.end = rig_end(f->p);
        r.n_tried = 0;
        r.header = must(malloc(r.end + 4));
        memcpy(r.header, f->p, r.end);
        visit(&tables[HEADER], r.header, try_field, &r);
        if (has_bank(r.header))
            visit(&tables[BANK], r.header + tables[HEADER].nbytes,
                  try_field, &r);
        if (has_base(r.header))
            visit(&tables[BASE], r.header + base_at(r.header), try_field, &r);
        assert_true(r.n_tried > 0);
        free(r.header);
    }
}

/* A camera with v in element i of a field; 0 in the rest of its rotation. */
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
    assert_int_equal(saga_rig(&c, &number, header, end + 4, 0), SAGA_OK);
    memcpy(p, old, tables[CAMERA].nbytes);
    return saga_view(dec, &c, 0);
}

/* The bounds of a field of the camera, and what lies just outside. */
static void try_camera(saga_decoder *dec, uint8_t *header, const field *f,
                       uint32_t i)
{
    int64_t v[4], lo, hi;
    int k;

    in_range(f, 0, &lo, &hi);
    v[0] = lo;
    v[1] = hi;
    v[2] = lo - 1;
    v[3] = hi + 1;
    for (k = 0; k < 4; k++)
        if (v[k] >= type_min(f) && v[k] <= type_max(f))
            assert_int_equal(status_of_view(dec, header, f, i, v[k]),
                             k < 2 ? SAGA_OK : SAGA_ERR_ARG);
}

TEST(view_should_refuse_cameras_outside_the_ranges)
{
    file *const f = &files[0];
    const size_t n = (size_t)get(HEADER, f->p, "header_nbytes", 0);
    uint8_t *const header = malloc(n);
    saga_segment seg;
    saga_info info;
    saga_decoder *const dec = open_file(&info, f);
    uint32_t i;
    int k;

    assert_non_null(header);
    memcpy(header, f->p, n);
    assert_true(get(HEADER, header, "n_cameras", 0) >= 1);
    assert_int_equal(saga_find(&seg, f->p, f->n, 0, 1), SAGA_OK);
    assert_int_equal(saga_decode(dec, &seg, f->p + seg.offset, seg.nbytes,
                                 NULL),
                     SAGA_OK);
    for (k = 0; k < tables[CAMERA].n; k++) {
        const field *const c = &tables[CAMERA].f[k];

        for (i = 0; is_plain(c) && i < c->count; i++)
            try_camera(dec, header, c, i);
    }
    free(header);
    free(dec);
}

TEST_GROUP(load_all, free_all);
