/* SPDX-License-Identifier: MIT */
#include "npy.h"

#include "alloc.h"
#include "error.h"
#include "file.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_HEADER = 4096 };

typedef struct npy_header {
    int item_nbytes;
    bool fortran;
    int n_sides;
    size_t side[SAGA_NPY_SIDES];
    size_t rows, cols;
} npy_header;

static const char *skip_space(const char *p)
{
    while (*p == ' ' || *p == '\t' || *p == '\n')
        p++;
    return p;
}

/* Returns the text after 'key': in the header's dictionary, or NULL if it is
 * missing. */
static const char *value_of(const char *text, const char *key)
{
    const char *p = strstr(text, key);
    if (!p || p == text || (p[-1] != '\'' && p[-1] != '"'))
        return NULL;
    p += strlen(key);
    if (*p != '\'' && *p != '"')
        return NULL;
    p = skip_space(p + 1);
    return *p == ':' ? skip_space(p + 1) : NULL;
}

/* Multiplies all sides except the first. Returns false if the product is too
 * large. */
static bool multiply_sides(npy_header *h)
{
    h->rows = h->side[0];
    h->cols = 1;
    for (int i = 1; i < SAGA_NPY_SIDES; i++) {
        if (h->side[i] && h->cols > SIZE_MAX / 16 / h->side[i])
            return false;
        h->cols *= h->side[i];
    }
    return true;
}

/* Reads a shape such as (a,) or (a, b). Only digits are accepted, so no number
 * can be negative. */
static bool parse_shape(const char *p, npy_header *h)
{
    int n = 0;
    for (int i = 0; i < SAGA_NPY_SIDES; i++)
        h->side[i] = 1;
    if (!p || *p++ != '(')
        return false;
    for (p = skip_space(p); *p != ')'; p = skip_space(p)) {
        if (n == SAGA_NPY_SIDES || *p < '0' || *p > '9')
            return false;
        char *end;
        const unsigned long long x = strtoull(p, &end, 10);
        if (x > SIZE_MAX / 16)
            return false;
        h->side[n++] = (size_t)x;
        p = skip_space(end);
        if (*p == ',')
            p++;
        else if (*p != ')')
            return false;
    }
    h->n_sides = n;
    /* copy_items converts Fortran's order for matrices only. */
    return n > 0 && (n <= 2 || !h->fortran) && multiply_sides(h);
}

static bool parse_header(const char *text, npy_header *h)
{
    const char *const descr = value_of(text, "descr");
    const char *const order = value_of(text, "fortran_order");
    if (!descr || !order || (descr[0] != '\'' && descr[0] != '"'))
        return false;
    if (strncmp(descr + 1, "<f8", 3) == 0)
        h->item_nbytes = 8;
    else if (strncmp(descr + 1, "<f4", 3) == 0)
        h->item_nbytes = 4;
    else
        return false;
    if (strncmp(order, "True", 4) != 0 && strncmp(order, "False", 5) != 0)
        return false;
    h->fortran = order[0] == 'T';
    return parse_shape(value_of(text, "shape"), h);
}

static const uint8_t *take_header(saga_cursor *c, size_t *nbytes)
{
    const uint8_t *const magic = saga_take(c, 8);
    if (!magic || memcmp(magic, "\x93NUMPY", 6) != 0 || magic[6] < 1 ||
        magic[6] > 3)
        return NULL;
    /* The header's length has two bytes in version 1 and four in later
     * versions. */
    *nbytes = (size_t)saga_take_le(c, magic[6] == 1 ? 2 : 4);
    return *nbytes < MAX_HEADER ? saga_take(c, *nbytes) : NULL;
}

static void copy_items(saga_npy *npy, const npy_header *h, const uint8_t *p)
{
    for (size_t r = 0; r < h->rows; r++)
        for (size_t c = 0; c < h->cols; c++) {
            const size_t i = h->fortran ? c * h->rows + r : r * h->cols + c;
            const uint8_t *const item = p + i * (size_t)h->item_nbytes;
            npy->data[r * h->cols + c] = h->item_nbytes == 8
                                             ? saga_load_f64(item)
                                             : saga_load_f32(item);
        }
}

static bool read_array(saga_npy *npy, saga_cursor *c, const char *path,
                       saga_error *error)
{
    char text[MAX_HEADER];
    size_t n = 0;
    const uint8_t *const header = take_header(c, &n);
    npy_header h = { 0 };
    if (!header)
        return saga_fail(error, path, "save it again with numpy.save",
                         "is not an .npy file, or its header is cut short");
    memcpy(text, header, n);
    text[n] = '\0';
    if (!parse_header(text, &h))
        return saga_fail(error, path, "save a plain float64 array",
                         "has an unsupported header (%.120s)", text);
    const size_t item = (size_t)h.item_nbytes;
    const size_t have = saga_left(c) / item;
    /* The sizes are compared by division, because rows x cols may overflow. */
    if (h.rows == 0 || h.cols == 0 || h.rows > have / h.cols ||
        h.rows * h.cols * item != saga_left(c))
        return saga_fail(error, path, "save or copy it again",
                         "announces %zu x %zu numbers of %zu bytes but holds "
                         "%zu bytes",
                         h.rows, h.cols, item, saga_left(c));
    npy->data = saga_alloc(h.rows * h.cols, sizeof *npy->data, path, error);
    if (!npy->data)
        return false;
    npy->n_sides = h.n_sides;
    memcpy(npy->side, h.side, sizeof npy->side);
    npy->rows = h.rows;
    npy->cols = h.cols;
    copy_items(npy, &h, c->next);
    return true;
}

bool saga_npy_parse(saga_npy *npy, const uint8_t *bytes, size_t nbytes,
                    const char *path, saga_error *error)
{
    saga_cursor c = { bytes, bytes + nbytes, false };
    *npy = (saga_npy){ 0 };
    return read_array(npy, &c, path, error);
}

bool saga_npy_read(saga_npy *npy, const char *path, saga_error *error)
{
    saga_bytes bytes;
    *npy = (saga_npy){ 0 };
    if (!saga_read_file(&bytes, path, error))
        return false;
    bool ok = saga_npy_parse(npy, bytes.data, bytes.nbytes, path, error);
    saga_bytes_free(&bytes);
    if (ok && npy->n_sides > 2) {
        ok = saga_fail(error, path, "save a plain float64 array",
                       "has an unsupported header (%d dimensions)",
                       npy->n_sides);
        saga_npy_free(npy);
    }
    return ok;
}

void saga_npy_free(saga_npy *npy)
{
    free(npy->data);
    *npy = (saga_npy){ 0 };
}
