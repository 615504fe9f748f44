#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_coverage.py [write | places]: measures which parts of the decoder the
vectors exercise.

Probes are inserted into a copy of the decoder's plain C code, in coverage/ of
the build folder: one for each extreme of stream/extremes.py, and one for each
condition under which the decoder refuses a file (run_small_mutants.py finds
them). Then check_vectors runs on all vectors, those of v1-more too, and tells
the probes where each line of a list begins. The results are two lists: the
number of good files that reach each extreme, and the number of lines of bad
files that each condition refuses.

Fails if a number is 0, if a rule of section 4 of bitstream.md has no line of
REFUSALS, or if vectors/COVERAGE has other lists; `write` writes it. `places` only checks that the decoder still has the fragments of
text that stream/extremes.py names.
"""
import os
import re
import shutil
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "stream")]

import extremes
import run_small_mutants as small

ROOT = os.path.join(HERE, "..")
COPY = os.path.join(os.environ.get("BUILD", "build"), "coverage")
LIST = "vectors/COVERAGE"
FOLDERS = ("vectors", "vectors/v1-more")
# Lines of the second folder about files that the first has, too.
REPEATED = ("bad/", "sound/", "../v1/good/")

COVER_H = """
void saga_cover_line(const char *line);
int saga_cover(int probe, int result);
int saga_all_zero(const short *v, unsigned n);
int saga_are_parallel(const short *a, const short *b, unsigned n);
"""
COVER_C = """
#include <stdio.h>
static unsigned char hit[%d];
static FILE *out;
int saga_cover(int probe, int result) { hit[probe] = 1; return result; }
static void end_line(void)
{
    for (int i = 0; out && i < (int)sizeof hit; i++)
        if (hit[i]) { fprintf(out, " %%d", i); hit[i] = 0; }
}
void saga_cover_line(const char *line)
{
    if (!out) out = fopen("coverage.txt", "w");
    else end_line();
    fprintf(out, "\\n%%.*s\\t", (int)__builtin_strcspn(line, "\\n"), line);
}
__attribute__((destructor)) static void end(void) { end_line(); }
int saga_all_zero(const short *v, unsigned n)
{
    while (n && !v[n - 1]) n--;
    return n == 0;
}
int saga_are_parallel(const short *a, const short *b, unsigned n)
{
    for (unsigned i = 1; i < n; i++)
        if (a[i] * b[0] != b[i] * a[0]) return 0;
    return 1;
}
"""


def edits_of_extremes():
    """Extremes in their order, and edits (file, place, length, text) that plant
    their probes."""
    rows, edits, lost = [], [], []
    for path, fragment, seen in extremes.PLACES:
        text = small.read(path)
        plain = fragment.removeprefix("+")
        if text.count(plain) != 1:
            lost.append(f"{path} has {text.count(plain)} times: {plain!r}")
            continue
        probes = ""
        for page, what, condition in seen:
            probes += f"if ({condition}) saga_cover({len(rows)}, 1);\n"
            rows.append((page, what))
        at = text.index(plain)
        if fragment != plain:
            edits.append((path, at, 0, "{ "))
            probes += "}"
        edits.append((path, at + len(plain), 0, probes))
    for place in lost:
        fail(f"stream/extremes.py: {place}")
    if lost:
        sys.exit(1)
    return rows, edits


def edits_of_checks(first):
    """Conditions that refuse, and edits as above; probes begin at `first`."""
    rows, edits = [], []
    for path in small.CHECKED:
        text = small.read(path)
        for (begin, end), off in small.conditions(path, text):
            probe = first + len(rows)
            count = f") && saga_cover({probe}, 1))" if off == "0 &&" \
                else f") || saga_cover({probe}, 0))"
            edits += [(path, begin, 0, " (("), (path, end, 0, count)]
            rows.append((path, " ".join(text[begin:end].split())))
    return rows, edits


def plant(edits):
    """Makes the copy of the tree and applies the edits."""
    shutil.rmtree(COPY, ignore_errors=True)
    for folder in ("common", "decoder", "reference", "trainer", "tests"):
        shutil.copytree(folder, f"{COPY}/{folder}",
                        ignore=shutil.ignore_patterns("*.saga", "corpus"))
    shutil.copy("Makefile", COPY)
    for path in {e[0] for e in edits}:
        text = small.read(path)
        # Probes at one place keep their order.
        for _, at, length, new in sorted(
                (e for e in edits if e[0] == path), key=lambda e: -e[1]):
            text = text[:at] + new + text[at + length:]
        with open(f"{COPY}/{path}", "w") as f:
            f.write(text)


def fail(what):
    print(f"FAIL coverage: {what}")
    return False


def run(n_probes):
    """Runs the vectors. Returns whether all passed, and for each line of the
    lists its words and the probes that it hits."""
    with open(f"{COPY}/cover.h", "w") as f:
        f.write(COVER_H)
    with open(f"{COPY}/cover.c", "w") as f:
        f.write(COVER_C % n_probes)
    path = "tests/stream/check_vectors.c"
    text = small.read(path)
    for name in ("check_line", "check_refusal"):
        text = text.replace(
            f"static int {name}(const char *dir, const char *line)\n{{",
            f"static int {name}(const char *dir, const char *line)\n{{"
            "saga_cover_line(line);")
    with open(f"{COPY}/{path}", "w") as f:
        f.write(text)
    # The plain C code of all operators is compiled, without warnings about
    # probes.
    subprocess.run(["gcc", "-c", "cover.c", "-o", "cover.o"], cwd=COPY,
                   check=True)
    subprocess.run(
        ["make", "-s", f"-j{os.cpu_count()}", "BUILD=build", "OPT=-O1",
         "WERROR=-w", "CORE_CFLAGS=-mgeneral-regs-only", "LDFLAGS=cover.o",
         f"CFLAGS=-include {os.path.abspath(COPY)}/cover.h",
         "build/check_vectors"], cwd=COPY, check=True)
    ok, lines = True, []
    for folder in FOLDERS:
        done = subprocess.run(
            ["build/check_vectors", os.path.abspath(folder), "plain"],
            cwd=COPY, capture_output=True, text=True)
        if done.returncode:
            ok = fail(f"check_vectors with probes: "
                      f"{done.stdout.splitlines()[-1]}")
        for line in small.read(f"{COPY}/coverage.txt").splitlines():
            if line and (folder == FOLDERS[0] or
                         not line.startswith(REPEATED)):
                what, hits = line.split("\t")
                lines.append((what.split(" "), {int(k) for k in hits.split()}))
    return ok, lines


# --- Lists -------------------------------------------------------------------

# Conditions that no line of a bad file can reach, with the reason.
UNREACHABLE = {
    "shift < 0": "no symbol is negative",
    "weight_abs_sum < 0": "code_row refuses the row first",
}
# Rules of section 4 that say that contents are checked: their lines have the
# section of the contents as their rule.
CONTENTS = {"open.15": "section.9"}


def rules_of_the_page():
    """Returns the numbered checks of section 4 of bitstream.md."""
    text = small.read("docs/bitstream.md")
    for name, heading in (("open", "**Opening**"), ("segment", "**A segment**"),
                          ("names", "**Names.**"),
                          ("exposures", "**Exposures.**"),
                          ("sound", "**Sound.**"),
                          ("volume", "**Volume.**")):
        table = text[text.index(heading):].split("| # | check |")[1]
        for line in table.splitlines()[2:]:
            number = re.match(r"\| (\d+) \|", line)
            if not number:
                break
            yield f"{name}.{number[1]}"


def listed(head, rows):
    """Returns a list of lines "NUMBER PLACE WHAT" under a heading."""
    return f"# {head}\n" + "".join(
        f"{n:3} {place} {what}\n" for n, place, what in rows)


def main():
    os.chdir(ROOT)
    good, edits = edits_of_extremes()
    if "places" in sys.argv[1:]:
        print(f"ok   coverage: places of {len(good)} extremes")
        return 0
    bad, more = edits_of_checks(len(good))
    plant(edits + more)
    files, lines, rules = [set() for _ in good], [0] * len(bad), set()
    ok, hits_of_lines = run(len(good) + len(bad))
    for words, hits in hits_of_lines:
        if words[0].startswith("good/"):
            for k in hits:
                if k < len(good):
                    files[k].add(words[0])
        elif not words[0].startswith(("cut/", "../")):
            rules.add(words[0])
            # A line that has no status but 0 refuses nothing.
            if words[2 if "/" in words[0] else 3] != "0":
                for k in hits:
                    if k >= len(good):
                        lines[k - len(good)] += 1

    for (page, what), names in zip(good, files):
        if not names:
            ok = fail(f"{page}.md, {what}: no vector")
    for (path, term), n in zip(bad, lines):
        if (n == 0) != (path == "common/mlp.c" and term in UNREACHABLE):
            ok = fail(f"{path}: {term}: {n} lines")
    for rule in rules_of_the_page():
        if CONTENTS.get(rule, rule) not in rules:
            ok = fail(f"bitstream.md, {rule}: no line of REFUSALS")

    new = "# Written by tests/check_coverage.py; README.md explains it.\n"
    new += listed("good files, page, extreme", (
        (len(names), page, what) for (page, what), names in zip(good, files)))
    new += listed("lines that are refused, file, condition [: why none is]", (
        (n, path, term if n else f"{term}: {UNREACHABLE.get(term)}")
        for (path, term), n in zip(bad, lines)))
    if "write" in sys.argv[1:]:
        with open(LIST, "w") as f:
            f.write(new)
    elif small.read(LIST) != new:
        ok = fail(f"{LIST} is another: tests/check_coverage.py write")
    print(f"{'ok  ' if ok else 'FAIL'} coverage: {len(good)} extremes, "
          f"{len(bad)} conditions")
    return not ok


if __name__ == "__main__":
    sys.exit(main())
