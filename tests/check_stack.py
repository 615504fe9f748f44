#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures the worst-case stack of every public function by gcc's call graph.

check_stack.py [small|all] [NAME...]: measures only these targets; `small` takes
x86_64, and the build at -O0 for the addresses. The firmware's tests measure the
stack of a Cortex-M3.

Builds common/ and decoder/ with the product's flags and -fcallgraph-info=su
(x86-64 at -O2 with and without AVX2 and without vectors, Cortex-M3 at -Os), walks the graph from
every function that decoder/saga.h declares, prints the depth in bytes and the
deepest path, and fails on
  - more than LIMIT bytes,
  - recursion, or a frame whose size is not known,
  - a call of a function that is neither here nor in EXTERNAL,
  - a function declared in saga.h and not defined.

Indirect calls: a call through a pointer may reach any function that is named in
tests/support/coder_functions.txt, and the deepest of them counts. The list must
have only functions of common/ and decoder/, and all of these whose address is
taken. Taken addresses are found in the relocations of objects built without
-fPIC and with -ffunction-sections: calls are relocated relative to the program
counter, addresses in code or tables absolutely (those of jump tables point into
a function: offset > 0). A build at -O0 also has the addresses that the
optimiser removes, so the list is complete for other compilers too.

One function calls a function of the library's user (saga_watch). The stack of
that is not included.

gcc's frame sizes include the return address on x86-64 and the saved link
register on Arm. RETURN bytes are added for each call as a margin for other
compilers.
"""

import os
import re
import subprocess
import sys

LIMIT = 4096
RETURN = 8
LIST = "tests/support/coder_functions.txt"
ASKS_THE_USER = "saga_tally_add"

# A generous bound for the stack of functions that compilers call by themselves.
EXTERNAL = {"memcpy": 64, "memmove": 64, "memset": 64, "memcmp": 64}

TARGETS = [
    # name, compiler, optimisation, flags, objdump, measured
    ("x86_64", "gcc", "-O2", "-fno-pic -fno-pie", "objdump", True),
    ("x86_64-avx2", "gcc", "-O2", "-fno-pic -fno-pie -mavx2", "objdump", True),
    ("x86_64-plain", "gcc", "-O2", "-fno-pic -fno-pie -mgeneral-regs-only",
     "objdump", True),
    ("cortex-m3", "arm-none-eabi-gcc", "-Os",
     "-mthumb -mcpu=cortex-m3 -mfloat-abi=soft", "arm-none-eabi-objdump",
     True),
    ("x86_64-O0", "gcc", "-O0", "-fno-pic -fno-pie", "objdump", False),
]
ABSOLUTE = {
    "R_X86_64_64", "R_X86_64_32", "R_X86_64_32S", "R_ARM_ABS32",
    "R_ARM_TARGET1", "R_ARM_MOVW_ABS_NC", "R_ARM_THM_MOVW_ABS_NC",
}


class Failure(Exception):
    pass


def run(command):
    # A compiler cache would keep objects but no call graphs.
    done = subprocess.run(command, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, check=False,
                          env=dict(os.environ, CCACHE_DISABLE="1"))
    if done.returncode != 0:
        raise Failure("%s\n%s" % (" ".join(command), done.stdout))
    return done.stdout


def sources():
    found = []
    for top in ("common", "decoder"):
        for folder, _, names in os.walk(top):
            found += [os.path.join(folder, n) for n in names
                      if n.endswith(".c")]
    return sorted(found)


def build(folder, compiler, level, flags):
    make = os.environ.get("MAKE", "make")
    run([make, "-s", "-j%d" % (os.cpu_count() or 1), "BUILD=" + folder,
         "CC=" + compiler, "OPT=" + level, "CFLAGS=" + flags +
         " -ffunction-sections -fstack-usage -fcallgraph-info=su", "lib"])
    return [os.path.join(folder, "obj", s[:-2]) for s in sources()]


def public_functions():
    """Returns the names of the functions that saga.h declares."""
    with open("decoder/saga.h", encoding="utf-8") as f:
        text = re.sub(r"/\*.*?\*/|//[^\n]*", " ", f.read(), flags=re.S)
    text = re.sub(r"^[ \t]*#(\\\n|[^\n])*", " ", text, flags=re.M)
    text = text.replace('extern "C" {', " ")
    while re.search(r"\{[^{}]*\}", text):
        text = re.sub(r"\{[^{}]*\}", " ", text)
    names = []
    for statement in text.split(";"):
        if "typedef" not in statement:
            names += re.findall(r"\b(saga_\w+)\s*\(", statement)[:1]
    return names


def base(title):
    """Returns the name in the source: without the file and without the suffix
    of a clone."""
    return title.split(":")[-1].split(".")[0]


class Graph:
    """A call graph: functions (title -> bytes of stack) and calls (title -> set
    of titles)."""

    def __init__(self, stems):
        self.size, self.calls, self.bad = {}, {}, []
        for stem in stems:
            with open(stem + ".ci", encoding="utf-8") as f:
                self.read(f.read())
        self.depth = {}

    def read(self, text):
        node = re.compile(r'^node: \{ title: "([^"]*)" label: "([^"]*)"(.*)\}',
                          re.M)
        for title, label, rest in node.findall(text):
            if "ellipse" in rest:
                continue
            found = re.search(r"(\d+) bytes \(([a-z,]*)\)", label)
            if not found:
                self.bad.append("%s: no frame size" % title)
                continue
            self.size[title] = int(found.group(1))
            self.calls.setdefault(title, set())
            if found.group(2) not in ("static", "dynamic,bounded"):
                self.bad.append("%s: frame of %s size" %
                                (title, found.group(2)))
        edge = re.compile(r'^edge: \{ sourcename: "([^"]*)" '
                          r'targetname: "([^"]*)"', re.M)
        for caller, callee in edge.findall(text):
            self.calls.setdefault(caller, set()).add(callee)

    def resolve(self, listed):
        """Replaces each indirect call by calls of the listed functions."""
        targets = {t for t in self.size if base(t) in listed}
        for caller, callees in self.calls.items():
            if "__indirect_call" not in callees:
                continue
            callees.discard("__indirect_call")
            if base(caller) == ASKS_THE_USER:
                continue
            callees |= targets
            if not targets:
                self.bad.append("%s: indirect call, and %s names no function"
                                % (caller, LIST))

    def walk(self, title, above):
        """Returns the deepest (bytes, path) from a function; adds messages to
        self.bad."""
        if title in self.depth:
            return self.depth[title]
        if title in above:
            cycle = above[above.index(title):] + [title]
            self.bad.append("recursion: " + " > ".join(map(base, cycle)))
            return 0, []
        if title not in self.size:
            if title not in EXTERNAL:
                self.bad.append("%s calls %s, which is unknown" %
                                (above[-1], title))
            return EXTERNAL.get(title, 0), [title]
        deepest = 0, []
        for callee in sorted(self.calls[title]):
            n, path = self.walk(callee, above + [title])
            if n + RETURN > deepest[0]:
                deepest = n + RETURN, path
        own = self.size[title]
        self.depth[title] = (own + deepest[0],
                             ["%s %d" % (base(title), own)] + deepest[1])
        return self.depth[title]


def addresses(stems, objdump):
    """Returns the functions whose address an object holds -> where."""
    taken = {}
    for stem in stems:
        functions = set()
        for line in run([objdump, "-t", stem + ".o"]).splitlines():
            if re.search(r"\sF\s+\.text", line):
                functions.add(line.split()[-1])
        section = ""
        for line in run([objdump, "-r", stem + ".o"]).splitlines():
            if line.startswith("RELOCATION RECORDS FOR"):
                section = line.split("[")[1].rstrip("]:")
            parts = line.split()
            if len(parts) != 3 or parts[1] not in ABSOLUTE:
                continue
            if re.match(r"\.(eh_frame|debug|ARM\.)", section):
                continue
            name = re.sub(r"^\.text\.(unlikely\.|hot\.)?", "", parts[2])
            if name in functions or re.match(r"saga_\w+$", name):
                taken.setdefault(name, "%s.o, %s" % (stem, section))
    return taken


def read_list():
    with open(LIST, encoding="utf-8") as f:
        lines = [line.split("#")[0].strip() for line in f]
    return [line for line in lines if line]


def report(name, complaints, summary):
    for c in sorted(set(complaints)):
        print("     " + c)
    if complaints:
        print("FAIL stack " + name)
    else:
        print("ok   stack %s%s" % (name, summary))
    return not complaints


def check(target, listed, entries, defined):
    name, compiler, level, flags, objdump, measured = target
    folder = os.path.join(os.environ.get("BUILD") or "build", "stack", name)
    stems = build(folder, compiler, level, flags)
    graph = Graph(stems)
    defined.update(map(base, graph.size))
    bad = ["%s (%s): its address is taken, and it is not in %s" %
           (f, where, LIST)
           for f, where in addresses(stems, objdump).items()
           if base(f) not in listed and f in
           {t.split(":")[-1] for t in graph.size}]
    if not measured:
        bad += ["%s: in %s, but nowhere in common/ or decoder/" % (f, LIST)
                for f in listed if f not in defined]
        return report("indirect calls", bad,
                      ": %d functions listed" % len(listed))
    graph.resolve(listed)
    worst = 0
    for title in graph.size:
        graph.walk(title, [])
    if not entries:
        bad.append("saga.h declares no function")
    for entry in entries:
        if entry not in graph.size:
            bad.append("%s: declared in saga.h, not defined" % entry)
            continue
        n, path = graph.depth[entry]
        worst = max(worst, n)
        print("%9d  %s" % (n, " > ".join(path)))
        if n > LIMIT:
            bad.append("%s: %d bytes, limit %d" % (entry, n, LIMIT))
    return report(name, bad + graph.bad,
                  ": at most %d bytes, limit %d" % (worst, LIMIT))


def main():
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    for variable in ("MAKEFLAGS", "MFLAGS"):
        os.environ.pop(variable, None)
    listed, defined, good = read_list(), set(), True
    entries = public_functions()
    names = [a for a in sys.argv[1:] if a not in ("small", "all")]
    small = "small" in sys.argv[1:]
    for target in TARGETS:
        if names and target[0] not in names:
            continue
        if small and target[0] not in ("x86_64", "x86_64-O0"):
            continue
        try:
            good &= check(target, listed, entries, defined)
        except (Failure, OSError) as e:
            good = report(target[0], [str(e)], "")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
