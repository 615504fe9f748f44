#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_frozen.py: guarantees that files of format 1.0 play for ever.

vectors/v1/ has files as they were when the format was frozen, and what they
decode to; vectors/v1-more/ has what was added to them later. SHA256SUMS in each
folder lists all files, and its own hash stands here. If this check fails, do
not change the hash or a file: somebody has such files and expects these pixels,
for which docs/bitstream.md, section 16, gave a promise. Correct the decoder, or
put the new thing behind a bit of tools.

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
PROGRAM = ROOT / os.environ.get("SAGA_CHECK_VECTORS", "build/check_vectors")
LIST = "SHA256SUMS"
HASHES = {
    "v1": "deb9c609498114e39da196f88c015fcbfc18b3e21a539b1eb5ca69c0531754a3",
    "v1-more":
        "9441864d56605d6e27efcb0f8d650c758f37d2025e1b0fbe7fae07b88ae458eb",
}
LISTS = ("MANIFEST", "PICTURES", "BOXES", "VALUES", "REFUSALS")


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def changed(folder, digest):
    """Yields a line for each file of a folder that is not what it was."""
    if sha256(folder / LIST) != digest:
        yield f"{LIST} has changed"
    listed = {}
    for line in (folder / LIST).read_text("ascii").splitlines():
        digest, name = line.split("  ")
        listed[name] = digest
    there = {str(p.relative_to(folder)) for p in folder.rglob("*")
             if p.is_file()} - {LIST}
    yield from (f"{name} is gone" for name in sorted(set(listed) - there))
    yield from (f"{name} is new" for name in sorted(there - set(listed)))
    yield from (f"{name} has changed" for name in sorted(there & set(listed))
                if sha256(folder / name) != listed[name])


def n_lines(folder):
    """Returns the number of lines of a folder's lists that are no comments."""
    return sum(bool(line) and not line.startswith("#")
               for name in LISTS if (folder / name).exists()
               for line in (folder / name).read_text("ascii").splitlines())


def decoded(folder, _):
    """Yields a line for each line of the lists that is not what it was."""
    done = subprocess.run([PROGRAM, folder], text=True, check=False,
                          stdout=subprocess.PIPE)
    *wrong, last = done.stdout.splitlines() or [""]
    yield from wrong
    if last != f"{n_lines(folder)} passed, 0 failed":
        yield f"check_vectors: {last}"


def version():
    """Yields a line if the header of the library names another format."""
    header = (ROOT / "decoder/saga.h").read_text("ascii")
    if not re.search(r'^#define SAGA_FORMAT "1\.', header, re.M):
        yield "saga.h: the format is not version 1"


def told(name, wrong):
    """Prints the verdict of a check, and returns whether it failed."""
    wrong = list(wrong)
    for line in wrong:
        print(f"     {line}")
    print(f"{'FAIL' if wrong else 'ok  '} frozen {name}")
    return bool(wrong)


def main():
    failed = told("version", version())
    for name, digest in HASHES.items():
        for what, check in (("files", changed),
                            ("pixels and statuses", decoded)):
            failed |= told(f"{name}: {what}",
                           check(ROOT / "vectors" / name, digest))
    return failed


if __name__ == "__main__":
    sys.exit(main())
