#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""run_planted.py [NAME... | places]: plants faults in the C decoder, each as another
decoder might have it, and tells which line of the frozen vectors catches it.

FAULTS has what each is about, its file of the decoder, and an edit. Faults are
tried on vectors/v1, then on vectors/v1-more, then on vectors/, whose lists have
what no later decoder must promise, such as VERSION. The test fails if nothing
catches a fault, unless SAME says why it gives the same decoder, and then if
something does. `places` only checks that the decoder still has the fragments of
text that the edits replace. Objects are in small-mutants/ of the build folder.
"""
import os
import sys

import run_small_mutants as small

FOLDERS = ("vectors/v1", "vectors/v1-more", "vectors")
PLAN, DRAW, SHAPE = "decoder/plan.c", "decoder/draw.c", "decoder/project.c"
PROBE, NAMES, RANGE = "decoder/probe.c", "decoder/names.c", \
    "decoder/range_dec.c"
MOVE, MAKE = "decoder/animate.c", "decoder/reconstruct.c"
MLP, CONTEXT, FINE = "common/mlp.c", "common/context.c", "common/fine.c"
NETS, SYMBOLS = "common/syntax_nets.c", "common/syntax_segment.c"
BYTES = "if (nbytes > saga_caps[h->level].work_nbytes)"
BOX = """\
    return pixel_range(&s->x0, &s->x1, s->mean_q8[0], ex, c->width) &
           pixel_range(&s->y0, &s->y1, s->mean_q8[1], ey, c->height);
"""
COVER = "(pixels < SAGA_COVER_PIXELS ? SAGA_COVER_PIXELS : pixels)"


def bytes_of(text):
    """Returns an edit of the check of work bytes, not of the memory itself."""
    return PLAN, BYTES, BYTES.replace("nbytes", text, 1)


def q15(path, text):
    """Returns an edit by which a Q format above 15 is read as 15."""
    return path, text, f"fx_min({text}, 15)"


def longer(axis, side):
    """Returns an edit by which boxes that are not empty are a pixel longer."""
    return SHAPE, BOX, BOX.replace("return", "const int is_seen =") + \
        f"    s->{axis}1 += s->{axis}1 < c->{side};\n    return is_seen;\n"


FAULTS = {
    "work without r(5)": (
        PLAN, "prim = run_macs(&c, SAGA_NET_FUSE_F) +", "prim ="),
    "work without r(7)": (PLAN, "run_macs(&c, SAGA_NET_GEO) +", "0 +"),
    "work without r(8)": (
        PLAN, "run_macs(&c, SAGA_NET_COLOUR_BASE) +", "0 +"),
    "work without r(10)": (
        PLAN, "prim += run_macs(&c, SAGA_NET_COLOUR)", "prim += 0"),
    "work has r(10) with VIEW, too": (
        PLAN, "if (!(m->tools & SAGA_TOOL_VIEW))\n        prim", "prim"),
    "work without r(16)": (PLAN, "run_macs(&c, SAGA_NET_RES);", "0;"),
    "work without the base": (
        PLAN, "saga_plan_base_macs(h, &p->nets, SAGA_RUN_WORK)", "0"),
    "work has a round for each anchor": (
        PLAN, "if (n <= groups)\n", "if (n)\n"),
    "work rounds its rounds up": (
        PLAN, "2 * (uint64_t)(n - groups) + 1",
        "2 * (uint64_t)(n - groups + m->bank_blocks - 1) + 1"),
    "work ignores PLAIN_WRITE": (
        PLAN, "(m->tools & SAGA_TOOL_PLAIN_WRITE) != 0", "0"),
    "work has the primitives for each layer": (
        PLAN, "{ h->max.coarse, h->max.fine, 0 }", "h->max"),
    "work has no writes of fine anchors": (
        PLAN, "if (saga_tier_writes(m, tier))", "if (tier == 0)"),
    "work has writes of fine anchors that write nothing": (
        PLAN, "if (saga_tier_writes(m, tier))", "if (1)"),
    "work without the start of the bank": (
        PLAN, "run_macs(c, SAGA_NET_SLOT) * m->bank_slots;", "0;"),
    "work bytes without their second maximum": bytes_of(
        "lay_anchors(&(saga_plan){ 0 }, h, p->bank_at)"),
    "work bytes without their first maximum": bytes_of(
        "lay_view(&(saga_plan){ 0 }, h->base.prim + h->max.prim, p->bank_at)"),
    "work bytes of base and layer together": bytes_of(
        "nbytes + 48 * (h->max.fine < h->base.fine ? h->max.fine"
        " : h->base.fine)"),
    "work bytes of one of both counts of primitives": bytes_of(
        "nbytes - 72 * h->base.prim"),
    "anchors of one layer": (
        PLAN, "saga_n_layers(h) * (h->max.coarse", "(h->max.coarse"),
    "width and int8 of the hash's network": (
        PLAN, "net < SAGA_N_NETS", "net < SAGA_NET_RES"),
    "a level above 3 before other errors": (
        PLAN, "if (!saga_model_is_valid(&h->model))",
        "if (h->level >= SAGA_N_PROFILES)\n        return SAGA_ERR_LEVEL;\n"
        "    if (!saga_model_is_valid(&h->model))"),
    "four layers at most": (
        PLAN, "h->more_layers >= SAGA_MAX_LAYERS", "h->more_layers >= 4"),
    "cover by 65,536 pixels": (DRAW, COVER, "SAGA_COVER_PIXELS"),
    "cover by the picture": (DRAW, COVER, "pixels"),
    "cover in 32 bits": (
        DRAW, "(uint64_t)saga_caps[dec->header.level].cover",
        "(uint32_t)saga_caps[dec->header.level].cover"),
    "finding with products of 32 bits": (
        PROBE, "frame_num < end * frame_den",
        "frame_num < (uint32_t)(end * frame_den)"),
    "t with products of 32 bits": (
        PROBE, "(uint64_t)e.n_frames * frame_den);",
        "(uint32_t)(e.n_frames * frame_den));"),
    "t rounded to the nearest": (
        PROBE, "    return (int32_t)t;",
        "    return (int32_t)(t + (rest * 2 >= whole && t < 65535));"),
    "the index's frames in 32 bits": (
        PROBE, "end = first + e.n_frames;",
        "end = (uint32_t)(first + e.n_frames);"),
    "names of 62 bytes": (
        NAMES, "shared + more > SAGA_MAX_NAME",
        "shared + more >= SAGA_MAX_NAME"),
    "names without controls of C1": (
        NAMES, "c == 0x7f)",
        "c == 0x7f || (i && p[at + i - 1] == 0xc2 && c < 0xa0))"),
    "names without U+FFFE": (
        NAMES, "code < 0x800 ||", "code < 0x800 || code == 0xfffe ||"),
    "names that share those of camera 0": (
        NAMES, "        if (i == index)\n            *naming = last;",
        "        if (i == index)\n            *naming = last;\n"
        "        if (i == 1)\n            last.name[0] = 'c';"),
    "gains of camera 0": ("decoder/exposures.c", "if (i == index)",
                          "if (i == 0)"),
    "a row without half a unit": (MLP, " - (1 << shift >> 1);", ";"),
    "a row with a whole unit": (MLP, "(1 << shift >> 1);", "(1 << shift);"),
    "code >= range after a plain bit": (
        RANGE, "        if (d->code >= d->range)\n"
        "            d->coder.error = 1;\n        v = ", "        v = "),
    "weights without finer of their inputs": (
        NETS, "f->step_shift + finer", "f->step_shift"),
    "q_sigma above 15": q15(CONTEXT, "sc->model->out_q[SAGA_OUT_SIGMA]"),
    "q_hyper above 15": q15(CONTEXT, "m->out_q[SAGA_OUT_HYPER]"),
    "q_coarse above 15": (CONTEXT, "m->out_q[SAGA_OUT_COARSE] : 14",
                          "fx_min(m->out_q[SAGA_OUT_COARSE], 15) : 14"),
    "q_fine above 15": (CONTEXT, "return sc->model->out_q[SAGA_OUT_FINE]",
                        "return fx_min(sc->model->out_q[SAGA_OUT_FINE], 15)"),
    "q_support above 15": q15(FINE, "sc->model->out_q[SAGA_OUT_SUPPORT]"),
    "q_opacity above 15": q15(MOVE, "f->q_opacity"),
    "q_motion above 15": q15(MOVE, "f->q_motion[order - 1]"),
    "q_slope above 15": q15(MOVE, "f->q_slope"),
    "q_scale above 15": (
        MAKE, "first + i], q[SAGA_OUT_SCALE]",
        "first + i], fx_min(q[SAGA_OUT_SCALE], 15)"),
    "q_time above 15": (MAKE, "q[SAGA_OUT_TIME]);",
                        "fx_min(q[SAGA_OUT_TIME], 15));"),
    "q_width above 15": (MAKE, "q[SAGA_OUT_WIDTH],",
                         "fx_min(q[SAGA_OUT_WIDTH], 15),"),
    "q_colour above 15": q15(MAKE, "sc->model->out_q[SAGA_OUT_COLOUR]"),
    "principal points below 0": (
        SHAPE, "principal = c->principal_q16[axis];",
        "principal = c->principal_q16[axis] < 0 ? 0"
        " : c->principal_q16[axis];"),
    "centres to 2^28": (SHAPE, "#define LIMIT_CENTRE (1 << 29)",
                        "#define LIMIT_CENTRE (1 << 28)"),
    "principal points to 2^29": (
        SHAPE, "#define LIMIT_PRINCIPAL (1 << 30)",
        "#define LIMIT_PRINCIPAL (1 << 29)"),
    "far means in y": (SHAPE, "if (abs64(mean - side * 128) > LIMIT_MEAN)",
                       "if (axis == 0 && abs64(mean - side * 128) > "
                       "LIMIT_MEAN)"),
    "boxes a pixel longer in x": longer("x", "width"),
    "boxes a pixel longer in y": longer("y", "height"),
    "boxes that begin a pixel early": (
        SHAPE, "extent_q8 + 127) >> 8;", "extent_q8 - 129) >> 8;"),
    "boxes by 1/h rounded less": (
        SHAPE, "saga_recip16((uint32_t)h, &n) + 2)",
        "saga_recip16((uint32_t)h, &n) + 1)"),
    "boxes of 320 pixels": (SHAPE, "fx_clamp(hi, 0, side)",
                            "fx_clamp(hi, 0, side < 320 ? side : 320)"),
    "the hash's grid rounds down": (
        "common/residual_hash.c", "fx_rshift(offset_q14[i], 15 - (int)level)",
        "(offset_q14[i] >> (15 - (int)level))"),
    "the hash with ranks that begin anew": (
        MAKE, "r->fine[i], offset)", "r->fine[i] - r->fine[0], offset)"),
    "work bytes without the models of classes": bytes_of(
        "nbytes - (h->model.tools & SAGA_TOOL_CLASSES ? 1088 : 0)"),
    "classes by the last one alone": (
        SYMBOLS, "of[before[0]][before[1]]", "of[before[0]][0]"),
    "classes with those of a cell as long as the segment": (
        SYMBOLS, "[a->depth_t > 0],", "[0],"),
    "classes by four symbols": (
        SYMBOLS, "                                   sc->model->n_classes);",
        "                                   4);"),
    "one above 32767": (
        SYMBOLS, "fx_sat16(1 << m->out_q[SAGA_OUT_COARSE])",
        "(int16_t)(1 << fx_min(m->out_q[SAGA_OUT_COARSE], 14))"),
    "predictions of the first features for those of a class": (
        SYMBOLS, "at, mu + has.first, scale + has.first,", "at, mu, scale,"),
    "the last class of a layer before that of the next": (
        SYMBOLS, "uint32_t before[2] = { 0, 0 }, rank;",
        "static uint32_t before[2];\n    uint32_t rank;"),
    "fine anchors write what nobody reads": (
        CONTEXT, "if (!saga_tier_writes(sc->model, tier))",
        "if (!sc->bank.n_slots)"),
    "time 0 in a base": (MAKE, "t_centre = SAGA_T_MID;", "t_centre = 0;"),
    "depths of 23 bits": ("decoder/raster.c", "(s->depth >> 22)",
                          "(s->depth >> 22 & 1)"),
}

# Faults that give the same decoder, with the reason.
SAME = {
    "code >= range after a plain bit":
        "only the range before a step can be odd, since that after an escape "
        "is a multiple of 16. A code that equals the range stays equal, so "
        "that all further symbols are the last ones, and the next row shift "
        "is 31",
    "fine anchors write what nobody reads":
        "the bank is written after its last read by a coarse anchor, and the "
        "next layer starts with a new one",
    "time 0 in a base":
        "slope and motion of the base are 0, and its width is so large that "
        "the fade of any dt below 2^17 rounds to 0",
}


def planted(builder, name):
    """Plants a fault. Returns the folder and the line that catch it, or
    None."""
    path, old, new = FAULTS[name]
    text = small.read(path)
    for k, folder in enumerate(FOLDERS):
        builder.folder = folder
        result, said = builder.try_source(path, text.replace(old, new)) \
            if k == 0 else builder.run(builder.program)
        if result == small.BROKEN:
            raise SystemExit(f"FAIL planted {name}: it does not compile")
        if result == small.NOTICED:
            return folder, said.splitlines()[0]
    return None


def main():
    os.chdir(small.ROOT)
    lost = [f"{path} has not once: {old}" for path, old, _ in FAULTS.values()
            if small.read(path).count(old) != 1]
    for place in lost:
        print(f"FAIL planted: {place}")
    if lost or sys.argv[1:] == ["places"]:
        print(f"ok   planted: places of {len(FAULTS) - len(lost)} faults")
        return len(lost) != 0
    builder = small.Builder(FOLDERS[0], [["plain"]])
    failed, by = 0, dict.fromkeys(FOLDERS, 0)
    for name in sys.argv[1:] or FAULTS:
        caught = planted(builder, name)
        if caught:
            by[caught[0]] += 1
        wrong = (caught is None) != (name in SAME)
        failed += wrong
        what = ": ".join(caught) if caught else \
            f"the same decoder: {SAME[name]}" if name in SAME else "not caught"
        print(f"{'FAIL' if wrong else '    '} {name}: {what}", flush=True)
    print(f"{'FAIL' if failed else 'ok  '} planted faults: " +
          ", ".join(f"{n} caught by {folder}" for folder, n in by.items()) +
          f", {len(SAME)} give the same decoder")
    return failed != 0


if __name__ == "__main__":
    sys.exit(main())
