/* SPDX-License-Identifier: MIT
 *
 * Makes the folder of a built-in scene under a temporary name, and removes it
 * if something fails.
 */
#include "synth_job.h"

#include "alloc.h"
#include "error.h"
#include "output.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

bool saga_synth_is_free(const saga_synth_job *job)
{
    DIR *const dir = opendir(job->target);
    int n = 0;
    if (!dir && (errno == ENOENT))
        return true;
    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;)
        n += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
    if (dir)
        closedir(dir);
    return (dir && n == 0) || saga_fail(job->error, job->target,
                                        "remove it or choose another "
                                        "name",
                                        "exists and is not an empty folder");
}

bool saga_synth_begin_folder(saga_synth_job *job)
{
    size_t n = strlen(job->target);
    while (n > 1 && job->target[n - 1] == '/')
        n--;
    if (n > SAGA_SYNTH_PATH - 200)
        return saga_fail(job->error, job->target, "use a shorter one",
                         "path is too long");
    char *const target = saga_alloc(n + 1, 1, job->target, job->error);
    if (!target)
        return false;
    memcpy(target, job->target, n);
    target[n] = '\0';
    job->folder = saga_output_folder(target, &job->lock, job->error);
    free(target);
    return job->folder != NULL;
}

static const char *const kinds[] = { "images", "depth", "masks" };

enum { N_KINDS = (int)(sizeof kinds / sizeof kinds[0]) };

static bool make_folder(const saga_synth_job *job, const char *path)
{
    return mkdir(path, 0777) == 0 || saga_fail_errno(job->error, job->target,
                                                     "choose a place that can "
                                                     "be written",
                                                     "folder cannot be made");
}

bool saga_synth_make_folders(const saga_synth_job *job)
{
    char path[SAGA_SYNTH_PATH];
    const bool wanted[N_KINDS] = { true, job->options->depth_every > 0,
                                   job->options->masks };
    for (int k = 0; k < N_KINDS; k++) {
        if (!wanted[k])
            continue;
        (void)snprintf(path, sizeof path, "%s/%s", job->folder, kinds[k]);
        if (!make_folder(job, path))
            return false;
        for (int c = 0; c < job->options->n_cameras; c++) {
            (void)snprintf(path, sizeof path, "%s/%s/%s", job->folder, kinds[k],
                           job->views[c].name);
            if (!make_folder(job, path))
                return false;
        }
    }
    return true;
}

/* Removes a folder and the plain files in it. */
static void remove_flat(const char *path)
{
    DIR *const dir = opendir(path);
    char file[SAGA_SYNTH_PATH + 300];
    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;) {
        if (strcmp(e->d_name, ".") == 0 || strcmp(e->d_name, "..") == 0)
            continue;
        (void)snprintf(file, sizeof file, "%s/%s", path, e->d_name);
        (void)unlink(file);
    }
    if (dir)
        closedir(dir);
    (void)rmdir(path);
}

void saga_synth_remove(const saga_synth_job *job)
{
    char path[SAGA_SYNTH_PATH];
    /* The folders that this run has made, and the plain files in them. */
    for (int k = 0; k < N_KINDS; k++) {
        for (int c = 0; c < job->options->n_cameras; c++) {
            (void)snprintf(path, sizeof path, "%s/%s/%s", job->folder, kinds[k],
                           job->views[c].name);
            remove_flat(path);
        }
        (void)snprintf(path, sizeof path, "%s/%s", job->folder, kinds[k]);
        remove_flat(path);
    }
    remove_flat(job->folder);
}

void saga_synth_path(const saga_synth_job *job, const char *kind,
                     const char *ending, int camera, int frame,
                     char path[SAGA_SYNTH_PATH])
{
    (void)snprintf(path, SAGA_SYNTH_PATH, "%s%s%s/%s/%05d.%s", job->folder,
                   job->folder[0] ? "/" : "", kind, job->views[camera].name,
                   frame, ending);
}

bool saga_synth_has_depth(const saga_synth_options *o, int frame)
{
    return o->depth_every > 0 && frame % o->depth_every == 0;
}
