/* SPDX-License-Identifier: MIT
 *
 * The defaults of saga encode's options, and the checks of combinations.
 */
#include "encode_options.h"

#include "cli.h"
#include "encode_log.h"
#include "error.h"
#include "json_cli.h"

#include <stdio.h>
#include <string.h>

saga_encode_options saga_encode_defaults(void)
{
    const saga_train_options t = saga_train_defaults();

    return (saga_encode_options){ .capture = SAGA_CAPTURE_CHOICE,
                                  .preset = "balanced",
                                  .only = -1,
                                  .model = "auto",
                                  .device = "auto",
                                  .level = t.level,
                                  .layers = t.n_layers,
                                  .seed = (int)t.seed,
                                  .every = (int)t.checkpoint_seconds,
                                  .lambda = t.lambda };
}

bool saga_encode_is_paper(const saga_encode_options *o)
{
    return strcmp(o->model, "paper") == 0;
}

bool saga_encode_is_part(const saga_encode_options *o)
{
    return o->networks_only || o->only >= 0;
}

bool saga_encode_can_finish(const saga_encode_options *o)
{
    return !saga_encode_is_part(o) && !o->sweep && !o->json;
}

/* --- What excludes what -------------------------------------------------- */

/* Returns what is wrong with the combination of options, or NULL. */
static const char *contradiction(const saga_encode_options *o,
                                 const saga_ablation *ablation)
{
    const bool sized = o->size + o->bitrate > 0 || o->sweep;
    const bool part = saga_encode_is_part(o), layers = o->layers > 1;
    /* The first true condition is reported: missing options, then
     * contradictions, then what a tool cannot do. */
    const struct {
        bool is_there;
        const char *says;
    } wrong[] = {
        { !o->output && o->sweep, "the output is missing; give -o FOLDER" },
        { !o->output, "the output is missing; give -o FILE.saga" },
        { o->box[0] < o->box[3] && !saga_capture_of_subject(&o->capture),
          "--box is the box of a subject; give --subject or --key too" },
        { o->still && o->moving, "--still and --moving exclude each other" },
        { (o->lambda > 0) + (o->size > 0) + (o->bitrate > 0) + o->sweep > 1,
          "give only one of --lambda, --size, --bitrate and --sweep: each "
          "determines the file's size" },
        { o->finish && !o->resume,
          "--finish needs --resume: it makes a file of a stopped training" },
        { o->finish && !saga_encode_can_finish(o),
          "--finish makes no report, and no part of a film or of a sweep; "
          "leave --json, --networks-only, --only and --sweep out" },
        { o->log && o->sweep, "--log records one training, but --sweep has "
                              "several; give one of them" },
        { o->networks_only && o->only >= 0,
          "--networks-only and --only "
          "exclude each other: --networks-only makes the file that --only "
          "needs" },
        { (o->only >= 0) != (o->networks != NULL),
          "--only N and --networks "
          "FILE go together; --networks-only makes FILE" },
        { part && sized,
          "segments that are trained apart cannot share one "
          "size; give --lambda and --primitives instead of --size, --bitrate "
          "or --sweep" },
        { layers && part, "--layers needs all segments trained in one place; "
                          "leave --networks-only and --only out" },
        { layers && (ablation->slots || ablation->plain_update),
          "files of "
          "several --layers have no memory bank; leave slots and plain-update "
          "of --ablate out" }
    };

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        if (wrong[i].is_there)
            return wrong[i].says;
    return NULL;
}

/* Checks that the names in a report can be written as JSON. */
static int check_names(const saga_encode_options *o)
{
    const char *const told[] = { o->output, o->capture.hold_out,
                                 o->capture.late };
    int status = SAGA_EXIT_OK;

    for (size_t i = 0; !status && i < sizeof told / sizeof told[0]; i++)
        if (o->json || o->sweep)
            status = saga_cli_json_can_name("encode", told[i]);
    return status;
}

static int unknown_preset(const char *name)
{
    const saga_preset *p;
    char names[80] = "";
    size_t n = 0;

    for (int i = 0; (p = saga_preset_at(i)) && n < sizeof names; i++)
        n += (size_t)snprintf(names + n, sizeof names - n, "%s%s",
                              i == 0                  ? ""
                              : saga_preset_at(i + 1) ? ", "
                                                      : " or ",
                              p->name);
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "encode: --preset takes %s, not "
                          "'%s'",
                          names, name);
}

int saga_encode_check_options(const saga_encode_options *o,
                              const saga_preset **preset,
                              saga_ablation *ablation)
{
    saga_error error = { "" };
    const char *says;

    /* First the options that are words or numbers of their own, then what
     * contradicts each other. */
    *preset = saga_preset_called(o->preset);
    if (!*preset)
        return unknown_preset(o->preset);
    if (strcmp(o->model, "auto") != 0 && !saga_encode_is_paper(o))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: --model takes auto or "
                              "paper, not '%s'",
                              o->model);
    if (!saga_ablation_read(ablation, o->ablate, &error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", error.message);
    if (o->metres < 0)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: --metres takes a "
                              "length above 0, not %g",
                              o->metres);
    if (o->log && !saga_encode_log_name(o->log))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: --log takes FILE.csv "
                              "or FILE.jsonl, not '%s'",
                              o->log);
    says = contradiction(o, ablation);
    return says ? saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", says)
                : check_names(o);
}

/* --- In reports ---------------------------------------------------------- */

json_t *saga_encode_options_json(const saga_encode_options *o)
{
    const saga_capture_choice *const c = &o->capture;
    json_t *const list = json_object();

    /* Values are those that the training used; options that have no effect on
     * the file (threads, names of files) are left out. */
    saga_put_text(list, "preset", o->preset);
    saga_put_text(list, "model", o->model);
    saga_put(list, "frames", json_pack("[ii]", c->frames.a, c->frames.b));
    saga_put_int(list, "scale", c->scale ? c->scale : 1);
    saga_put_int(list, "segment", o->segment);
    saga_put_int(list, "primitives", o->primitives);
    saga_put_int(list, "iterations", o->iterations);
    saga_put_real(list, "minutes", o->minutes);
    saga_put_int(list, "level", o->level);
    saga_put_int(list, "layers", o->layers);
    saga_put_int(list, "seed", o->seed);
    saga_put_flag(list, "alpha_masks", c->alpha_masks);
    saga_put_flag(list, "subject", c->subject);
    if (c->key.given)
        saga_put(
            list, "key",
            json_pack("[iii]", c->key.rgb[0], c->key.rgb[1], c->key.rgb[2]));
    if (o->box[0] < o->box[3])
        saga_put(list, "box",
                 json_pack("[ffffff]", o->box[0], o->box[1], o->box[2],
                           o->box[3], o->box[4], o->box[5]));
    saga_put_real(list, "lambda", o->lambda);
    saga_put_real(list, "size", o->size);
    saga_put_real(list, "bitrate", o->bitrate);
    saga_put_flag(list, "no_refine", o->no_refine);
    saga_put_flag(list, "no_exposure", o->no_exposure);
    saga_put_flag(list, "still", o->still);
    saga_put_flag(list, "moving", o->moving);
    saga_put_text(list, "hold_out", c->hold_out);
    saga_put_text(list, "late", c->late);
    saga_put_text(list, "ablate", o->ablate);
    return list;
}
