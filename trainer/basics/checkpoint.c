/* SPDX-License-Identifier: MIT */
#include "checkpoint.h"

#include "real.h"

/* The version must be increased when any part of the program changes what it
 * saves. */
enum { VERSION = 17 };

static const char anew[] = "delete it and start again";

typedef struct {
    char magic[16];
    uint64_t version, real_nbytes;
} header;

static header header_of_this(void)
{
    return (header){ "saga-checkpoint", VERSION, sizeof(real) };
}

bool saga_checkpoint_is(const uint8_t *bytes, size_t nbytes)
{
    const header mine = header_of_this();

    return nbytes >= sizeof mine.magic &&
           memcmp(bytes, mine.magic, sizeof mine.magic) == 0;
}

uint64_t saga_digest(uint64_t sum, const void *data, size_t nbytes)
{
    const uint8_t *const p = data;

    for (size_t i = 0; i < nbytes; i++)
        sum = (sum ^ p[i]) * 0x100000001b3u;
    return sum;
}

bool saga_checkpoint_create(saga_checkpoint *c, const char *path,
                            saga_error *error)
{
    header h = header_of_this();

    *c = (saga_checkpoint){ .path = path, .sum = SAGA_DIGEST_START };
    if (!saga_output_open(&c->out, path, error))
        return false;
    saga_checkpoint_walk(c, &h, sizeof h);
    return true;
}

/* Compares the header and the digest. */
static bool check(const saga_bytes *b, const char *path, saga_error *error)
{
    const header mine = header_of_this();
    uint64_t sum;

    if (b->nbytes < sizeof mine + sizeof sum)
        return saga_fail(error, path, anew, "is cut short");
    /* Compares magic, version and the size of a real together. */
    if (memcmp(b->data, &mine, sizeof mine) != 0)
        return saga_fail(error, path, anew,
                         "is not a checkpoint of this "
                         "version of the program");
    memcpy(&sum, b->data + b->nbytes - sizeof sum, sizeof sum);
    return saga_digest(SAGA_DIGEST_START, b->data, b->nbytes - sizeof sum) ==
               sum ||
           saga_fail(error, path, anew, "is damaged or cut short");
}

bool saga_checkpoint_open(saga_checkpoint *c, const char *path,
                          saga_error *error)
{
    *c = (saga_checkpoint){ .path = path, .reading = true };
    if (!saga_read_file(&c->bytes, path, error))
        return false;
    if (!check(&c->bytes, path, error)) {
        saga_bytes_free(&c->bytes);
        return false;
    }
    /* The walk covers the bytes between header and digest. */
    c->rest.next = c->bytes.data + sizeof(header);
    c->rest.end = c->bytes.data + c->bytes.nbytes - sizeof c->sum;
    return true;
}

static void get(saga_checkpoint *c, void *data, size_t nbytes)
{
    const uint8_t *const from = c->failed ? NULL : saga_take(&c->rest, nbytes);

    /* After a failure all data is zero, so the walk can go on to its end, and
     * sizes that it reads allocate nothing. */
    if (from) {
        memcpy(data, from, nbytes);
    } else {
        memset(data, 0, nbytes);
        c->failed = true;
    }
}

void saga_checkpoint_walk(saga_checkpoint *c, void *data, size_t nbytes)
{
    if (nbytes == 0)
        return;
    if (c->reading) {
        get(c, data, nbytes);
    } else if (!c->failed) {
        c->sum = saga_digest(c->sum, data, nbytes);
        c->failed = fwrite(data, 1, nbytes, c->out.file) != nbytes;
    }
}

void saga_checkpoint_expect(saga_checkpoint *c, uint64_t value)
{
    uint64_t x = value;

    saga_checkpoint_walk(c, &x, sizeof x);
    c->failed = c->failed || x != value;
}

bool saga_checkpoint_close(saga_checkpoint *c, bool ok, saga_error *error)
{
    uint64_t sum = c->sum;

    if (!c->reading) {
        /* The walk changes c->sum, so a copy is written. */
        saga_checkpoint_walk(c, &sum, sizeof sum);
        return saga_output_close(&c->out, ok && !c->failed, error);
    }
    /* Bytes that are left over are an error too. */
    ok = ok && !c->failed && saga_left(&c->rest) == 0;
    saga_bytes_free(&c->bytes);
    return ok || saga_fail(error, c->path, anew, "contradicts itself");
}
