/* SPDX-License-Identifier: MIT */
#include "video_owner.h"

#include "moments.h"

#include <stdint.h>
#include <string.h>
#include <strings.h>

/* The rules by which a video's name without extension belongs to a camera, the
 * most certain first: "trial" to camera "trial", "walk-camA" to "A", "port_3"
 * to "cam_03". */
static bool is_same(const char *camera, const char *video, size_t n)
{
    return strlen(camera) == n && strncasecmp(camera, video, n) == 0;
}

static bool ends_so(const char *camera, const char *video, size_t n)
{
    const size_t m = strlen(camera);

    return m > 0 && m <= n && strncasecmp(camera, video + n - m, m) == 0;
}

static bool has_number(const char *camera, const char *video, size_t n)
{
    uint64_t a, b;

    return saga_last_number(camera, strlen(camera), &a) &&
           saga_last_number(video, n, &b) && a == b;
}

static bool (*const rules[])(const char *camera, const char *video,
                             size_t n) = { is_same, ends_so, has_number };

enum { N_RULES = sizeof rules / sizeof *rules };

static bool belongs(const saga_listing *l, int rule, int camera,
                    const char *video)
{
    return rules[rule](l->sources[camera].name, video,
                       (size_t)(strrchr(video, '.') - video));
}

int saga_video_of(const saga_listing *l, const saga_names *videos, int rule,
                  int camera)
{
    int found = -1;

    for (int v = 0; v < (int)videos->n; v++)
        if (belongs(l, rule, camera, videos->at[v])) {
            if (found >= 0)
                return -1;
            found = v;
        }
    for (int i = 0; found >= 0 && i < l->n_sources; i++)
        if (i != camera && belongs(l, rule, i, videos->at[found]))
            return -1;
    return found;
}

int saga_video_rule(const saga_listing *l, const saga_names *videos)
{
    int best = -1, most = 0;

    for (int rule = 0; rule < N_RULES; rule++) {
        int n = 0;

        for (int i = 0; i < l->n_sources; i++)
            n += saga_video_of(l, videos, rule, i) >= 0;
        if (n > most) {
            best = rule;
            most = n;
        }
    }
    return best;
}
