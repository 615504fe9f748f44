#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""run_crashes.py [N [SEED]]: runs N trials (100) in which `saga encode`, its
--sweep, `saga join` or `saga import` is killed at a random moment, has a full
disk or too little memory, or finds a damaged checkpoint.

Every trial must end in one of two ways: with the bytes of an undisturbed run,
if needed after --resume or a second run; or with a message and a status, and
without an incomplete file. The trial's number and the seed repeat a trial,
except for the moment at which it is killed.
"""
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import verdict

SAGA = os.path.abspath(verdict.SAGA)
SMALL = ["--primitives", "150", "--iterations", "120", "--moving", "--ablate",
         "no-teachers", "--threads", "1"]
KINDS = {
    "encode": ["encode", "cap", "-o", "x.saga", *SMALL,
               "--checkpoint-every", "0"],
    "sweep": ["encode", "cap", "-o", "x.sweep", "--sweep", "--primitives",
              "60", "--iterations", "60", "--moving", "--ablate",
              "no-teachers", "--threads", "1", "--checkpoint-every", "0"],
    "join": ["join", "a.saga", "b.saga", "-o", "x.saga"],
    "import": ["import", "a.ply", "-o", "x.saga", "--size", "32x32",
               "--iterations", "60", "--threads", "1"],
}
RESUMES = ("encode", "sweep")
INPUTS = {"cap", "a.saga", "b.saga", "a.ply", "w.saga"}


def contents(path):
    """Returns the bytes of a file, or of the saga files of a folder, because
    reports have times."""
    if not os.path.isdir(path):
        return verdict.read(path)
    return {name: verdict.read(f"{path}/{name}")
            for name in sorted(os.listdir(path)) if name.endswith(".saga")}


def out_of(kind):
    return "x.sweep" if kind == "sweep" else "x.saga"


def clean():
    for name in set(os.listdir(".")) - INPUTS:
        if os.path.isdir(name):
            shutil.rmtree(name)
        else:
            os.remove(name)


def start(words, limit=None):
    def limited():
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        # A write beyond the limit fails as on a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        if limit:
            resource.setrlimit(limit[0], (limit[1], limit[1]))
    return subprocess.Popen([SAGA, *words], stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            preexec_fn=limited)


def finish(program):
    _, said = program.communicate(timeout=600)
    return program.returncode, said.decode(errors="replace")


class Trial:
    def __init__(self, kind, whole, seconds, need, drawn):
        self.kind, self.whole, self.seconds = kind, whole, seconds
        self.need = need
        self.drawn, self.out = drawn, out_of(kind)

    def is_whole(self):
        return os.path.exists(self.out) and contents(self.out) == self.whole

    def left(self):
        """Returns what must not remain: a result that is incomplete, and files
        that are neither a result nor a checkpoint."""
        known = INPUTS | {self.out, self.out + ".ckpt", self.out + ".ckpt.csv"}
        left = set(os.listdir(".")) - known
        if not os.path.isdir(self.out) and os.path.exists(self.out) and \
                not self.is_whole():
            left.add(self.out)
        return left

    def again(self):
        """Ends what was disturbed. Returns a complaint, or nothing."""
        resume = ["--resume"] if self.kind in RESUMES else []
        rc, said = finish(start([*KINDS[self.kind], *resume]))
        # A file that is whole has no checkpoint from which to go on.
        if rc and not (self.is_whole() and "exists, but there is no checkpoint" in said):
            return f"does not go on: {said}"
        if not self.is_whole():
            return "goes on to other bytes"
        return f"leaves {self.left()}" if self.left() else ""

    def kill(self):
        for _ in range(self.drawn.choice((1, 1, 2))):
            resume = ["--resume"] if self.kind in RESUMES and \
                set(os.listdir(".")) - INPUTS else []
            program = start([*KINDS[self.kind], *resume])
            time.sleep(self.drawn.random() * self.seconds)
            program.kill()
            program.communicate()
            if not os.path.isdir(self.out) and os.path.exists(self.out) and \
                    not self.is_whole():
                return "killed", "a half-written file"
        return "same", self.again()

    def refused(self, rc, said, words):
        if rc == 0:
            return "same", "" if self.is_whole() else "other bytes"
        # A program that has no memory for its libraries cannot say so itself.
        if rc < 0 or ("saga" in said and not any(w in said for w in words)):
            return "refused", f"status {rc}: {said}"
        if self.kind != "sweep" and self.left():
            return "refused", f"leaves {self.left()}"
        return "refused", self.again()

    def full_disk(self):
        size = 40_000 if self.kind == "sweep" else len(self.whole)
        limit = self.drawn.randrange(self.drawn.choice((size, 4 * size)))
        return self.refused(*finish(start(
            KINDS[self.kind], (resource.RLIMIT_FSIZE, limit))), ["free space"])

    def no_memory(self):
        # Most limits are too low for the run, some too low for its libraries.
        limit = self.drawn.randrange(self.need * 3 // 5, self.need * 21 // 20)
        return self.refused(*finish(start(
            KINDS[self.kind], (resource.RLIMIT_AS, limit))),
            ["memory", "libraries"])

    def damage(self):
        """Damages a checkpoint. It must be refused, and a training must start
        again without it."""
        path = self.out + ".ckpt"
        program = start(KINDS["encode"])
        for _ in range(2000):
            if os.path.exists(path) or program.poll() is not None:
                break
            time.sleep(0.005)
        program.kill()
        program.communicate()
        if not os.path.exists(path):
            return "same", self.again()
        was = bytearray(verdict.read(path))
        bad = bytearray(was)
        at = self.drawn.randrange(len(bad))
        how = self.drawn.randrange(4)
        if how == 0:
            bad[at] ^= 1 << self.drawn.randrange(8)
        elif how == 1:
            del bad[at:]
        elif how == 2:
            bad[at:at + 512] = bytes(len(bad[at:at + 512]))
        else:
            bad += bytes(1 + at % 100)
        if bad == was:
            return "same", self.again()
        with open(path, "wb") as f:
            f.write(bad)
        rc, said = finish(start([*KINDS["encode"], "--resume"]))
        if rc == 0 or "x.saga.ckpt" not in said or "delete it" not in said:
            return "refused", f"a damaged checkpoint: status {rc}: {said}"
        os.remove(path)
        return "refused", self.again()


def need_of(kind, least=4 << 20, most=1 << 30):
    """Returns the limit on addresses, to 64 KiB, from which on a run ends
    whole."""
    while most - least > 64 << 10:
        clean()
        middle = (least + most) // 2
        rc, _ = finish(start(KINDS[kind], (resource.RLIMIT_AS, middle)))
        least, most = (middle, most) if rc else (least, middle)
    return most


def prepare():
    def must(*words):
        subprocess.run([SAGA, *words], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)

    must("synth", "cap", "--size", "64x36", "--cameras", "4", "--hold-out",
         "1", "--frames", "48", "--points", "300", "--depth-every", "0")
    must("encode", "cap", "-o", "w.saga", "--primitives", "60",
         "--iterations", "60", "--segment", "24")
    must("cut", "w.saga", ":24", "-o", "a.saga")
    must("cut", "w.saga", "24:", "-o", "b.saga")
    must("export", "a.saga", "-o", "a.ply", "--frame", "0")
    shutil.rmtree("cap")
    must("synth", "cap", "--size", "64x36", "--cameras", "4", "--hold-out",
         "1", "--frames", "4", "--points", "300", "--depth-every", "0")
    runs = {}
    for kind, words in KINDS.items():
        clean()
        begun = time.monotonic()
        must(*words)
        seconds = time.monotonic() - begun
        whole = contents(out_of(kind))
        runs[kind] = (whole, seconds, kind != "sweep" and need_of(kind))
    return runs


def main():
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    failed, ends = 0, {}
    folder = tempfile.mkdtemp(prefix="saga_crashes.")
    os.chdir(folder)
    runs = prepare()
    plan = ["encode kill"] * 4 + ["join kill", "import kill", "sweep kill"]
    plan += ["encode damage"] * 3
    plan += [f"{kind} {how}" for how in ("full_disk", "no_memory")
             for kind in ("encode", "join", "import")]
    for number in range(n):
        drawn = random.Random(seed * 1_000_003 + number)
        kind, how = plan[number % len(plan)].split()
        clean()
        trial = Trial(kind, *runs[kind], drawn)
        end, complaint = getattr(trial, how)()
        ends[how, end] = ends.get((how, end), 0) + 1
        if complaint:
            failed += 1
            print(f"FAIL crashes: trial {number}, {kind}, {how}: {complaint}",
                  flush=True)
    os.chdir("/")
    shutil.rmtree(folder)
    counts = ", ".join(f"{how} {end} {k}"
                       for (how, end), k in sorted(ends.items()))
    print(f"{'FAIL' if failed else 'ok  '} crashes: {n - failed} of {n} trials "
          f"end whole or refused, seed {seed}: {counts}")
    return failed != 0


sys.exit(main())
