/* SPDX-License-Identifier: MIT
 *
 * Memory in a file without a name: it keeps what is written, leaves nothing in
 * its folder, is no anonymous memory, and is refused before it is used where
 * its disk has no room.
 */
#include "scratch.h"
#include "testing.h"

#include <dirent.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

static char folder[] = "/tmp/test_scratch.XXXXXX";

static int enter(void **state)
{
    (void)state;
    return !mkdtemp(folder);
}

static int leave(void **state)
{
    (void)state;
    return rmdir(folder); /* fails if a file is left */
}

/* Returns the number of files in the folder. */
static int count(void)
{
    DIR *const dir = opendir(folder);
    int n = -2; /* without . and .. */

    assert_non_null(dir);
    while (readdir(dir))
        n++;
    closedir(dir);
    return n;
}

/* Returns a line of /proc/self/status in KiB; -1 if there is no such file. */
static long status_kib(const char *name)
{
    FILE *const file = fopen("/proc/self/status", "r");
    char line[160];
    long n = -1;

    while (file && fgets(line, sizeof line, file))
        if (strncmp(line, name, strlen(name)) == 0)
            n = atol(line + strlen(name));
    if (file)
        fclose(file);
    return n;
}

TEST(scratch_should_keep_what_is_written)
{
    enum { N = 3 * 4096 + 5 };
    saga_scratch a, b;

    assert_done(saga_scratch_make(&a, folder, N, &error));
    assert_done(saga_scratch_make(&b, folder, N, &error));
    assert_int_equal(a.nbytes, N);
    assert_int_equal(count(), 0);
    for (size_t i = 0; i < N; i++) {
        assert_int_equal(a.at[i], 0);
        a.at[i] = (uint8_t)(i * 7);
    }
    for (size_t i = 0; i < N; i++) {
        assert_int_equal(a.at[i], (uint8_t)(i * 7));
        assert_int_equal(b.at[i], 0);
    }
    saga_scratch_free(&a);
    saga_scratch_free(&b);
    assert_null(a.at);
    saga_scratch_free(&a);
    assert_int_equal(count(), 0);
}

TEST(scratch_should_be_no_anonymous_memory)
{
    enum { KIB = 32 << 10 };
    const long before = status_kib("RssAnon:");
    saga_scratch s;

    if (before < 0)
        skip();
    assert_done(saga_scratch_make(&s, folder, (uint64_t)KIB << 10, &error));
    memset(s.at, 1, s.nbytes);
    assert_true(status_kib("RssAnon:") - before < KIB / 8);
    saga_scratch_free(&s);
}

/* A limit on the size of files stands for a full disk. */
TEST(scratch_should_be_refused_where_it_has_no_room)
{
    const struct rlimit little = { 8192, RLIM_INFINITY };
    struct rlimit before;
    saga_scratch s;
    saga_error error = { "" };

    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &little), 0);
    assert_true(saga_scratch_make(&s, folder, 8192, &error));
    saga_scratch_free(&s);
    assert_false(saga_scratch_make(&s, folder, 9000000, &error));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_null(s.at);
    assert_non_null(strstr(error.message, folder));
    assert_non_null(strstr(error.message, "scratch file of 0.009 GB"));
    assert_non_null(strstr(error.message, " GB are free"));
    assert_non_null(strstr(error.message, "--scratch"));
    assert_int_equal(count(), 0);
}

TEST(scratch_should_be_refused_without_its_folder)
{
    saga_scratch s;
    saga_error error = { "" };

    assert_false(saga_scratch_make(&s, "/no/such/folder", 1, &error));
    assert_null(s.at);
    assert_non_null(strstr(error.message, "/no/such/folder"));
    assert_non_null(strstr(error.message, "--scratch"));
}

TEST(scratch_should_be_refused_if_no_memory_is_that_large)
{
    saga_scratch s;
    saga_error error = { "" };

    assert_false(saga_scratch_make(&s, folder, UINT64_MAX, &error));
    assert_null(s.at);
    assert_true(saga_failed(&error));
}

TEST_GROUP(enter, leave);
