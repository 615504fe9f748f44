/* SPDX-License-Identifier: MIT
 *
 * The work of `saga eval`, for use by other commands.
 */
#ifndef SAGA_EVAL_CLI_H
#define SAGA_EVAL_CLI_H

#include "capture_cli.h"

#include <jansson.h>

typedef struct saga_eval_request {
    bool json;  /* print JSON */
    bool quiet; /* show no progress */
    bool no_ssim, equirect;
    saga_capture_choice capture;
    saga_cli_pair only; /* evaluate only these frames of the file; 0, 0: all */
    const char *pictures; /* folder for pictures; NULL: write none */
    const char *weights;  /* file with the weights for LPIPS; NULL: no LPIPS */
} saga_eval_request;

/* Evaluates a file against a capture, as `saga eval --json` does; request->json
 * is ignored. Sets *report to the report, which the caller releases with
 * json_decref, or to NULL after an error, which has been reported. Failures of
 * memory while it is built are recorded (json_memory.h). Returns the exit
 * status. */
int saga_eval_judge(json_t **report, const char *file, const char *capture,
                    const saga_eval_request *request);

#endif
