#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_frozen.py: guarantees that files of format 1.0 play for ever.

vectors/v1/ has files as they were when the format was frozen, and what they
decode to. SHA256SUMS there lists all of them, and its own hash stands here. If
this check fails, do not change the hash or a file of vectors/v1/: somebody has
such files and expects these pixels, for which docs/bitstream.md, section 16,
gave a promise. Correct the decoder, or put the new thing behind a bit of tools.

Environment: SAGA_CHECK_VECTORS, the program that decodes them
(build/check_vectors).
"""
import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FROZEN = ROOT / "vectors/v1"
PROGRAM = ROOT / os.environ.get("SAGA_CHECK_VECTORS", "build/check_vectors")
LIST = "SHA256SUMS"
HASH = "deb9c609498114e39da196f88c015fcbfc18b3e21a539b1eb5ca69c0531754a3"


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def changed():
    """Yields a line for each file that is not what it was."""
    if sha256(FROZEN / LIST) != HASH:
        yield f"{LIST} has changed"
    listed = {}
    for line in (FROZEN / LIST).read_text("ascii").splitlines():
        digest, name = line.split("  ")
        listed[name] = digest
    there = {str(p.relative_to(FROZEN)) for p in FROZEN.rglob("*")
             if p.is_file()} - {LIST}
    yield from (f"{name} is gone" for name in sorted(set(listed) - there))
    yield from (f"{name} is new" for name in sorted(there - set(listed)))
    yield from (f"{name} has changed" for name in sorted(there & set(listed))
                if sha256(FROZEN / name) != listed[name])


def n_lines():
    """Returns the number of lines of both lists that are no comments."""
    return sum(bool(line) and not line.startswith("#")
               for name in ("MANIFEST", "REFUSALS")
               for line in (FROZEN / name).read_text("ascii").splitlines())


def decoded():
    """Yields a line for each line of the lists that is not what it was."""
    done = subprocess.run([PROGRAM, FROZEN], text=True, check=False,
                          stdout=subprocess.PIPE)
    *wrong, last = done.stdout.splitlines() or [""]
    yield from wrong
    if last != f"{n_lines()} passed, 0 failed":
        yield f"check_vectors: {last}"


def version():
    """Yields a line if the header of the library names another format."""
    header = (ROOT / "decoder/saga.h").read_text("ascii")
    if not re.search(r'^#define SAGA_FORMAT "1\.', header, re.M):
        yield "saga.h: the format is not version 1"


def main():
    status = 0
    for name, check in (("files", changed), ("pixels and statuses", decoded),
                        ("version", version)):
        wrong = list(check())
        for line in wrong:
            print(f"     {line}")
        print(f"{'FAIL' if wrong else 'ok  '} frozen {name}")
        status |= bool(wrong)
    return status


if __name__ == "__main__":
    sys.exit(main())
