/* SPDX-License-Identifier: MIT
 *
 * Writes the report of saga encode about a file, a part of a file, or networks.
 */
#include "encode_session.h"

#include "bytes_table.h"
#include "clock.h"
#include "cost.h"
#include "json_cli.h"
#include "verdict_cli.h"

#include <math.h>
#include <stdio.h>

/* Differences in dB between training and held-out PSNR from which views between
 * the cameras count as soft, and as poor. One that people just see side by side
 * is about 1 dB. */
#define SOFT_GAP 1.0
#define MOST_GAP 3.0

/* --- Pieces -------------------------------------------------------------- */

static json_t *quality_of(const saga_quality *q)
{
    json_t *const o = json_object();

    saga_put_real(o, "training", q->training);
    saga_put_real(o, "held_out", q->held_out);
    saga_put_int(o, "n_training", q->n_training);
    saga_put_int(o, "n_held_out", q->n_held_out);
    return o;
}

static json_t *layer_of(size_t nbytes, const saga_quality *q)
{
    json_t *const o = json_object();

    saga_put_int(o, "nbytes", (json_int_t)nbytes);
    saga_put(o, "psnr", quality_of(q));
    return o;
}

/* Lists bytes and quality of the file cut after each layer. The last entry is
 * the whole file, which the text reports separately. */
static json_t *layers_of(const saga_encode_session *s)
{
    json_t *const list = json_array();

    for (int k = 0; k + 1 < s->o->layers; k++) {
        json_t *const o = layer_of(s->result.cut[k].nbytes,
                                   &s->result.cut[k].quality);
        char what[40];

        snprintf(what, sizeof what, "  cut after layer %d: %zu B", k + 1,
                 s->result.cut[k].nbytes);
        saga_put_text(o, "/cut", what);
        saga_put_item(list, o);
    }
    saga_put_item(list,
                  layer_of(s->result.layout.file_nbytes, &s->result.decoded));
    return list;
}

static json_t *exposure_of(const saga_encode_session *s)
{
    const double *const x = saga_train_exposure(s->train);
    json_t *const o = json_object();

    for (int i = 0; i < s->capture.n_views; i++)
        saga_put(o, s->capture.views[i].name,
                 json_pack("[fff]", x[3 * i], x[3 * i + 1], x[3 * i + 2]));
    return o;
}

/* Reports the refinement of the cameras, or null if there was none. */
static json_t *refinement_of(const saga_encode_session *s)
{
    return s->poses.camera ? json_pack("{sfsf}", "before_px", s->poses.before,
                                       "after_px", s->poses.after)
                           : json_null();
}

static json_t *tools_of(const saga_train_report *r)
{
    json_t *const all = json_object();

    for (int i = 0; i < SAGA_TRAIN_N_TOOLS; i++) {
        json_t *o;

        if (!r->tool[i].asked)
            continue;
        o = json_object();
        saga_put_real(o, "worth", r->tool[i].worth);
        saga_put_real(o, "cost", r->tool[i].cost);
        saga_put_flag(o, "kept", r->tool[i].kept);
        saga_put(all, saga_train_tool_names[i], o);
    }
    return all;
}

/* Reports the base, or null if the capture has only one segment and needs no
 * decision. */
static json_t *base_of(const saga_train_report *r)
{
    const saga_train_base *const b = &r->base;
    json_t *o;

    if (b->why == SAGA_TRAIN_ONE_SEGMENT)
        return json_null();
    o = json_object();
    saga_put_int(o, "n_primitives", b->n_prim);
    saga_put_int(o, "n_kept", b->n_kept);
    saga_put_int(o, "n_still", b->n_still);
    saga_put_int(o, "n_looked_at", b->n_looked_at);
    saga_put_int(o, "/in_file", r->info.base_primitives);
    saga_put_real(o, "/still", b->n_still / fmax(b->n_looked_at, 1));
    return o;
}

static json_t *bits_of(const double bits[SAGA_N_SYMS])
{
    json_t *const o = json_object();
    double sum[SAGA_N_COMPONENTS];

    saga_cost_components(sum, bits);
    for (int i = 0; i < SAGA_N_COMPONENTS; i++)
        saga_put_real(o, saga_component_key((saga_component)i), sum[i]);
    return o;
}

/* Adds the cost of the symbols: by their code lengths, and as the range coder
 * spends it in the file (cost.h). */
static void put_bits(json_t *o, const saga_encode_sizes *z)
{
    double length[SAGA_N_COMPONENTS], spent[SAGA_N_COMPONENTS];
    json_t *const rows = json_array();

    saga_put(o, "bits", bits_of(z->bits));
    saga_put(o, "bits_spent", bits_of(z->spent));
    saga_cost_components(length, z->bits);
    saga_cost_components(spent, z->spent);
    for (int i = 0; i < SAGA_N_COMPONENTS; i++)
        saga_put_item(rows,
                      json_pack("{sssfsfsf}", "name",
                                saga_component_name((saga_component)i),
                                "length", length[i], "spent", spent[i], "part",
                                spent[i] / (8 * (double)z->total)));
    saga_put(o, "/bits", rows);
}

static json_t *kind_of(const saga_train_kind *k)
{
    static const struct {
        int bit;
        const char *name;
    } sources[] = { { SAGA_SOURCE_HYPER, "hyperprior" },
                    { SAGA_SOURCE_PARENT, "parent" },
                    { SAGA_SOURCE_GROUPS, "groups" },
                    { SAGA_SOURCE_BANK, "bank" } };
    json_t *const o = json_object();
    char text[64] = "";
    int n = 0;

    for (size_t i = 0; i < sizeof sources / sizeof sources[0]; i++)
        if (k->sources & (unsigned)sources[i].bit)
            n += snprintf(text + n, sizeof text - (size_t)n, "  %s",
                          sources[i].name);
    saga_put_int(o, "sources", (json_int_t)k->sources);
    saga_put_real(o, "constants", k->constants);
    saga_put_real(o, "networks", k->networks);
    saga_put_real(o, "without_bank", k->forgetful);
    saga_put_real(o, "chosen", k->chosen);
    saga_put_real(o, "weights", k->weights);
    saga_put_text(o, "/sources", n ? text : "  none");
    return o;
}

/* Adds how much the sources of the entropy model save: the bytes of the
 * residuals with constants and with networks, as estimated with each source
 * left out. */
static void put_entropy(json_t *report, const saga_train_entropy *e)
{
    static const struct {
        const char *key, *name;
    } kinds[SAGA_N_KINDS] = { { "coarse", "coarse anchors" },
                              { "fine", "fine offsets" },
                              { "primitives", "primitive offsets" } };
    json_t *const o = json_object(), *const rows = json_array();

    saga_put_real(o, "hyperprior_weights", e->hyper_weights);
    saga_put_real(o, "bank_weights", e->bank_weights);
    saga_put_real(o, "bank_net", e->bank_net);
    saga_put(o, "bits_estimated", bits_of(e->estimate));
    for (int i = 0; i < SAGA_N_KINDS; i++) {
        json_t *const kind = kind_of(&e->kind[i]);

        saga_put_text(kind, "/name", kinds[i].name);
        saga_put_item(rows, json_incref(kind));
        saga_put(o, kinds[i].key, kind);
    }
    saga_put(report, "entropy_model", o);
    saga_put(report, "/kinds", rows);
}

/* Returns who chose lambda, as text. */
static const char *reason_of_lambda(const saga_encode_session *s)
{
    return s->plan.wanted        ? ", chosen to meet the size"
           : !(s->o->lambda > 0) ? ", chosen to balance primitives and bits"
           : s->o->primitives    ? ""
                              : ", from which the number of primitives follows";
}

/* Returns a word for views from between the cameras, by how much worse they
 * are. */
static const char *between_word(double gap)
{
    return isnan(gap)       ? "unknown"
           : gap > MOST_GAP ? "poor"
           : gap > SOFT_GAP ? "soft"
                            : "good";
}

/* Says what to expect from between the cameras, as keys and as what the text
 * asks for. */
static void put_between(json_t *o, const saga_encode_result *r)
{
    const saga_quality *const q = &r->decoded;
    const double psnr = saga_encode_between(r);
    const double gap = q->n_training ? q->training - psnr : (double)NAN;
    const bool measured = q->n_held_out > 0;
    const char *const word = between_word(gap);
    json_t *const b = json_object();
    char aside[32];

    saga_put_real(b, "expected", psnr);
    saga_put_flag(b, "measured", measured);
    saga_put_real(b, "predicted", r->predicted ? r->between.psnr : (double)NAN);
    saga_put_int(b, "n_left_out", r->predicted ? r->between.n_views : 0);
    /* For the text. */
    saga_put_real(b, "/gap", gap);
    saga_put_flag(b, "/told", !measured && !isnan(gap));
    saga_put_flag(b, "/short", r->is_short);
    saga_put_flag(b, "/alone", r->predicted && r->between.n_views == 0);
    saga_put(o, "psnr_between", b);
    snprintf(aside, sizeof aside, "/between_%s", word);
    saga_put_text(o, "between_cameras", word);
    saga_put_flag(o, aside, true);
}

static void put_decoded(json_t *o, const saga_encode_session *s)
{
    const saga_quality *const q = &s->result.decoded;

    saga_put_text(o, "device", s->gpu ? saga_gpu_is(s->gpu)->name : NULL);
    saga_put_real(o, "seconds", saga_clock_seconds() - s->progress.started);
    saga_put(o, "psnr", quality_of(q));
    saga_put_verdict(o, &s->result.verdict, s->plan.preset->better);
    put_between(o, &s->result);
}

/* --- Reports ------------------------------------------------------------- */

static json_t *begin_report(const saga_encode_session *s)
{
    json_t *const o = saga_cli_json_head("encode", s->o->output);

    saga_put_text(o, "capture", s->capture_name);
    saga_put_int(o, "n_segments", s->n_segments);
    saga_put_int(o, "/last_segment", s->n_segments - 1);
    return o;
}

static json_t *report_networks(const saga_encode_session *s)
{
    json_t *const o = begin_report(s);

    saga_put_int(o, "first", saga_train_first(s->train));
    saga_put_text(o, "device", s->gpu ? saga_gpu_is(s->gpu)->name : NULL);
    saga_put_real(o, "seconds", saga_clock_seconds() - s->progress.started);
    return o;
}

/* Reports a part of a file. The cost of symbols and the worth of sources are
 * left out, because the training's numbers include the segment that made the
 * networks. */
static json_t *report_part(const saga_encode_session *s)
{
    const int k = s->o->only;
    json_t *const o = begin_report(s);

    saga_put_int(o, "nbytes", (json_int_t)s->result.layout.file_nbytes);
    saga_put_bytes(o, &s->result.layout);
    saga_put_int(o, "segment", k);
    saga_put_int(o, "n_frames", saga_encode_frames(s, k));
    saga_put_int(o, "/begin", saga_encode_begin(s, k));
    saga_put_int(o, "/end", saga_encode_begin(s, k + 1));
    put_decoded(o, s);
    return o;
}

/* Adds what the report says about the capture. */
static void put_capture(json_t *o, const saga_encode_session *s)
{
    const saga_train_report *const r = saga_train_report_of(s->train);

    saga_put_int(o, "n_views", s->capture.n_views);
    saga_put_int(o, "n_frames", s->whole.n_frames);
    saga_put_int(o, "scale", s->capture.scale);
    saga_put_int(o, "/chosen_scale", s->scale);
    saga_put_text(o, "late", s->poses.late);
    saga_put(o, "refinement", refinement_of(s));
    saga_put(o, "exposure", exposure_of(s));
    saga_put_real(o, "/exposure", saga_encode_exposure(s));
    saga_put_flag(o, "temporal", r->dynamic);
    saga_put_real(o, "explained", r->explained);
    saga_put_flag(o, "/has_explained", !isnan(r->explained));
    saga_put_real(o, "changing_pixels", r->changing);
}

/* Adds what the report says about the file. */
static void put_file(json_t *o, const saga_encode_session *s)
{
    const saga_train_report *const r = saga_train_report_of(s->train);
    const saga_encode_sizes *const z = &r->sizes;

    saga_put_int(o, "nbytes", (json_int_t)s->result.layout.file_nbytes);
    saga_put_real(o, "/film_seconds", s->whole.n_frames / s->whole.fps);
    saga_put_real(o, "/kb",
                  1e-3 * (double)z->total * s->whole.fps / s->whole.n_frames);
    saga_put_real(o, "/kbits",
                  8e-3 * (double)z->total * s->whole.fps / s->whole.n_frames);
    saga_put_bytes(o, &s->result.layout);
    saga_put(o, "/sizes",
             json_pack("{sIsIsIsIsIsIsI}", "header", (json_int_t)z->header,
                       "index", (json_int_t)z->index, "networks",
                       (json_int_t)z->networks, "base", (json_int_t)z->base,
                       "coarse", (json_int_t)z->coarse, "fine",
                       (json_int_t)z->fine, "prim", (json_int_t)z->prim));
    saga_put_int(o, "n_coarse", r->n.coarse);
    saga_put_int(o, "n_fine", r->n.fine);
    saga_put_int(o, "n_primitives", r->n.prim);
    saga_put_int(o, "memory_nbytes", (json_int_t)r->info.work_nbytes);
    saga_put(o, "base", base_of(r));
    saga_put_real(o, "lambda", r->lambda);
    saga_put_text(o, "/why_lambda", reason_of_lambda(s));
    saga_put_int(o, "level", r->info.level);
    saga_put_int(o, "parameters", r->n_parameters);
    /* Parameters that are not coded have 16 bits each. */
    if (s->plan.ablation.raw_networks)
        saga_put_int(o, "/raw_nbytes", 2 * (json_int_t)r->n_parameters);
    saga_put(o, "tools", tools_of(r));
    saga_put_real(o, "clamped_primitives", (double)r->quantise.n_clamped);
}

json_t *saga_encode_report(const saga_encode_session *s)
{
    const saga_train_report *const r = saga_train_report_of(s->train);
    const bool evened = s->result.evened.n_training +
                            s->result.evened.n_held_out >
                        0;
    json_t *const o = begin_report(s);

    saga_put(o, "options", saga_encode_options_json(s->o));
    put_capture(o, s);
    put_file(o, s);
    put_decoded(o, s);
    saga_put(o, "psnr_warm_up", quality_of(&r->warm));
    saga_put(o, "psnr_float", quality_of(&r->model));
    saga_put(o, "psnr_evened",
             evened ? quality_of(&s->result.evened) : json_null());
    saga_put(o, "psnr_decoded_float", quality_of(&r->coded));
    saga_put(o, "psnr_against_decoded_float", quality_of(&s->result.agreement));
    saga_put(o, "layers", layers_of(s));
    put_bits(o, &r->sizes);
    put_entropy(o, &r->entropy);
    return o;
}

/* --- As text ------------------------------------------------------------- */

/* A line with the PSNRs of training and held-out pictures, as far as there are
 * any. `what` must have 28 characters. */
#define QUALITY(when, what, path)             \
    { when, NULL, "  " what },                \
        { when "&" path ".n_training", NULL,  \
          "  {" path ".training:%6.2f} dB" }, \
        { when "&" path ".n_held_out", NULL,  \
          "  {" path ".held_out:%6.2f} dB" }, \
    {                                         \
        when, NULL, "\n"                      \
    }

/* The heading that whole files and parts share. */
#define DECODED                                                     \
    {                                                               \
        "", NULL,                                                   \
            "  mean PSNR of {psnr.n_training} + {psnr.n_held_out} " \
            "pictures  training  held out\n"                        \
    }

static const saga_line networks_text[] = {
    { "", NULL,
      "{file}: networks of {n_segments} segments, --only 0 to "
      "{/last_segment}, made by segment {first}\n  {seconds:%.0f} s\n" }
};

static const saga_line part_text[] = {
    { "", NULL,
      "{file}: {nbytes} bytes, segment {segment} (0 to "
      "{/last_segment}), frames {/begin}:{/end}\n" },
    DECODED,
    QUALITY("file", "file, integer decoder       ", "psnr"),
    SAGA_VERDICT_LINES,
    { "", NULL, "  {seconds:%.0f} s\n" }
};

/* What a reader needs who filmed: whether the film is small, good, and good
 * from where no camera stood, and what to do next. */
static const saga_line file_text[] = {
    { "", NULL, "{file}: {nbytes} bytes, " },
    { "n_frames>1", NULL,
      "{/film_seconds:%.1f} s of film at {/kb:%.1f} kB a "
      "second ({/kbits:%.1f} kbit/s), " },
    { "", NULL,
      "level {level}\n"
      "  {n_views} views, {n_frames} frame{n_frames+s}" },
    { "n_segments>1", NULL, " in {n_segments} segments of up to" },
    { "n_segments=1", NULL, ";" },
    { "", NULL, " {n_primitives} primitives\n  PSNR of the decoded file:" },
    { "psnr.n_training", NULL,
      " {psnr.training:%.2f} dB for the training "
      "views" },
    { "psnr.n_training&psnr.n_held_out", NULL, "," },
    { "psnr.n_held_out", NULL, " {psnr.held_out:%.2f} dB for held-out views" },
    { "", NULL, "\n" },
    { "/cut", "layers", "{/cut}" },
    { "/cut&psnr.n_training", "layers", ", {psnr.training:%.2f} dB" },
    { "/cut&psnr.n_held_out", "layers", ", held out {psnr.held_out:%.2f} dB" },
    { "/cut", "layers", "\n" },
    SAGA_VERDICT_LINES,
    { "psnr_between./told", NULL,
      "  predicted between the cameras, where nobody filmed: "
      "{psnr_between.expected:%.1f} dB, which is {psnr_between./gap:%.1f} dB\n"
      "  less than at them\n" },
    { "/between_good", NULL,
      "  from between the cameras the scene looks as "
      "good as from the cameras\n" },
    { "/between_soft", NULL,
      "  from between the cameras the scene looks a "
      "little softer than from the cameras;\n  more cameras, or cameras closer "
      "together, help\n" },
    { "/between_poor", NULL,
      "  from between the cameras the scene looks poor, "
      "with blur or ghosts: film with\n  more cameras, or cameras closer "
      "together, or stay close to the cameras' places\n" },
    { "/between_unknown&psnr_between./short", NULL,
      "  no camera was held out, and so short a training predicts nothing: it "
      "is unknown\n  how good the scene looks from between the cameras; "
      "--hold-out NAME tells\n" },
    { "/between_unknown&psnr_between./alone", NULL,
      "  no camera was held out, and none stands between others: it is unknown "
      "how good\n  the scene looks from between the cameras; add cameras\n" },
    { "", NULL, "  {seconds:%.0f} s; next: saga view {file}\n" },
    { "/between_poor", NULL,
      "  docs/troubleshooting.md has other causes of blur and ghosts\n" },
    { "/between_good&psnr_between.measured&!psnr_parts./bad", NULL,
      "  and when you are content, "
      "encode again with --hold-out \"\", since every camera helps\n" }
};

/* What a reader needs who judges the method. */
static const saga_line research_text[] = {
    { "", NULL,
      "\nanchors and tools:\n  {n_coarse} coarse anchors, {n_fine} "
      "fine" },
    { "n_segments>1", NULL, ", in the largest segment" },
    { "", NULL, "\n" },
    { "base.n_primitives", NULL,
      "  a base of {base./in_file} primitives, "
      "{base./still*100:%.0f} % of those of the warm-up stand still\n" },
    { "/chosen_scale>1", NULL,
      "  pictures reduced to 1/{/chosen_scale} of "
      "their size, by preset {options.preset}\n" },
    { "temporal", NULL, "  tools for motion on" },
    { "!temporal", NULL, "  no tools for motion" },
    { "/has_explained", NULL,
      ": {changing_pixels*100:%.2f} % of the pixels "
      "change, the warm-up explains {explained*100:%.0f} % of that" },
    { "", NULL, "\n" },
    { "", "tools",
      "  {@:%-22s} saves {worth:%7.0f} bytes, costs "
      "{cost:%6.0f}: " },
    { "kept", "tools", "kept\n" },
    { "!kept", "tools", "off\n" },
    { "refinement", NULL,
      "  poses and lenses refined: the error of matches "
      "that were kept from it fell from\n  {refinement.before_px:%.2f} to "
      "{refinement.after_px:%.2f} pixels\n" },
    { "/exposure", NULL,
      "  exposures of the cameras differ by up to "
      "{/exposure*100:%.0f} %; training evens this out\n" },
    { "/exposure&!options.no_exposure", NULL,
      "  the file stores the "
      "exposures, so that a camera's view is as bright as it was\n  filmed\n" },
    { "/exposure&options.no_exposure", NULL,
      "  the file's pictures may be "
      "brighter or darker than the filmed ones; in\n  `saga eval --json`, "
      "psnr_exposed is the PSNR without this difference\n" },
    { "", NULL,
      "  lambda {lambda:%.4g}{/why_lambda}\n"
      "  bytes: header {/sizes.header}, index {/sizes.index}, networks "
      "{/sizes.networks}, base {/sizes.base}, coarse {/sizes.coarse}, fine "
      "{/sizes.fine},\n  primitives {/sizes.prim}\n" },
    { "/raw_nbytes", NULL,
      "  networks at 16 bits a parameter: {/raw_nbytes} "
      "bytes\n" },
    { "", NULL, "  bits                  code length        spent\n" },
    { "", "/bits",
      "  {name:%-20s} {length:%12.0f} {spent:%12.0f}  "
      "{part*100:%5.1f} %\n" },
    { "", NULL,
      "  entropy model, bytes  constants   networks    no bank     "
      "chosen    weights  sources kept\n" },
    { "", "/kinds",
      "  {/name:%-20s} {constants:%10.0f} {networks:%10.0f} "
      "{without_bank:%10.0f} {chosen:%10.0f} {weights:%10.0f} {/sources}\n" },
    { "entropy_model.hyperprior_weights>0", NULL,
      "  hyperprior           {entropy_model.hyperprior_weights:%54.0f}\n" },
    { "entropy_model.bank_weights>0", NULL,
      "  bank                 {entropy_model.bank_weights:%54.0f}  minus "
      "what it saves: {entropy_model.bank_net:%+.0f}\n" },
    DECODED,
    { "psnr_evened", NULL,
      "  compared with the pictures with evened "
      "exposures\n" },
    QUALITY("file", "flat warm-up (float)        ", "psnr_warm_up"),
    QUALITY("file", "model (float)               ", "psnr_float"),
    QUALITY("file", "decoded symbols (float)     ", "psnr_decoded_float"),
    QUALITY("psnr_evened", "file, integer decoder       ", "psnr_evened"),
    QUALITY("psnr_evened", "  integer against float     ",
            "psnr_against_decoded_float"),
    { "psnr_evened", NULL,
      "  compared with the pictures as they were "
      "taken\n" },
    QUALITY("file", "file, integer decoder       ", "psnr"),
    { "/cut", "layers", "  {/cut:%-28s}" },
    { "/cut&psnr.n_training", "layers", "  {psnr.training:%6.2f} dB" },
    { "/cut&psnr.n_held_out", "layers", "  {psnr.held_out:%6.2f} dB" },
    { "/cut", "layers", "\n" },
    QUALITY("!psnr_evened", "  integer against float     ",
            "psnr_against_decoded_float")
};

int saga_encode_print_report(const saga_encode_session *s)
{
    const saga_encode_options *const o = s->o;
    const saga_print_style how = { o->json, 9, o->output };
    json_t *report;

    if (o->networks_only)
        return saga_cli_print_report(report_networks(s), &how,
                                     SAGA_LINES(networks_text));
    if (o->networks)
        return saga_cli_print_report(report_part(s), &how,
                                     SAGA_LINES(part_text));
    report = saga_encode_report(s);
    if (!o->verbose || o->json)
        return saga_cli_print_report(report, &how, SAGA_LINES(file_text));
    saga_print_lines(report, SAGA_LINES(file_text));
    return saga_cli_print_report(report, &how, SAGA_LINES(research_text));
}
