#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""run_small_mutants.py checks [FILE...] | random N [SEED]: tests whether the
vectors notice small changes of the decoder.

checks: each condition under which the decoder refuses a file is switched off,
one at a time. The test fails if no line of vectors/ notices that, unless
NEEDLESS gives the reason why none can.

random: makes N changes of one operator or number each, in the source files of
common/ and decoder/, drawn with SEED (default: the commit's hash). Tables that
have only numbers are left out, since a test compares each with its formula. A
change that no vector notices is tested on the vectors in a build without SIMD,
under sanitizers, and then by the tests of common/, decoder/, stream/ and
hardcases/. Prints the changes that nothing notices, and fails if they are more
than 5 % of those that EQUIVALENT does not list.

For a change, one file is compiled again and linked with the rest, and
check_vectors runs: for `checks` only on the files that must be refused, for
`random` on all vectors, with the plain code and with the machine's best vector
instructions. Objects are in small-mutants/ of the build folder.
"""
import hashlib
import os
import random
import re
import shlex
import subprocess
import sys

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
BUILD = os.path.join(os.environ.get("BUILD", "build"), "small-mutants")
TIMEOUT = 60
JOBS = os.environ.get("JOBS", os.cpu_count())
NOTICED, MISSED, BROKEN = "noticed", "missed", "does not compile"

# Conditions whose absence no vector shows, with the reason: FILE: TERM.
LAST = "the check that no byte is left finds it too"
END = "an error of the coder is looked at again at the chunk's end"
COUNT = "it guards memory; the counts are compared at the end again"
SUM = "the sum of the row, which is compared next, finds it too"
NEEDLESS = {
    "decoder/plan.c: h->level >= SAGA_N_PROFILES":
        "without it the limits are those behind the end of their table",
    "decoder/names.c: n - at < 2": LAST,
    "decoder/names.c: more > n - at": LAST,
    "decoder/names.c: n < at": LAST,
    "decoder/names.c: !at": LAST,
    "decoder/decoder.c: n->coarse < 1": "a tree has a leaf, which is one more",
    "common/syntax_nets.c: c->error": END,
    "common/syntax_segment.c: c->error": END,
    "common/syntax_segment.c: rank >= sc->n.coarse": COUNT,
    "common/syntax_segment.c: n > sc->n.prim": COUNT,
    "common/syntax_segment.c: nd.pending == 0":
        "a file with it needs an encoder of trees that are not valid",
    "common/syntax_nets.c: sum < 0": "the check of the row finds it too",
    "common/mlp.c: weight_abs_sum < 0": "the caller finds it first",
    "common/mlp.c: shift < 0": "no symbol is negative",
    "common/mlp.c: bias < -limit": SUM,
    "common/mlp.c: bias > limit": SUM,
    "common/mlp.c: weight_abs_sum > 65538": SUM,
    "decoder/range_dec.c: d->pos >= d->n + TAIL":
        "the end of the chunk is compared with the bytes that were read",
    "decoder/range_dec.c: d->code >= d->range":
        "a code that equals the range gives the last symbols, until an escape "
        "or a split is refused; a chunk that ends before one, with three zeros "
        "behind it, is one of 2^24",
}

# Changes that give the same decoder, with the reason: FILE: LINE -> CHANGE.
EQUIVALENT = {
    "decoder/animate.c: bits |= (uint64_t)(v[i] <= 0 ? -v[i] : v[i]);":
        "-0 is 0",
    "decoder/blend.c: if (cpu > SAGA_CPU_X4) {":
        "the plain loop gives the same bits as the vectors it replaces",
    "decoder/blend.c: if (s == (uint32_t)p->reach)":
        "what is above the reach is above the cut without the test, too",
    "decoder/raster.c: if (p.x0 > p.x1)": "an empty line has no pixels",
    "decoder/raster_list.c: return 2;": "callers ask whether it is 0",
    "decoder/project.c: return n > 33 ? 0 : "
    "(int32_t)fx_rshift64(a.mant_q30, n);":
        "a mantissa of 31 bits is 0 after a shift by 33",
    "common/model.c: return (x & (x - 2)) == 0;":
        "it differs for 1 alone, and a bank has 32 slots or more",
    "common/fine.c: for (rank = 0; rank < sc->n.fine && "
    "!saga_tally_add(sc->net.tally, 1);":
        "a watch is called a few units earlier",
    "decoder/splats.c: if (cpu == SAGA_CPU_AVX2 && n % 4 == 0)":
        "no path is better than AVX2",
    "decoder/raster.c: __builtin_prefetch((const uint8_t *)(s + 1) + 1);":
        "a prefetch has no result",
    "common/syntax_segment.c: c, saga_at_symbol(SAGA_SYM_N_PRIM, rank, 1), "
    "&sc->models->n_prim,": "only encoders read the place of a symbol",
    "decoder/splats.c: if (cpu >= SAGA_CPU_X4 && n % 2 != 0)":
        "it is compiled on other machines only",
    "common/mlp.c: room = limit - (int32_t)(bias < 1 ? -bias : bias) - "
    "(1 << shift >> 1);": "-0 is 0",
    "common/model.c: { SAGA_NET_GEO, SAGA_OUT_SLOPE, 4, 16, 0, "
    "SAGA_TOOL_SLOPE },": "only the trainer uses the finest useful format",
}


# --- Building ----------------------------------------------------------------

def commands(build, flags):
    """Returns how each file is compiled, and how check_vectors is linked."""
    program = f"{build}/check_vectors"
    make = ["make", "-s", f"BUILD={build}", "OPT=-O1", "WERROR=", *flags]
    subprocess.run(make + [program], check=True)
    text = subprocess.run(["make", "-Bn", *make[2:], program], check=True,
                          capture_output=True, text=True).stdout
    compiles, link = {}, None
    for line in text.splitlines():
        words = shlex.split(line) if " -c " in line or program in line else []
        if "-c" in words:
            compiles[words[words.index("-c") + 1]] = words
        elif words[-2:] == ["-o", program]:
            link = words
    return compiles, link


class Builder:
    def __init__(self, folder, ways, build=BUILD, flags=()):
        self.compiles, self.link = commands(build, flags)
        self.folder, self.ways = folder, ways
        self.program = f"{BUILD}/mutant/check_vectors"

    def try_source(self, path, text):
        """Returns the verdict of check_vectors on a changed file, NOTICED,
        MISSED or BROKEN, and its output."""
        source = f"{BUILD}/mutant/{os.path.basename(path)}"
        objects = f"{BUILD}/mutant/mutant.o"
        os.makedirs(os.path.dirname(source), exist_ok=True)
        with open(source, "w") as f:
            f.write(text)
        words = list(self.compiles[path])
        words[words.index("-o") + 1] = objects
        words[words.index("-c") + 1] = source
        words += ["-I" + os.path.dirname(path), "-w"]
        if subprocess.run(words, capture_output=True).returncode:
            return BROKEN, ""
        link = self.link[:-2]
        link.insert(1, objects)
        # check_vectors has functions of common/cpu.c of its own, in order to
        # choose a path, so that it cannot be linked with this file.
        if subprocess.run(link + ["-o", self.program],
                          capture_output=True).returncode:
            return BROKEN, ""
        return self.run(self.program)

    def run(self, program):
        for way in self.ways:
            try:
                out = subprocess.run([program, self.folder, *way], text=True,
                                     capture_output=True, timeout=TIMEOUT)
            except subprocess.TimeoutExpired:
                return NOTICED, "runs too long"
            if out.returncode:
                lines = [s for s in out.stdout.splitlines() if "FAIL" in s]
                return NOTICED, "\n".join(lines) or f"exit {out.returncode}"
        return MISSED, ""


def refusals():
    """Makes a folder with the vectors that must be refused."""
    folder = f"{BUILD}/refusals"
    os.makedirs(folder, exist_ok=True)
    for name in ("good", "bad", "sound", "REFUSALS"):
        if not os.path.lexists(f"{folder}/{name}"):
            os.symlink(os.path.abspath(f"vectors/{name}"), f"{folder}/{name}")
    with open(f"{folder}/MANIFEST", "w") as f:
        f.writelines(line for line in read("vectors/MANIFEST").splitlines(True)
                     if line.startswith(("bad/", "sound/")))
    return folder


def read(path):
    with open(path) as f:
        return f.read()


def blanked(text):
    """Returns the text with comments, strings and directives replaced by
    blanks."""
    pattern = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\])*\'|'
                         r'^#(?:[^\n\\]|\\\n|\\.)*', re.S | re.M)
    return pattern.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)


def line_of(text, at):
    return text.count("\n", 0, at) + 1


# --- Checks ------------------------------------------------------------------

CHECKED = ("decoder/head.c", "decoder/plan.c", "decoder/probe.c",
           "decoder/names.c", "decoder/exposures.c", "decoder/sound.c",
           "decoder/volume.c",
           "decoder/decoder.c", "decoder/draw.c", "decoder/project.c",
           "decoder/range_dec.c", "common/model.c", "common/syntax_nets.c",
           "common/syntax_segment.c", "common/mlp.c")
# What refuses a file: statuses that are about its bytes, 0 where the traversal
# returns it, and errors of the range coder.
STATUS = r"\s*\{?\s*return SAGA_ERR_(?:DATA|TRUNCATED|VERSION|LEVEL)"
ZERO = r"\s*\{?\s*(?:return (?:0|-1);|d->coder\.error = 1)"
WITH_ZERO = ("names.c", "range_dec.c", "syntax_nets.c", "syntax_segment.c",
             "mlp.c")


def closing(text, at):
    """Returns the index of the bracket that closes the one at `at`."""
    depth = 0
    for k in range(at, len(text)):
        depth += (text[k] == "(") - (text[k] == ")")
        if depth == 0:
            return k
    raise ValueError("a bracket is open")


def terms(text, begin, end, operator):
    """Spans of the terms between operators outside brackets, and of those in a
    bracket that is a term."""
    depth, first, spans = 0, begin, []
    k = begin
    while k < end:
        depth += (text[k] == "(") - (text[k] == ")")
        if depth == 0 and text[k:k + 2] == operator:
            spans.append((first, k))
            first = k = k + 2
        else:
            k += 1
    return spans + [(first, end)]


def conditions(path, text):
    """Yields the spans of conditions that refuse a file, each with the text
    that switches it off."""
    refuses = STATUS
    if path.endswith(WITH_ZERO):
        refuses = f"(?:{STATUS}|{ZERO})"
    code = blanked(text)
    for match in re.finditer(r"\bif (\()", code):
        end = closing(code, match.start(1))
        if re.match(refuses, code[end + 1:]):
            for span in terms(code, match.start(1) + 1, end, "||"):
                yield span, "0 &&"
    # Functions that return whether something is valid.
    for match in re.finditer(r"\bint \w+_(?:is|are)_valid\([^{]*\{.*?\n\}",
                             code, re.S):
        for value in re.finditer(r"return ([^;?]*);", match[0]):
            begin = match.start() + value.start(1)
            end = match.start() + value.end(1)
            if "&&" in code[begin:end]:
                for span in terms(code, begin, end, "&&"):
                    yield span, "1 ||"


def check_mutants(builder, files):
    failed = count = 0
    for path in files:
        text = read(path)
        for (begin, end), off in conditions(path, text):
            term = " ".join(text[begin:end].split())
            changed = f"{text[:begin]} ({off} ({text[begin:end]})){text[end:]}"
            result, said = builder.try_source(path, changed)
            key = f"{path}: {term}"
            count += 1
            if result == NOTICED or key in NEEDLESS:
                why = f"{said.count(chr(10)) + 1} lines" \
                    if result == NOTICED else "has a reason"
                print(f"     {path}:{line_of(text, begin)}: {term}: {why}",
                      flush=True)
                continue
            failed += 1
            print(f"FAIL {path}:{line_of(text, begin)}: {term}: {result}",
                  flush=True)
    print(f"{'FAIL' if failed else 'ok  '} {count - failed} of {count} checks "
          "are noticed or have a reason")
    return failed != 0


# --- Random changes ----------------------------------------------------------

SWAPS = {"<": ["<=", ">"], "<=": ["<", "=="], ">": [">=", "<"],
         ">=": [">", "=="], "==": ["!="], "!=": ["=="], "+": ["-"],
         "-": ["+"], "<<": [">>"], ">>": ["<<"], "&&": ["||"], "||": ["&&"],
         "+=": ["-="], "-=": ["+="], "&": ["|"], "|": ["&"]}
TOKEN = re.compile(r"(?<=[\w)\]] )(<<|>>|<=|>=|==|!=|&&|\|\||\+=|-=|[-<>+&|])"
                   r"(?= )|\b(\d+)(?=[uU]?\b)(?![.x\w])")

# Builds in which the vectors run on a change that they have not noticed.
LATER = {"no SIMD": ["CORE_CFLAGS=-mgeneral-regs-only"],
         "sanitizers": ["CC=clang", "SANITIZE=1"]}

# A line of a table that has only numbers.
NUMBERS = re.compile(r"^[ ]*\d+(?:, *\d+)+,?$", re.M)


def changes(path):
    """Yields all changes of a file: index, length, new text."""
    code = NUMBERS.sub(lambda m: " " * len(m[0]), blanked(read(path)))
    for match in TOKEN.finditer(code):
        if match[1]:
            for new in SWAPS[match[1]]:
                yield match.start(), len(match[1]), new
        else:
            yield match.start(), len(match[2]), str(int(match[2]) + 1)


class UnitTests:
    """The unit tests in a copy of the tree, in which one file is changed."""

    def __init__(self):
        self.tree = f"{BUILD}/tree"
        if not os.path.exists(self.tree):
            os.makedirs(self.tree)
            for name in ("Makefile", "common", "decoder", "reference", "trainer",
                         "tests", "docs", "tools"):
                subprocess.run(["cp", "-Rp", name, self.tree], check=True)
            os.symlink(os.path.abspath("vectors"), f"{self.tree}/vectors")
        found = self.failing("common/mlp.c", read("common/mlp.c"))
        if found:
            raise SystemExit(f"FAIL tests fail without a change: {found}")

    @staticmethod
    def groups(path):
        """Groups of tests, those that are most likely to notice a change of the
        file first: those that include its header, its folder's, all."""
        tests = [f"tests/{folder}/{name}"
                 for folder in ("common", "decoder", "stream", "hardcases")
                 for name in sorted(os.listdir(f"tests/{folder}"))
                 if name.startswith("test_") and name.endswith(".c")]
        stem = os.path.basename(path)[:-2]
        near = [t for t in tests if f'"{stem}.h"' in read(t) or
                f"test_{stem}" in t]
        same = [t for t in tests if t not in near and
                re.match("tests/(common|decoder)/", t)]
        return [g for g in (near, same, [t for t in tests
                                         if t not in near + same]) if g]

    def failing(self, path, text):
        """Returns the tests that fail in the first group in which one does."""
        was = read(path)
        with open(f"{self.tree}/{path}", "w") as f:
            f.write(text)
        found = []
        for group in self.groups(path):
            found = found or self.run(group)
        with open(f"{self.tree}/{path}", "w") as f:
            f.write(was)
        return found

    def run(self, sources):
        subprocess.run(["rm", "-rf", f"{self.tree}/build/log"], check=True)
        subprocess.run(
            ["make", "-s", "-k", f"-j{JOBS}", "WERROR=-w", "TIMEOUT=300",
             f"TESTS_SRC={' '.join(sources)}", "run-tests"],
            cwd=self.tree, capture_output=True)
        logs = f"{self.tree}/build/log"
        return sorted(name[:-3] for name in os.listdir(logs)
                      if name.endswith(".rc") and
                      read(f"{logs}/{name}").strip() != "0")


def random_mutants(builder, n, seed):
    files = [p for p in sorted(builder.compiles)
             if re.match(r"(?:common|decoder)/\w+\.c$", p)]
    every = [(p, c) for p in files for c in changes(p)]
    drawn = random.Random(int(hashlib.sha256(seed.encode()).hexdigest(), 16))
    units = None
    later = {}
    by_vectors = by_tests = tried = 0
    by = dict.fromkeys(LATER, 0)
    while tried < n:
        path, (at, length, new) = drawn.choice(every)
        text = read(path)
        changed = text[:at] + new + text[at + length:]
        line = line_of(text, at)
        after = " ".join(changed.splitlines()[line - 1].split())
        if f"{path}: {after}" in EQUIVALENT:
            continue
        result, _ = builder.try_source(path, changed)
        if result == BROKEN:
            continue
        tried += 1
        if result == NOTICED:
            by_vectors += 1
            continue
        for name, flags in LATER.items():
            later[name] = later.get(name) or Builder(
                "vectors", [["plain"], []][:1 + (name == "sanitizers")],
                f"{BUILD}/{name.replace(' ', '-')}", flags)
            if later[name].try_source(path, changed)[0] == NOTICED:
                by[name] += 1
                break
        else:
            name = None
        if name:
            print(f"     noticed with {name} {path}:{line}: {after}",
                  flush=True)
            continue
        units = units or UnitTests()
        failing = units.failing(path, changed)
        by_tests += len(failing) > 0
        print(f"     {'noticed by ' + failing[0] if failing else 'missed'} "
              f"{path}:{line}: {after}", flush=True)
    missed = n - by_vectors - sum(by.values()) - by_tests
    ok = missed * 20 <= n
    print(f"{'ok  ' if ok else 'FAIL'} {n - missed} of {n} random mutants are "
          f"noticed, {by_vectors} by vectors, " +
          ", ".join(f"{k} by these with {name}" for name, k in by.items()) +
          f", {by_tests} by unit tests; of {len(every)}, seed {seed}")
    return not ok


def main():
    os.chdir(ROOT)
    mode, rest = sys.argv[1], sys.argv[2:]
    if mode == "checks":
        os.makedirs(BUILD, exist_ok=True)
        return check_mutants(Builder(refusals(), [[]]), rest or CHECKED)
    builder = Builder("vectors", [["plain"], []])
    seed = rest[1] if len(rest) > 1 else subprocess.run(
        ["git", "rev-parse", "HEAD"], check=True, capture_output=True,
        text=True).stdout.strip()
    return random_mutants(builder, int(rest[0]), seed)


if __name__ == "__main__":
    sys.exit(main())
