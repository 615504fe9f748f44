#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_abi.py [--write]: guarantees that programs compiled with an earlier
saga.h still work: it has the same functions, values, and offsets of members.

Compares the header and the library with tests/api/abi.txt, which holds for
64-bit machines. A missing or changed line breaks programs, so that it is never
right to take one out: saga.h is frozen like the format (docs/bitstream.md,
section 16). A new function, value or structure is added with --write, which
refuses to remove lines.
"""
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HEADER = ROOT / "decoder/saga.h"
LIST = ROOT / "tests/api/abi.txt"
LIBRARY = ROOT / os.environ.get("SAGA_LIB", "build/libsaga.a")

# Macros that programs are compiled with, with arguments that distinguish them.
MACROS = ["SAGA_JOB_NBYTES(16, 100)", "SAGA_JOB_NBYTES(64, 1)",
          *(f"SAGA_{name}_MAX({level})" for name in ("WORK", "COVER")
            for level in range(4))]


def plain(text):
    """Returns the header without comments, macros, and parts for C++ only."""
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    text = re.sub(r"^#ifdef __cplusplus.*?^#endif", "", text,
                  flags=re.S | re.M)
    return re.sub(r"^#(?:[^\n]*\\\n)*[^\n]*", "", text, flags=re.M)


def members(text):
    """Yields (structure, member) for each structure. A member that is a pointer
    to a function counts too."""
    for name, body in re.findall(r"typedef struct (\w+) \{(.*?)\} \w+;", text,
                                 re.S):
        for declaration in body.split(";")[:-1]:
            declaration = re.sub(r"\(\*(\w+)\)\(.*\)", r"\1", declaration)
            for part in declaration.split(","):
                yield name, re.findall(r"\w+", part.split("[")[0])[-1]


def values(text):
    """Returns lines `name = value` and `structure.member at offset, size`,
    which a compiled program prints."""
    constants = re.findall(r"\b(SAGA_\w+) = ", text) + MACROS
    places = [*members(text)]
    structures = dict.fromkeys(name for name, _ in places)
    prints = [f'printf("%s = %lld\\n", "{c}", (long long){c});'
              for c in constants]
    prints += [f'printf("%s has %zu\\n", "{s}", sizeof({s}));'
               for s in structures]
    prints += [f'printf("%s at %zu, %zu\\n", "{s}.{m}", offsetof({s}, {m}), '
               f"sizeof((({s} *)0)->{m}));" for s, m in places]
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder, "abi.c"), Path(folder, "abi")
        source.write_text("#include <saga.h>\n#include <stddef.h>\n"
                          "#include <stdio.h>\nint main(void)\n{\n"
                          + "\n".join(prints) + "\nreturn 0;\n}\n", "ascii")
        subprocess.run(["gcc", "-w", "-I", HEADER.parent, source, "-o",
                        program], check=True)
        return subprocess.run([program], check=True, text=True,
                              stdout=subprocess.PIPE).stdout.splitlines()


def functions(text):
    """Returns the declarations of functions, with single blanks."""
    found = re.findall(r"^(?:const )?\w[\w ]* \*?saga_\w+\([^;{]*\);", text,
                       re.M)
    return [re.sub(r"\s+", " ", f) for f in found]


def defined():
    """Returns the names of the library's functions."""
    out = subprocess.run(["nm", "--defined-only", LIBRARY], check=True,
                         text=True, stdout=subprocess.PIPE).stdout
    return set(re.findall(r" T (\w+)$", out, re.M))


def main():
    """Compares the header with the list, or with --write adds to the list."""
    text = plain(HEADER.read_text("ascii"))
    found = functions(text)
    lines = found + values(text)
    kept = LIST.read_text("ascii").splitlines()
    wrong = [f"gone or changed: {line}" for line in kept if line not in lines]
    if sys.argv[1:] == ["--write"] and not wrong:
        LIST.write_text("\n".join(lines) + "\n", "ascii")
        return 0
    wrong += [f"not in {LIST.relative_to(ROOT)}: {line}"
              for line in lines if line not in kept]
    names = {re.search(r"(saga_\w+)\(", f).group(1) for f in found}
    wrong += [f"declared and not in the library: {n}" for n in names - defined()]
    for line in wrong:
        print(f"FAIL {line}")
    if not wrong:
        print(f"ok   abi: {len(lines)} lines")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
