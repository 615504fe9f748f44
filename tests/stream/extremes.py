# SPDX-License-Identifier: MIT
"""The extremes of docs/arithmetic.md and docs/bitstream.md that good vectors
must reach, for check_coverage.py: where the decoder's plain C shows that one is
reached, and how.

PLACES has a file, a fragment of its text that occurs there once, and the
extremes that show after the fragment: the page, what happens, and a condition
in C. If the fragment begins with +, it is a statement that may be the body of a
loop without braces; conditions look at its variables each time it has run.
"""
A, B = "arithmetic", "bitstream"
FORMATS = ("coarse", "hyper", "sigma", "fuse_c", "fuse_f", "fine", "support",
           "opacity", "scale", "slope", "time", "width", "motion1", "motion2",
           "motion3", "colour")

PLACES = [
    # --- Elementary functions ------------------------------------------------
    ("common/fx_math.c", "    uint32_t v_q30;\n", [
        (A, "exp2_neg: x is 16 or more", "x_q20 >= 16u << 20"),
        (A, "exp2_neg: x is 0, so that k is 16", "x_q20 == 0"),
    ]),
    ("common/fx_math.c",
     "static int32_t softplus2_tail_q20(int32_t a_q12)\n{\n", [
         (A, "softplus2: |x| is 22 or more, h is 0", "a_q12 >= 22 << 12"),
     ]),
    ("common/fx_math.c",
     "int32_t saga_softplus2_q12_q20(int32_t x_q12)\n{\n", [
         (A, "softplus2: x is clamped to -2^20", "x_q12 < -(1 << 20)"),
         (A, "softplus2: x is clamped to 2^20", "x_q12 > 1 << 20"),
     ]),
    ("common/fx_math.c",
     "int32_t saga_sigmoid_q11_q15(int16_t x_q11)\n{\n", [
         (A, "sigmoid: x is -12 or less, 0", "x_q11 <= -(12 << 11)"),
         (A, "sigmoid: x is 12 or more, 32768", "x_q11 >= 12 << 11"),
     ]),
    ("common/sine.h", "INLINE int32_t sin_quarter_q15(uint32_t z)\n{\n", [
        (A, "sin: a quarter turn, 32767", "z == 16384"),
    ]),
    ("common/fx_math.c", "    const uint32_t one = y_q31 >> 31;\n", [
        (A, "rsqrt: y is 2^31", "one"),
        (A, "rsqrt: the exponent is odd", "odd"),
    ]),

    # --- Networks ------------------------------------------------------------
    ("common/nets.c",
     "    const int32_t half = 1 << by >> 1;\n    uint32_t i;\n", [
         (A, "requant16 to a finer format, by 15 bits or more", "left > 14"),
         (A, "requant16 to a coarser format", "left < 0"),
     ]),
    ("common/nets.c", "+            to[i] = fx_sat16(x[i] * (1 << by));", [
        (A, "requant16 saturates", "x[i] * (1 << by) != to[i]"),
    ]),
    ("common/mlp.c", "+        y[row + i] = fx_sat16(v & (keep | ~(v >> 31)));",
     [
         (A, "a network without inputs", "layer->n_in == 0"),
         (A, "an output is above 32767", "v > 32767 && keep"),
         (A, "an output is below -32767", "v < -32767 && keep"),
         (A, "a hidden unit is above 32767", "v > 32767 && !keep"),
         (A, "a hidden unit is negative", "v < 0 && !keep"),
         (A, "a row shift is 0", "shift[i] == 0"),
     ]),
    ("common/syntax_nets.c", "    to->bias[at.row] = (int32_t)bias;\n", [
        (B, "a row shift is 24", "shift == 24"),
        (B, "the sum over a row may exceed 2^30",
         "32767 * sum + (bias < 0 ? -bias : bias) > 1 << 30"),
        (B, "the sum over a row may come within 32767 of 2^31",
         "32767 * sum + (bias < 0 ? -bias : bias) + (1 << shift >> 1) > "
         "INT32_MAX - 32767"),
    ]),
    ("common/syntax_nets.c", "+            sum += w < 0 ? -w : w;", [
        (B, "a weight is 32767 or -32767", "w == 32767 || w == -32767"),
        (B, "a weight of an int8 network is 127 or -127",
         "to->int8 && (w == 127 || w == -127)"),
        (B, "step_shift + finer exceeds 31", "f->step_shift + finer > 31"),
        (B, "finer of an input is 3", "finer == 3"),
    ]),
    ("common/syntax_nets.c", "    code_fields(&f, m, c, net, i);\n", [
        (B, "scale_mode is 0", "f.scale_mode == 0"),
        (B, "scale_mode is 1", "f.scale_mode == 1"),
        (B, "scale_mode is 2", "f.scale_mode == 2"),
    ]),

    # --- Symbols -------------------------------------------------------------
    ("decoder/range_dec.c", "    d->n = n;\n", [
        (B, "a payload is one byte", "n == 1"),
    ]),
    ("decoder/range_dec.c", "    sign = bypass(d, 1);\n", [
        (B, "an escape has all 13 leading ones, k is 16", "bits == 16"),
        (B, "an escape is 65535", "v == SAGA_MAX_RESIDUAL && !sign"),
        (B, "an escape is -65535", "v == SAGA_MAX_RESIDUAL && sign"),
    ]),
    ("common/prob.h", "    const int32_t i = fx_rshift((int32_t)log2_sigma * "
     "SAGA_SCALE_PER_OCTAVE, q);\n", [
         (A, "scale index: clamped to 0", "i + SAGA_SCALE_UNIT < 0"),
         (A, "scale index: clamped to 63", "i + SAGA_SCALE_UNIT > 63"),
     ]),
    ("common/prob.c", "    if (m->seen < 255)\n        m->seen++;\n", [
        (B, "inertia is 6", "m->seen > 72"),
        (B, "seen stays 255", "m->seen == 255"),
    ]),
    ("common/syntax_segment.c", "    const uint32_t first = at.index;\n"
     "    uint32_t depth = 0, i;\n", [
         (B, "a set of 16 points", "n == 16"),
         (B, "a set of 8 bits", "n && bits == 8"),
         (B, "a set of 0 bits", "n && bits == 0"),
     ]),
    ("common/syntax_segment.c", "+        n += (i >> k) & (mask >> (i ^ 1u << k)) "
     "& 1u;", [(B, "a child touches four that exist", "n == 4")]),
    ("common/syntax_segment.c", "    a->depth_t = nd->depth_t;\n", [
        (B, "the tree is one leaf", "nd->depth_x == 0 && nd->depth_t == 0"),
        (B, "a leaf of depth 16 in space", "nd->depth_x == 16"),
        (B, "a leaf of depth 8 in time", "nd->depth_t == 8"),
        (B, "a leaf of depth 16 in space and 8 in time",
         "nd->depth_x == 16 && nd->depth_t == 8"),
    ]),
    ("common/syntax_segment.c", "sc->model->tier[SAGA_TIER_COARSE]"
     ".n_groups;\n    uint32_t group, rank, i;\n", [
         (B, "n_groups of coarse anchors is 1", "n_groups == 1"),
         (B, "n_groups of coarse anchors is 15", "n_groups == 15"),
         (B, "n_groups of coarse anchors is 16", "n_groups == 16"),
         (B, "a layer without fine anchors", "sc->n.fine == 0"),
         (B, "a layer with fine anchors and without primitives",
          "sc->n.fine && sc->n.prim == 0"),
     ]),
    ("common/syntax_segment.c", "a->depth_t > 0],\n"
     "            sc->model->n_classes);\n", [
        *((B, f"the last of {n} classes",
           f"sc->model->n_classes == {n} && a->class == {n - 1}")
          for n in (2, 3, 4)),
        (B, "a class in a cell shorter than the segment", "a->depth_t > 0"),
        (B, "a third class in a row that differs from the two before",
         "rank > 1 && before[0] != before[1] && a->class != before[0] && "
         "a->class != before[1]"),
    ]),
    ("common/syntax_segment.c", "    at.column = has.first;\n", [
        (B, "a class of no feature", "sc->class_models && !has.n"),
        (B, "a class of all features", "sc->class_models && "
         "has.n == m->features"),
        (B, "a class without a feature that is 1", "sc->class_models && "
         "has.n < m->features && has.one == m->features"),
        (B, "the feature that is 1 stands before the coded ones",
         "has.one < has.first"),
        (B, "the feature that is 1 stands behind the coded ones",
         "has.n && has.one >= has.first + has.n && has.one < m->features"),
        (A, "the feature that is 1 is 32767",
         "has.one < m->features && m->out_q[SAGA_OUT_COARSE] >= 15"),
    ]),
    ("common/syntax_segment.c", "sc->model->tier[SAGA_TIER_FINE]"
     ".n_groups;\n    uint32_t group, rank, i;\n", [
         (B, "n_groups of fine anchors is 15", "n_groups == 15"),
     ]),
    ("common/syntax_segment.c",
     "static int16_t dequantise(int16_t mu, int32_t q, uint32_t step_q16)\n"
     "{\n", [
         (A, "a dequantised value is above 32767",
          "mu + fx_rshift64((int64_t)q * step_q16, 16) > 32767"),
         (A, "a dequantised value is below -32767",
          "mu + fx_rshift64((int64_t)q * step_q16, 16) < -32767"),
         (A, "a step is 2^32 - 1", "step_q16 == 0xffffffff"),
     ]),
    ("common/syntax_segment.c",
     "+        a->local[i] = fx_sat16(a->local[i] + residual[i]);", [
         (A, "the offset of a fine anchor is at its bound",
          "a->local[i] == 32767 || a->local[i] == -32767"),
     ]),
    ("common/syntax_segment.c",
     "+            o[axis] = fx_sat16(o[axis] + residual[axis]);", [
         (A, "the offset of a primitive is at its bound",
          "o[axis] == 32767 || o[axis] == -32767"),
     ]),

    # --- Scaffold ------------------------------------------------------------
    ("common/scaffold.c", "+        p->x[i] = fx_clamp64(\n"
     "            p->x[i] + fx_rshift64((int64_t)p->support[i] * "
     "offset_q14[i], 14),\n"
     "            SAGA_X_MIN, SAGA_X_MAX);", [
         (A, "a position is at its bound, -2^23", "p->x[i] == SAGA_X_MIN"),
         (A, "a position is at its bound, 2^23 - 1", "p->x[i] == SAGA_X_MAX"),
     ]),
    ("common/scaffold.c", "p->support[3] * offset_q14[3], 14), 0,\n"
     "        SAGA_T_MAX);\n", [
         (A, "a time is at its bound, 0", "p->t == 0"),
         (A, "a time is at its bound, 65535", "p->t == SAGA_T_MAX"),
     ]),
    ("common/interp.c", "        r->mant = saga_recip16(sum, &r->shift);\n"
     "    }\n", [
         (A, "u of an axis is clamped to 32767", "fx_rshift64((int64_t)diff * "
          "(int64_t)r->mant, r->shift - 12) > 32767"),
     ]),
    ("common/interp.c", "+        sum += fx_rshift64(square_q24(s, rank, 3) * "
     "m->lambda_t_q8, 8);", [
         (A, "d is clamped to 65535",
          "limit == 65535 && fx_rshift64(sum, 12) > 65535"),
     ]),
    ("common/interp.c", "    int64_t sum = 0;\n    int i;\n", [
        (A, "a distance without time, in a model that is not dynamic",
         "!saga_is_dynamic(m)"),
    ]),
    ("common/interp.c", "    nb->n = 0;\n", [
        (A, "K is 1: all", "l->neighbours == 1 && before == SAGA_ALL_GROUPS"),
        (A, "K is 1: before g",
         "l->neighbours == 1 && before != SAGA_ALL_GROUPS"),
        (A, "radius2_q12 is 0", "l->radius2_q12 == 0"),
        (A, "window is 0", "l->window == 0"),
        (A, "window is 32", "l->window == 32"),
        (A, "a window is cut at both ends of the ranks",
         "centre < l->window && centre + l->window >= (tier == "
         "SAGA_TIER_COARSE ? sc->n.coarse : sc->n.fine)"),
    ]),
    ("common/interp.c", "    take_nearest(nb, &s, centre, before);\n", [
        (A, "before g: no member", "before != SAGA_ALL_GROUPS && !nb->n"),
        (A, "K is 16, and there are 16 members", "nb->n == 16"),
        (A, "all: the parent is added to the members",
         "before == SAGA_ALL_GROUPS && !is_member(nb, centre) && "
         "nb->n < l->neighbours"),
        (A, "all: the parent takes the place of the last of K",
         "before == SAGA_ALL_GROUPS && !is_member(nb, centre) && "
         "nb->n == l->neighbours && nb->n > 1"),
        (A, "two members have the same d",
         "nb->n > 1 && nb->d_q12[0] == nb->d_q12[1]"),
    ]),
    ("common/interp.c", "    if (nb->n == 1) {\n        nb->weight_q14[0] = "
     "1 << 14;\n", [(A, "a single member", "1")]),
    ("common/interp.c", "+        sum += e_q15[i];", [
        (A, "a member has weight 0", "e_q15[i] == 0"),
    ]),
    ("common/interp.c", "+        out[i] = fx_sat16(fx_rshift(sum[i], 14));", [
        (A, "an interpolated feature saturates",
         "fx_rshift(sum[i], 14) != out[i]"),
    ]),
    ("common/fine.c", "            half * 1024 + fx_requant32(out[i], q, 10), "
     "0, max * 1024);\n", [
         (A, "log2 l_f is clamped to 0",
          "half * 1024 + fx_requant32(out[i], q, 10) < 0"),
         (A, "log2 l_f is clamped to 23, in space",
          "i < 3 && half * 1024 + fx_requant32(out[i], q, 10) > max * 1024"),
         (A, "log2 l_f is clamped to 16, in time",
          "i == 3 && half * 1024 + fx_requant32(out[i], q, 10) > max * 1024"),
     ]),

    # --- Memory bank ---------------------------------------------------------
    ("common/memory_bank.c", "    const uint32_t feedback = "
     "generator(m->n_slots);\n", [
         (A, f"bank: {n} slots", f"m->n_slots == {n}")
         for n in (32, 64, 128, 256, 512)]),
    ("common/memory_bank.c", "    r = saga_recip32(sum, &shift);\n", [
        (A, "bank: all scores are equal", "sum == m->n_slots << 15"),
    ]),
    ("common/memory_bank.c", "+        sum += (uint32_t)score[p];", [
        (A, "bank: a slot has weight 0", "score[p] == 0"),
    ]),
    ("common/memory_bank.c", "    count_macs(MACS_NORM * width);\n", [
        (A, "bank: N is 0, the slot stays", "square == 0"),
    ]),
    ("common/memory_bank.c", "    const int32_t along = plain ? 0 : "
     "component_along(slot, write, m->width);\n"
     "    int32_t u[SAGA_MAX_SLOT_WIDTH];\n    uint32_t d;\n", [
         (A, "bank: g is 0", "gate_q15 == 0"),
         (A, "bank: g is 32768", "gate_q15 == 32768"),
         (A, "bank: v is 0", "saga_all_zero(write, m->width)"),
         (A, "bank: v is parallel to s, with the projection",
          "!plain && !saga_all_zero(write, m->width) && "
          "saga_are_parallel(slot, write, m->width)"),
     ]),
    ("common/memory_bank.c", "        const int32_t v = fx_sat16(write[d] - "
     "fx_rshift(along * slot[d], 12));\n", [
         (A, "bank: v less its part along s saturates",
          "write[d] - fx_rshift(along * slot[d], 12) != v"),
     ]),
    ("common/context.c",
     "+        in[i] = fx_sat16(fx_max(sc->net.v->kept[i] + own[i], 0));", [
         (A, "bank: the pre-activation of the write saturates",
          "sc->net.v->kept[i] + own[i] > 32767"),
     ]),
    ("common/context.c",
     "void saga_context_end_group(const saga_scaffold *sc)\n{\n", [
         (B, "bank: a group ends with an open round",
          "sc->bank.n_slots && sc->bank.round->n"),
         (B, "bank: a group ends without one",
          "sc->bank.n_slots && !sc->bank.round->n"),
     ]),
    ("common/context.c", "    round->n += run->n;\n", [
        (B, "bank: a round is full", "round->n == sc->model->bank_blocks"),
    ]),

    # --- Primitives ----------------------------------------------------------
    ("decoder/reconstruct.c", "    uint32_t fine = 0;\n    run r;\n", [
        (B, "features is 63", "sc->model->features == 63"),
        (B, "features is 64", "sc->model->features == 64"),
        (B, "octaves is 1", "sc->model->octaves == 1"),
        (B, "octaves is 8", "sc->model->octaves == 8"),
        *((B, f"q_{name} is above 15",
           f"sc->model->out_q[SAGA_OUT_{name.upper()}] > 15")
          for name in FORMATS),
    ]),
    ("decoder/reconstruct.c", "    p->quat[0] = fx_sat16(p->quat[0] + "
     "(1 << q[SAGA_OUT_QUAT]));\n", [
         (A, "quat's first component is clamped", "p->quat[0] == 32767"),
         (A, "quat is 0", "!p->quat[0] && !p->quat[1] && !p->quat[2] && "
          "!p->quat[3]"),
     ]),
    ("decoder/reconstruct.c", "    uint16_t colour_q15[3];\n    uint32_t i, k;\n", [
        (A, "F_geo and F_color read one format",
         "sc->model->q_in[SAGA_NET_COLOUR_BASE] == "
         "sc->model->q_in[SAGA_NET_GEO]"),
        (A, "F_geo and F_color read different formats",
         "sc->model->q_in[SAGA_NET_COLOUR_BASE] != "
         "sc->model->q_in[SAGA_NET_GEO]"),
    ]),
    ("decoder/reconstruct.c", "static int32_t centre_time(int32_t t, int32_t "
     "support_t, int16_t out, int q)\n{\n", [
         (A, "t_centre is clamped to -32768",
          "t + fx_rshift64((int64_t)support_t * out, q) < -32768"),
         (A, "t_centre is clamped to 98303",
          "t + fx_rshift64((int64_t)support_t * out, q) > 98303"),
     ]),
    ("decoder/reconstruct.c", "static int16_t log2_size_q10(int16_t out, int q, "
     "int log2_half)\n{\n", [
         (A, "log2_scale is clamped to 32767", "log2_half > 15 && "
          "fx_requant32(out, q, 10) + log2_half * 1024 > 32767"),
         (A, "log2_scale is clamped to -32767", "log2_half > 15 && "
          "fx_requant32(out, q, 10) + log2_half * 1024 < -32767"),
     ]),
    ("decoder/reconstruct.c", "    p->log2_width_q10 = 0;\n", [
        (A, "log2_width is clamped to 32767", "rows[SAGA_OUT_WIDTH].n && "
         "fx_requant32(out[rows[SAGA_OUT_WIDTH].first], q[SAGA_OUT_WIDTH], 10)"
         " + (SAGA_LOG2_HALF_T - cell->depth_t) * 1024 > 32767"),
        (A, "log2_width is clamped to -32767", "rows[SAGA_OUT_WIDTH].n && "
         "fx_requant32(out[rows[SAGA_OUT_WIDTH].first], q[SAGA_OUT_WIDTH], 10)"
         " + (SAGA_LOG2_HALF_T - cell->depth_t) * 1024 < -32767"),
    ]),
    ("decoder/reconstruct.c",
     "            const int32_t sum = out[k] + r->correction[i][first + k];\n", [
         (A, "an output plus its correction is above 32767", "sum > 32767"),
         (A, "an output plus its correction is below -32767", "sum < -32767"),
         (A, "the colour is corrected without VIEW",
          "first && !(sc->model->tools & SAGA_TOOL_VIEW)"),
     ]),
    ("common/residual_hash.c", "    uint32_t hash = rank;\n    int i;\n", [
        (A, "table 7 of the residual hash is read", "level == 7"),
        (A, "tables of the residual hash have 512 entries",
         "m->hash_log2_entries == 9"),
        (A, "a rank exceeds the entries of a table",
         "rank >> m->hash_log2_entries"),
    ]),
    ("decoder/reconstruct.c",
     "static uint16_t colour_of(int16_t out, int q)\n{\n", [
         (A, "a colour is clamped to 0",
          "16384 + fx_requant32(out, q, 15) < 0"),
         (A, "a colour is clamped to 32768",
          "16384 + fx_requant32(out, q, 15) > 32768"),
     ]),
    ("decoder/reconstruct.c", "    for (i = 0; i < 3; i++)\n        d[i] = 0;\n",
     [(A, "the camera's centre is on the primitive", "sum == 0")]),
    ("decoder/reconstruct.c", "+        sum[i] = fx_sat16(a[i] + b[i]);", [
        (A, "the pre-activation of F_color saturates", "a[i] + b[i] != sum[i]"),
    ]),

    # --- Animation -----------------------------------------------------------
    ("decoder/animate.c", "    const int64_t product = (int64_t)(dt < 0 ? -dt : "
     "dt) * m;\n", [
         (A, "widths: n is below 11, dt is not 0", "n < 11 && product"),
         (A, "widths: n is below 11, dt is 0", "n < 11 && !product"),
         (A, "widths: clamped to 2^20",
          "n >= 11 && fx_rshift64(product, n) > LIMIT_U"),
     ]),
    ("decoder/animate.c", "    moment m = { 0, 0 };\n", [
        (A, "a width is longer than half a segment",
         "f->has_width && p->log2_width_q10 > HALF_SEGMENT"),
        (A, "dt is negative", "dt < 0"),
        (A, "age is clamped to 2^18", "f->has_width && p->log2_width_q10 < "
         "HALF_SEGMENT && width_ratio_q16(dt, p->log2_width_q10) > "
         "LIMIT_AGE"),
    ]),
    ("decoder/animate.c", "        x[i] = fx_clamp64(p->x[i] + "
     "fx_rshift64(motion * p->support[i], 20),\n"
     "                          -LIMIT_X, LIMIT_X);\n", [
         (A, "motion is clamped to -2^39", "sum[i] < -LIMIT_MOTION"),
         (A, "motion is clamped to 2^39", "sum[i] > LIMIT_MOTION"),
         (A, "an animated position is clamped to -2^29", "x[i] == -LIMIT_X"),
         (A, "an animated position is clamped to 2^29", "x[i] == LIMIT_X"),
     ]),
    ("decoder/animate.c", "    n = quat_shift(v);\n", [
        (A, "the quaternion at a time needs a shift, d > 0", "n > 0"),
        (A, "the quaternion at a time is 0", "!v[0] && !v[1] && !v[2] && "
         "!v[3]"),
    ]),

    # --- Projection ----------------------------------------------------------
    ("decoder/draw.c", "    dec->camera = *camera;\n", [
        (A, "t is 0", "t == 0"),
        (A, "t is 65535", "t == 65535"),
        (A, "t is odd", "t & 1 && t != 65535"),
        (A, "a picture of one pixel",
         "camera->width == 1 && camera->height == 1"),
        (B, "a picture of more than 65,536 pixels",
         "camera->width * camera->height > 65536"),
        (B, "a picture with a side above 320",
         "camera->width > 320 || camera->height > 320"),
        (B, "a principal point is below 0", "camera->principal_q16[0] < 0 || "
         "camera->principal_q16[1] < 0"),
        (B, "a principal point is -2^30 or 2^30",
         "__builtin_abs(camera->principal_q16[0]) == 1 << 30 || "
         "__builtin_abs(camera->principal_q16[1]) == 1 << 30"),
        (B, "a camera's centre is at -2^29 or 2^29",
         " || ".join(f"__builtin_abs(camera->centre[{k}]) == 1 << 29"
                     for k in range(3))),
        (B, "a segment has four layers or more",
         "dec->header.more_layers >= 3"),
        (B, "fps_num / fps_den is no integer",
         "dec->header.fps_num % dec->header.fps_den"),
    ]),
    ("decoder/draw.c", "        keys, (saga_key *)(void *)block_at(dec, "
     "dec->plan.keys_tmp_at), n);\n", [
         (A, "no primitive is left", "n == 0"),
         (A, "two splats have the same depth",
          "n > 1 && keys[0].depth == keys[1].depth"),
     ]),
    ("decoder/draw.c", "    dec->box_pixels = saga_raster_boxes(keys, "
     "splats, n, camera);\n", [
         (B, "cover is at its limit", "dec->box_pixels == "
          "(uint64_t)saga_caps[dec->header.level].cover * "
          "(camera->width * camera->height < 65536 ? 65536u : "
          "(uint32_t)camera->width * camera->height)"),
         (B, "cover exceeds the limit of a picture's own pixels, below 65,536",
          "camera->width * camera->height < 65536 && dec->box_pixels > "
          "(uint64_t)saga_caps[dec->header.level].cover * camera->width * "
          "camera->height"),
     ]),
    ("decoder/project.c",
     "    const int32_t depth = (int32_t)fx_rshift64(vz, 30);\n", [
         (A, "drop: depth is below the near plane", "depth < c->near_plane"),
         (A, "drop: |x/z| is 8 or more",
          "depth >= c->near_plane && abs64(vx) >> 3 >= vz"),
         (A, "drop: |y/z| is 8 or more", "depth >= c->near_plane && "
          "abs64(vx) >> 3 < vz && abs64(vy) >> 3 >= vz"),
     ]),
    ("decoder/project.c", "    const int64_t slope = fx_rshift64(focal_q44, "
     "28);\n", [
         *((A, f"drop: a mean is too far in {name}",
            f"axis == {axis} && abs64(mean - side * 128) > LIMIT_MEAN")
           for axis, name in enumerate("xy")),
         (A, "x/z or y/z is clamped to 2^31 - 1",
          "fx_rshift64((int64_t)x * o->recip, n) > INT32_MAX"),
         (A, "x/z or y/z is clamped to -(2^31 - 1)",
          "fx_rshift64((int64_t)x * o->recip, n) < -INT32_MAX"),
         (A, "a slope is clamped to its lower bound", "slope < lo"),
         (A, "a slope is clamped to its upper bound", "slope > hi"),
     ]),
    ("decoder/project.c", "    n = 30 - n_bits(bits);\n", [
        (A, "a quaternion has u > 30", "n < 0"),
        (A, "a quaternion has u = 0", "bits == 0"),
    ]),
    ("decoder/project.c", "    n = n_bits(bits) - 30;\n", [
        (A, "J: j is below 0", "n < 0"),
    ]),
    ("decoder/project.c",
     "        const int32_t n = 1 + top - (log2_scale[k] >> 10);\n", [
         (A, "a column is 0, as d_k exceeds 61", "n > 61"),
     ]),
    ("decoder/project.c", "    n = fx_max(n_bits(bits) - 30, 0);\n", [
        (A, "the vector product is 0: rows are parallel", "bits == 0"),
        (A, "the vector product needs no shift", "bits && n == 0"),
    ]),
    ("decoder/project.c", "    chol_q28[2] = pair_q28(h);\n", [
        (A, "all of row_0 and row_1 is 0", "a0 == 0 && c0 == 0"),
        (A, "ab is 0, and row_0 and row_1 are not", "b == 0 && a0 && c0"),
        (A, "ab is negative", "b < 0"),
        (A, "g, n or h rounds to 0",
         "!chol_q28[0] || (b && !chol_q28[1]) || !chol_q28[2]"),
        (A, "h is 0", "!chol_q28[2]"),
        (A, "g is 0", "!chol_q28[0]"),
    ]),
    ("decoder/project.c", "    f.exp = exp + 62 - n;\n", [
        (A, "pair: rounding gives 2^31", "f.mant_q30 >> 31"),
    ]),
    ("decoder/project.c", "    const int32_t n = hi.exp - lo.exp;\n", [
        (A, "add: d exceeds 31", "n > 31"),
        (A, "add: the exponents are equal", "n == 0"),
    ]),
    ("decoder/project.c", "    const int32_t n = 2 - a.exp;\n", [
        (A, "q28: 0, as 2 - e_a exceeds 32", "n > 32"),
    ]),
    ("decoder/project.c", "    /* Adding 1 for the bits that are shifted out "
     "makes this an upper bound. */\n", [
         (A, "extent_x: j is 0 or less", "j <= 0"),
     ]),
    ("decoder/project.c", "    sg += sh - 22 - j;\n", [
        (A, "extent_x: d is 0 or less", "sg <= 0"),
        (A, "extent_x: clamped to 2^25",
         "sg > 0 && (e >> sg) + 1 > LIMIT_EXTENT"),
    ]),
    ("decoder/project.c", "    e = l_q12 * (int64_t)(saga_recip16((uint32_t)h, "
     "&n) + 2);\n", [
         (A, "extent_y: s_h is 24 or less", "n <= 24"),
         (A, "extent_y: clamped to 2^25",
          "n > 24 && (e >> (n - 24)) + 1 > LIMIT_EXTENT"),
     ]),
    ("decoder/project.c",
     "    const int32_t hi = ((mean_q8 + extent_q8 - 128) >> 8) + 1;\n", [
         (A, "a box begins before the picture and ends after it",
          "lo < 0 && hi > side"),
         (A, "drop: the box has no pixel",
          "fx_clamp(lo, 0, side) >= fx_clamp(hi, 0, side)"),
     ]),

    # --- Pictures ------------------------------------------------------------
    ("decoder/raster_write.c", "    /* Coordinates of the job, not of the "
     "camera's picture. */\n", [
         (B, "a picture of 16 bits", "r->pic->bits == 16"),
         (B, "a picture of depths", "r->pic->bits == SAGA_DEPTH"),
     ]),

    # --- Names ---------------------------------------------------------------
    ("decoder/names.c", "    naming->name[shared + more] = 0;\n", [
        (B, "a name of 63 bytes", "shared + more == 63"),
    ]),

    # --- Blending ------------------------------------------------------------
    ("decoder/blend.c", "        uint32_t w;\n", [
        (A, "T is below 8: nothing", "q < SAGA_CUT_Q20 && *t < "
         "SAGA_T_FLOOR_Q16"),
        (A, "alpha is 64880", "q < SAGA_CUT_Q20 && alpha_q16(q) == "
         "SAGA_ALPHA_CAP_Q16"),
        (A, "STEEP", "p->tools & SAGA_TOOL_STEEP"),
    ]),
    ("decoder/blend.c", "    const int64_t rise = p->n * down;\n", [
        (A, "v exceeds 32 bits in a splat's box",
         "!is_small(left) || !is_small(right)"),
    ]),
]
