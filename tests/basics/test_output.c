/* SPDX-License-Identifier: MIT
 *
 * Output files appear when they are complete or not at all. The tests put other
 * things in their way: devices, pipes, links, permissions, the user's own
 * files, remains of killed runs, and other writers.
 */
#include "file.h"
#include "output.h"
#include "testing.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

static char folder[] = "/tmp/test_output.XXXXXX";

static int enter(void **state)
{
    (void)state;
    return !mkdtemp(folder) || chdir(folder) != 0;
}

/* Returns the number of files in the folder. */
static int count(void)
{
    DIR *const dir = opendir(".");
    int n = -2;

    assert_non_null(dir);
    while (readdir(dir))
        n++;
    closedir(dir);
    return n;
}

static int clear(void **state)
{
    (void)state;
    return system("rm -f ./*") != 0;
}

static int leave(void **state)
{
    return clear(state) || chdir("/") != 0 || rmdir(folder) != 0;
}

static void write_text(const char *path, const char *text)
{
    saga_output out;

    assert_done(saga_output_open(&out, path, &error));
    assert_true(fputs(text, out.file) >= 0);
    assert_done(saga_output_close(&out, true, &error));
}

static void assert_holds(const char *path, const char *text)
{
    FREED_BY(saga_bytes_free) saga_bytes bytes;

    assert_done(saga_read_file(&bytes, path, &error));
    assert_string_equal((const char *)bytes.data, text);
}

static mode_t kind_of(const char *path)
{
    struct stat info;

    assert_int_equal(lstat(path, &info), 0);
    return info.st_mode;
}

TEST_WITH(part_should_go_when_given_up, NULL, clear)
{
    saga_error error = { "" };
    saga_output out;

    write_text("a", "old");
    assert_true(saga_output_open(&out, "a", &error));
    assert_int_equal(count(), 2);
    assert_true(fputs("new", out.file) >= 0);
    assert_holds("a", "old");
    assert_false(saga_output_close(&out, false, &error));
    assert_int_equal(count(), 1);
    assert_holds("a", "old");
}

TEST_WITH(device_should_stay_one, NULL, clear)
{
    assert_int_equal(symlink("/dev/null", "null"), 0);
    write_text("null", "text");
    assert_true(S_ISLNK(kind_of("null")));
    assert_int_equal(count(), 1);
}

TEST_WITH(pipe_should_be_written, NULL, clear)
{
    char text[8] = "";
    int fd;

    assert_int_equal(mkfifo("fifo", 0600), 0);
    fd = open("fifo", O_RDONLY | O_NONBLOCK);
    assert_true(fd >= 0);
    write_text("fifo", "text");
    assert_int_equal(read(fd, text, sizeof text), 4);
    assert_string_equal(text, "text");
    close(fd);
    assert_true(S_ISFIFO(kind_of("fifo")));
    assert_int_equal(count(), 1);
}

TEST_WITH(pipe_should_not_be_waited_for_when_read, NULL, clear)
{
    saga_error error = { "" };
    saga_bytes bytes;

    assert_int_equal(mkfifo("fifo", 0600), 0);
    alarm(120);
    assert_false(saga_read_file(&bytes, "fifo", &error));
    alarm(0);
    assert_non_null(strstr(error.message, "not a regular file"));
}

TEST_WITH(full_device_should_be_told, NULL, clear)
{
    saga_error error = { "" };
    saga_output out;

    if (access("/dev/full", W_OK) != 0)
        return;
    assert_true(saga_output_open(&out, "/dev/full", &error));
    assert_true(fputs("text", out.file) >= 0);
    assert_false(saga_output_close(&out, true, &error));
    assert_non_null(strstr(error.message, "free space"));
}

/* Once a write has failed, stdio forgets the error, and closing the file
 * succeeds. The failure must be reported nevertheless. */
TEST_WITH(write_of_before_should_be_told, NULL, clear)
{
    const struct rlimit little = { 8192, RLIM_INFINITY };
    struct rlimit before;
    saga_error error = { "" };
    saga_output out;

    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    assert_true(saga_output_open(&out, "long", &error));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &little), 0);
    for (int i = 0; !ferror(out.file) && i < 100000; i++)
        fputs("text", out.file);
    assert_true(ferror(out.file));
    errno = 0;
    assert_false(saga_output_close(&out, true, &error));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_null(strstr(error.message, strerror(0)));
    assert_non_null(strstr(error.message, "long: could not be written; "));
    assert_non_null(strstr(error.message, "free space"));
    assert_int_equal(count(), 0);
}

TEST_WITH(link_should_be_followed, NULL, clear)
{
    write_text("file", "old");
    assert_int_equal(symlink("file", "link"), 0);
    write_text("link", "new");
    assert_true(S_ISLNK(kind_of("link")));
    assert_holds("file", "new");
}

TEST_WITH(folder_should_be_refused, NULL, clear)
{
    saga_error error = { "" };
    saga_output out;

    assert_false(saga_output_open(&out, ".", &error));
    assert_non_null(strstr(error.message, "is a folder"));
}

TEST_WITH(permissions_should_be_those_of_umask, NULL, clear)
{
    const mode_t old = umask(077);

    write_text("a", "");
    umask(022);
    write_text("b", "");
    umask(old);
    assert_int_equal(kind_of("a") & 0777, 0600);
    assert_int_equal(kind_of("b") & 0777, 0644);
    assert_int_equal(chmod("b", 0664), 0);
    write_text("b", "again");
    assert_int_equal(kind_of("b") & 0777, 0664);
}

/* Opens an output in a process that then dies, like a run that is killed. */
static void die_writing(const char *path)
{
    const pid_t pid = fork();
    int status;

    if (pid == 0) {
        saga_error error = { "" };
        saga_output out;

        if (!saga_output_open(&out, path, &error) ||
            fputs("half", out.file) < 0 || fflush(out.file))
            _exit(1);
        _exit(0);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
}

TEST_WITH(parts_of_killed_runs_should_be_removed, NULL, clear)
{
    die_writing("a");
    die_writing("b");
    die_writing("a");
    assert_int_equal(count(), 2);
    write_text("a", "whole");
    assert_int_equal(count(), 2);
    assert_false(saga_output_sweep("b"));
    assert_int_equal(count(), 1);
    assert_holds("a", "whole");
}

/* Numbers of processes come back, at once where a container has few. */
TEST_WITH(killed_run_of_the_same_number_should_not_be_in_the_way, NULL, clear)
{
    saga_error error = { "" };
    saga_output out;
    char part[64];

    (void)snprintf(part, sizeof part, "a.saga-part-%ld-0", (long)getpid());
    fclose(fopen(part, "w"));
    assert_true(saga_output_open_alone(&out, "a", &error));
    assert_true(fputs("whole", out.file) >= 0);
    assert_true(saga_output_close(&out, true, &error));
    assert_int_equal(count(), 1);
    assert_holds("a", "whole");
}

/* Makes a folder output with a file in a process that then dies. */
static void die_filling(const char *path)
{
    const pid_t pid = fork();
    int status;

    if (pid == 0) {
        saga_error error = { "" };
        int lock;
        const char *const name = saga_output_folder(path, &lock, &error);

        if (!name || chdir(name) || mkdir("in", 0700) || !fopen("in/file", "w"))
            _exit(1);
        _exit(0);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
}

TEST_WITH(folders_of_killed_runs_should_be_removed, NULL, clear)
{
    const mode_t old = umask(027);
    saga_error error = { "" };
    FREED char *name;
    int lock;

    die_filling("a");
    assert_int_equal(count(), 1);
    name = saga_output_folder("a", &lock, &error);
    umask(old);
    assert_non_null(name);
    assert_int_equal(count(), 1);
    assert_int_equal(kind_of(name) & 0777, 0750);
    assert_true(saga_output_sweep("a"));
    close(lock);
    assert_false(saga_output_sweep("a"));
    assert_int_equal(count(), 0);
}

TEST_WITH(parts_should_go_when_abandoned, NULL, clear)
{
    saga_error error = { "" };
    saga_output out[70];
    char *part[70];
    char name[8];

    for (int i = 0; i < 70; i++) {
        (void)snprintf(name, sizeof name, "f%d", i);
        assert_true(saga_output_open(&out[i], name, &error));
        part[i] = out[i].temporary;
    }
    assert_true(saga_output_close(&out[0], true, &error));
    assert_true(saga_output_close(&out[1], false, &error) || error.message[0]);
    assert_int_equal(count(), 69);
    error.message[0] = '\0';
    saga_output_abandon(); /* there are 64 places, two of which are empty */
    assert_int_equal(count(), 7);
    for (int i = 2; i < 70; i++) {
        error.message[0] = '\0';
        assert_int_equal(saga_output_close(&out[i], true, &error), i >= 64);
    }
    for (int i = 2; i < 64; i++)
        free(part[i]); /* a signal handler must not */
    assert_int_equal(count(), 7);
    assert_int_equal(access("f0", F_OK), 0);
}

static void abandon_and_die(int number)
{
    (void)number;
    saga_output_abandon();
    _exit(0);
}

/* A signal comes at any time while files are created and removed. */
TEST_WITH(no_part_should_stay_when_a_signal_comes, NULL, clear)
{
    for (int i = 0; i < 300; i++) {
        const pid_t pid = fork();
        int status;

        if (pid == 0) {
            const struct itimerval soon = { .it_value.tv_usec = 1 + 7 * i };
            saga_error error = { "" };
            saga_output out;

            signal(SIGALRM, abandon_and_die);
            setitimer(ITIMER_REAL, &soon, NULL);
            while (saga_output_open(&out, "a", &error))
                (void)saga_output_close(&out, false, &error);
            _exit(1);
        }
        assert_int_equal(waitpid(pid, &status, 0), pid);
        assert_int_equal(status, 0);
        assert_int_equal(count(), 0);
    }
}

TEST_WITH(files_of_the_user_should_stay, NULL, clear)
{
    static const char *const names[] = {
        "a.part",           "a.XXXXXX",
        "a.saga-part",      "a.saga-part-",
        "a.saga-part-x",    "a.saga-part-12x",
        "ba.saga-part-1-2", "a.ckpt.saga-part-1-2"
    };
    const int n = (int)(sizeof names / sizeof *names);

    for (int i = 0; i < n; i++)
        fclose(fopen(names[i], "w"));
    write_text("a", "text");
    assert_int_equal(count(), n + 1);
}

TEST_WITH(writers_should_keep_apart_when_one_is_alone, NULL, clear)
{
    saga_error error = { "" }, none = { "" };
    saga_output first, second;

    assert_true(saga_output_open_alone(&first, "a", &none));
    assert_false(saga_output_open_alone(&second, "a", &error));
    assert_non_null(strstr(error.message, "written by another run"));
    assert_int_equal(count(), 1);
    assert_true(saga_output_sweep("a"));
    assert_true(saga_output_open_alone(&second, "b", &none));
    assert_false(saga_output_close(&second, false, &none));
    assert_true(fputs("first", first.file) >= 0);
    assert_true(saga_output_close(&first, true, &none));
    assert_holds("a", "first");
    assert_true(saga_output_open_alone(&second, "a", &none));
    assert_true(saga_output_close(&second, true, &none));
    assert_int_equal(count(), 1);
}

TEST_GROUP(enter, leave);
