/* SPDX-License-Identifier: MIT
 *
 * Videos whose frames can be told apart, and captures of them.
 */
#ifndef VIDEO_FILES_H
#define VIDEO_FILES_H

#include "capture_files.h"

enum { W = 32, H = 16 };

/* --- Videos -------------------------------------------------------------- */

/* Writes a lossless grey video. Frame k has luma 16 + 10 k, which is 255 (10 k)
 * / 219 in BT.709 limited range. Each is encoded once and kept, because a start
 * of ffmpeg takes a fifth of a second. */
static inline void write_video(folder *f, const char *name, int n, int fps,
                               const char *options)
{
    enum { MOST = 16 };
    static struct {
        char key[160];
        saga_bytes file;
    } kept[MOST];
    char key[sizeof kept[0].key];
    bytes b = { 0 };
    int i = 0;

    snprintf(key, sizeof key, "%d %d %s %s", n, fps, options,
             strrchr(name, '.'));
    while (i < MOST - 1 && kept[i].file.data && strcmp(kept[i].key, key) != 0)
        i++;
    if (kept[i].file.data && strcmp(kept[i].key, key) == 0) {
        b = (bytes){ kept[i].file.data, kept[i].file.nbytes, 0 };
        write_part(f, name, &b, b.n);
        return;
    }
    for (int k = 0; k < n; k++)
        for (int p = 0; p < 3 * W * H; p++)
            put_le(&b, (uint64_t)(p < W * H ? 16 + 10 * k : 128), 1);
    write_bytes(f, "raw", &b);
    folder_run(f,
               "ffmpeg -nostdin -v error -f rawvideo -pix_fmt yuv444p -s "
               "%dx%d -r %d -i raw -c:v libx264 -qp 0 %s -y %s && rm raw",
               W, H, fps, options, name);
    saga_bytes_free(&kept[i].file);
    assert_done(saga_read_file(&kept[i].file, folder_file(f, name), &error));
    memcpy(kept[i].key, key, sizeof key);
}

static inline int grey_of(int frame)
{
    return (int)(255 * 10.0 * frame / 219 + 0.5);
}

/* Writes a camera for each name; all look in the same direction. `top` has more
 * entries of the file, each with a comma behind it; without a focal length or
 * an angle, that of 30 pixels is added. */
static inline void write_json(folder *f, const char *top,
                              const char *const *names, int n)
{
    bytes b = { 0 };

    put_text(&b, "{%s%s\"frames\": [",
             strstr(top, "fl_") || strstr(top, "angle") ? "" : "\"fl_x\": 30, ",
             top);
    for (int i = 0; i < n; i++)
        put_text(&b,
                 "%s{\"file_path\": \"%s\", \"transform_matrix\": "
                 "[[1,0,0,%d],[0,1,0,0],[0,0,1,0]]}",
                 i ? ", " : "", names[i], i);
    put_text(&b, "]}");
    write_bytes(f, "transforms.json", &b);
}

#endif
