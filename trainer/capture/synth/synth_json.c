/* SPDX-License-Identifier: MIT
 *
 * Writes the transforms.json of a built-in scene.
 */
#include "synth_job.h"

#include "output.h"
#include "pose.h"

#include <stdio.h>

static void write_matrix(FILE *f, const saga_source_view *view)
{
    double centre[3];
    saga_pose_centre(view->rotation, view->translation, centre);
    fprintf(f, "\"transform_matrix\": [");
    for (int i = 0; i < 3; i++) {
        const double *const r = view->rotation;
        /* The matrix is camera to world with the format's axes right, up and
         * backwards, so that y and z are negated. */
        fprintf(f, "[%.17g, %.17g, %.17g, %.17g], ", r[i], -r[3 + i], -r[6 + i],
                centre[i]);
    }
    fprintf(f, "[0, 0, 0, 1]]");
}

static void write_frame(FILE *f, const saga_synth_job *job, int camera,
                        int frame)
{
    saga_synth_job relative = *job;
    char none[] = "", path[SAGA_SYNTH_PATH];
    const saga_synth_options *const o = job->options;
    relative.folder = none;
    saga_synth_path(&relative, "images", o->exr ? "exr" : "png", camera, frame,
                    path);
    fprintf(f, "  {\"file_path\": \"%s\", \"time\": %.17g,\n", path,
            frame / o->fps);
    if (saga_synth_has_depth(o, frame)) {
        saga_synth_path(&relative, "depth", "exr", camera, frame, path);
        fprintf(f, "   \"depth_file_path\": \"%s\",\n", path);
    }
    fprintf(f, "   ");
    write_matrix(f, &job->views[camera]);
    fprintf(f, "}%s\n",
            camera == o->n_cameras - 1 && frame == o->n_frames - 1 ? "" : ",");
}

static void write_list(FILE *f, const saga_synth_job *job, const char *key,
                       bool held_out)
{
    const saga_synth_options *const o = job->options;
    saga_synth_job relative = *job;
    char none[] = "", path[SAGA_SYNTH_PATH];
    const char *separator = "";
    relative.folder = none;
    fprintf(f, " \"%s\": [", key);
    for (int c = 0; c < o->n_cameras; c++)
        for (int k = 0; k < o->n_frames; k++) {
            if (job->views[c].held_out != held_out)
                continue;
            saga_synth_path(&relative, "images", o->exr ? "exr" : "png", c, k,
                            path);
            fprintf(f, "%s\n  \"%s\"", separator, path);
            separator = ",";
        }
    fprintf(f, "],\n");
}

bool saga_synth_write_json(const saga_synth_job *job)
{
    const saga_synth_options *const o = job->options;
    const saga_source_view *const view = &job->views[0];
    char path[SAGA_SYNTH_PATH];
    saga_output out;
    (void)snprintf(path, sizeof path, "%s/transforms.json", job->folder);
    if (!saga_output_open(&out, path, job->error))
        return false;
    FILE *const f = out.file;
    /* All cameras have the same size and lens, so these stand at the top. */
    fprintf(f,
            "{\n \"camera_model\": \"PINHOLE\",\n \"fps\": %.17g,\n"
            " \"w\": %d, \"h\": %d,\n \"fl_x\": %.17g, \"fl_y\": %.17g,\n"
            " \"cx\": %.17g, \"cy\": %.17g,\n"
            " \"ply_file_path\": \"points.ply\",\n",
            o->fps, o->width, o->height, view->fx, view->fy, view->cx,
            view->cy);
    write_list(f, job, "train_filenames", false);
    write_list(f, job, "test_filenames", true);
    /* There is one entry for each picture, with its pose and time. */
    fprintf(f, " \"frames\": [\n");
    for (int c = 0; c < o->n_cameras; c++)
        for (int k = 0; k < o->n_frames; k++)
            write_frame(f, job, c, k);
    fprintf(f, " ]\n}\n");
    return saga_output_close(&out, true, job->error);
}
