/* SPDX-License-Identifier: MIT
 *
 * The work of `saga eval`, for other commands that judge files.
 */
#ifndef SAGA_EVAL_CLI_H
#define SAGA_EVAL_CLI_H

#include "capture_cli.h"

#include <jansson.h>

typedef struct saga_eval_request {
    bool json;                   /* what is printed, as JSON */
    bool no_ssim, equirect;
    saga_capture_choice capture;
    saga_cli_pair only;          /* of the file; 0, 0: all */
    const char *pictures;        /* folder for them, or NULL */
    const char *weights;         /* of LPIPS, or NULL */
} saga_eval_request;

/* Judges a file by a capture, as `saga eval --json` does; request->json is not
 * looked at. *report is its report, to be freed by json_decref, and NULL after
 * an error, which is told. Its making is watched (json_memory.h). The exit
 * status. */
int saga_eval_judge(json_t **report, const char *file, const char *capture,
                    const saga_eval_request *request);

#endif
