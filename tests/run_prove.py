#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""run_prove.py [NAME...]: proves with Frama-C's plugin Eva that functions of
common/ and decoder/ read and write only inside their memory, read nothing that
is not initialised, and do not overflow, for all inputs of tests/prove/. Each
alarm that Eva raises needs a reason in ARGUED. Then some mistakes are planted,
each of which must raise an alarm that has none.

Without Frama-C (Debian: frama-c-base) it prints that it is skipped.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
TIMEOUT = int(os.environ.get("TIMEOUT", "1200"))

HEAD = ["decoder/head.c", "decoder/probe.c", "common/container.c",
        "common/crc32c.c"]
# name: its file and function, the sources, Eva's options.
PROOFS = {
    "fx": ("fx main", [], ["-eva-slevel-function", "formats:2000,shifts:100"]),
    "range": ("range main",
              ["decoder/range_dec.c", "common/prob.c", "common/tally.c"],
              ["-eva-widening-delay", "300", "-eva-min-loop-unroll", "20",
               "-eva-slevel-function", "residuals:100,symbols:100,fields:100"]),
    "plan": ("plan main",
             ["decoder/plan.c", "decoder/reconstruct.c", "common/model.c",
              "common/nets.c", "common/fx_math.c", "common/memory_bank.c",
              "common/scaffold.c"],
             ["-eva-precision", "2"]),
    "probe": ("head prove_probe", HEAD, ["-eva-slevel", "1000"]),
    "rig": ("head prove_rig", HEAD, ["-eva-slevel", "1000"]),
    "find": ("head prove_find", HEAD, ["-eva-slevel", "1000"]),
    "names": ("names main", ["common/container.c", "common/crc32c.c"],
              ["-eva-precision", "1", "-eva-domains", "octagon",
               "-eva-slevel-function", "main:50"]),
    "tail": ("tail main",
             ["decoder/exposures.c", "decoder/sound.c", "decoder/head.c",
              "common/container.c", "common/crc32c.c"],
             ["-eva-slevel", "400"]),
    "volume": ("volume main",
               ["decoder/volume.c", "decoder/head.c", "common/container.c",
                "common/crc32c.c"],
               ["-eva-slevel", "4000", "-eva-min-loop-unroll", "4"]),
    "nets": ("nets main", ["common/mlp.c", "common/nets.c", "common/prob.c"],
             ["-eva-min-loop-unroll", "10"]),
    "tree": ("tree main", ["common/prob.c", "common/scaffold.c"],
             ["-eva-precision", "3"]),
}

TEXT = ("the name ends with a 0 in its 64 bytes, and a 0 is no byte of a longer "
        "character, so that no character reaches past it")
SUM = "a row has at most 512 weights of at most 32767 each"
TOOL = "a size without its tool is 0, or the header was refused before"
# Alarms that are wrong, and why: PROOF: FILE: ASSERTION.
ARGUED = {
    "plan: common/model.c: 0 \u2264 (int)m->hash_log2_entries < 32": TOOL,
    "plan: common/fx.h: prove_trap": "saga_recip32 of bank_blocks. " + TOOL,
    "names: decoder/names.c: \\valid_read(s + i)": TEXT,
    "names: decoder/names.c: \\valid_read(s)": TEXT,
    "nets: common/syntax_nets.c: sum + ": SUM,
    "tree: common/syntax_segment.c: 0 \u2264 number < 32":
        "a parent whose child is made has one that is pending, of 16",
}

# Mistakes that must raise an alarm: proof, file, what was, what is.
FAULTS = [
    ("fx", "common/fx.h", "if (n == 0)\n        return x;\n    FX_ASSERT(x <= "
     "INT32_MAX", "FX_ASSERT(x <= INT32_MAX"),
    ("range", "decoder/range_dec.c", "d->pos < d->n ?", "d->pos <= d->n ?"),
    ("range", "decoder/range_dec.c", "m <= row.max &&", "m <= row.max + 1 &&"),
    ("range", "decoder/range_dec.c", "sym + 1 < n_sym && d->code >=",
     "d->code >="),
    ("plan", "decoder/plan.c", "    if (h->level >= SAGA_N_PROFILES)\n        "
     "return SAGA_ERR_LEVEL;\n", ""),
    ("find", "decoder/probe.c", "i < h.n_segments; i++", "i < h.n_frames; i++"),
    ("rig", "decoder/probe.c", "index >= h.n_cameras", "index > 1000"),
    ("tail", "decoder/head.c", "chunk->nbytes > n - SAGA_CHUNK_NBYTES",
     "chunk->nbytes > n"),
    ("names", "decoder/names.c", "more > n - at", "more > n - at + 1"),
    ("tail", "decoder/sound.c", "c->nbytes < SAGA_SOUND_NBYTES + 4 ||", ""),
    ("volume", "decoder/volume.c", "c.nbytes != SAGA_VOLUME_NBYTES",
     "c.nbytes > SAGA_VOLUME_NBYTES"),
    ("nets", "common/syntax_nets.c", "n_in - k < PIECE ? n_in - k : PIECE",
     "n_in - k"),
    ("tree", "common/syntax_segment.c", "if (rank >= sc->n.coarse)",
     "if (rank > sc->n.coarse)"),
    ("tree", "common/syntax_segment.c", "[SAGA_STEP_FEATURE], has.n)",
     "[SAGA_STEP_FEATURE], m->features)"),
]


def alarms(name, tree):
    """Runs a proof on the sources in `tree`. Returns the alarms, each as file,
    line and text, or None if Eva does not come to an end."""
    entry, sources, options = PROOFS[name]
    path, function = entry.split()
    flags = " ".join(["-DSAGA_CHECK", f"-include {ROOT}/tests/prove/eva.h",
                      f"-I{ROOT}/tests/prove", f"-I{tree}/common",
                      f"-I{tree}/common/arch", f"-I{tree}/decoder"])
    try:
        done = subprocess.run(
            ["frama-c", "-eva", "-eva-verbose", "0", "-machdep", "gcc_x86_64",
             "-eva-msg-key=-initial-state,-final-states", "-eva-split-return",
             "full", *options, "-main", function, f"-cpp-extra-args={flags}",
             f"{ROOT}/tests/prove/prove_{path}.c",
             *(f"{tree}/{s}" for s in sources)],
            capture_output=True, text=True, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        print(f"FAIL prove {name}: not done after {TIMEOUT} s")
        return None
    if done.returncode:
        print(done.stdout)
        return None
    text = done.stdout.replace(f"{tree}/", "").replace(f"{ROOT}/", "")
    found = []
    for match in re.finditer(r"\[eva:alarm\] (.*?):(\d+): Warning: *((?:\n  .*)+"
                             r"|.*)", text):
        said = " ".join(match[3].split())
        found.append((match[1], match[2], said))
    return found


def is_argued(name, alarm):
    path, _, said = alarm
    return any(key.startswith(f"{name}: {path}: ") and
               key.split(": ", 2)[2] in said for key in ARGUED)


def prove(name):
    found = alarms(name, ROOT)
    if found is None:
        return print(f"FAIL prove {name}: Eva fails") or 1
    bad = [a for a in found if not is_argued(name, a)]
    for path, line, said in bad:
        print(f"FAIL prove {name}: {path}:{line}: {said}")
    if not bad:
        print(f"ok   prove {name}: no alarm" if not found else
              f"ok   prove {name}: {len(found)} alarms, each has a reason",
              flush=True)
    return len(bad)


def plant(fault):
    name, path, was, now = fault
    with tempfile.TemporaryDirectory() as tree:
        for folder in ("common", "decoder"):
            shutil.copytree(f"{ROOT}/{folder}", f"{tree}/{folder}")
        with open(f"{tree}/{path}") as f:
            text = f.read()
        if text.count(was) < 1:
            return print(f"FAIL prove: {path} does not have: {was}") or 1
        with open(f"{tree}/{path}", "w") as f:
            f.write(text.replace(was, now, 1))
        found = alarms(name, tree)
    if found is None or all(is_argued(name, a) for a in found):
        return print(f"FAIL prove {name}: no alarm although {path} has: "
                     f"{now}") or 1
    print(f"ok   prove {name}: an alarm if {path} has: {' '.join(now.split())}",
          flush=True)
    return 0


def main():
    if not shutil.which("frama-c"):
        print("ok   prove: skipped, since there is no frama-c")
        return 0
    names = sys.argv[1:] or list(PROOFS)
    failed = sum(prove(name) for name in names)
    failed += sum(plant(f) for f in FAULTS if f[0] in names)
    return failed != 0


ROOT = os.path.abspath(ROOT)
sys.exit(main())
