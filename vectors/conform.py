#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""conform.py [--level N] [--pictures] PROGRAM [ARGUMENT ...]: tells whether a
decoder conforms to the format.

Asks PROGRAM about every line of MANIFEST and REFUSALS, which lie next to this
file, with --pictures also of PICTURES, and prints each wrong answer, then `N passed, N failed`. PROGRAM runs
once; it reads one question a line from its standard input and writes one answer
a line to its standard output:

    question                      answer
    SEGMENT T CAMERA PATH         SYMBOLS RANGE RANGE RANGE PRIMITIVES SPLATS
                                  FRAME, or the number of a status
    KIND PATH                     the number of a status
    KIND SEGMENT T CAMERA PATH    the CRC of a picture, or the number of a
                                  status; with --pictures

Section 11 of bitstream.md defines the columns and the kinds (status, last,
names, sound and so on; wide and depth for pictures). A column that the decoder does not have yet is `-`; it
is counted as missing and its line as failed. With --level N the good files of
higher levels must be refused with LEVEL, and refusals by a file of a higher
level are left out.

Exit status: 0 all passed, 1 some failed, 2 the program or the lists cannot be
read.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
COLUMNS = ["SYMBOLS", "RANGE of COAR", "RANGE of FINE", "RANGE of PRIM",
           "PRIMITIVES", "SPLATS", "FRAME"]
LEVEL = -13         # the status of a file whose level is too high
LEVEL_AT = 12       # where the header has the level, u8


def lines(name):
    """Yields the fields of each line of a list that is not a comment."""
    for line in (HERE / name).read_text("ascii").splitlines():
        if line and not line.startswith("#"):
            yield line.split()


def level(file):
    """Returns the level in a file's bytes, or 0 if the file is too short to
    have one."""
    return file[LEVEL_AT] if len(file) > LEVEL_AT else 0


def manifest(top):
    """Yields (description, question, right answer) for each line of
    MANIFEST."""
    for file, *rest in lines("MANIFEST"):
        path = HERE / file
        is_above = level(path.read_bytes()) > top
        if not rest[0].isdigit():
            if not is_above:
                yield file, f"{rest[0]} {path}", [rest[1]]
            continue
        segment, *crcs = rest
        t, camera = crcs[4:6]
        yield (f"{file} segment {segment}, t {t}, camera {camera}",
               f"{segment} {t} {camera} {path}",
               [str(LEVEL)] if is_above else crcs[:4] + crcs[6:])


def pictures(top):
    """Yields the same for PICTURES."""
    for file, kind, segment, t, camera, crc in lines("PICTURES"):
        path = HERE / file
        is_above = level(path.read_bytes()) > top
        yield (f"{file} {kind}, segment {segment}, t {t}, camera {camera}",
               f"{kind} {segment} {t} {camera} {path}",
               [str(LEVEL) if is_above else crc])


def refusals(top, folder):
    """Yields the same for REFUSALS, and writes the files to refuse into a
    folder."""
    for i, (rule, name, kind, status, file, *edits) in \
            enumerate(lines("REFUSALS")):
        old, new, at = (HERE / file).read_bytes(), b"", 0
        if level(old) > top:
            continue
        for edit in edits:
            place, n, text = edit.split(":")
            new += old[at:int(place)] + bytes.fromhex(text)
            at = int(place) + int(n)
        path = Path(folder) / f"{i}.saga"
        path.write_bytes(new + old[at:])
        yield f"{rule} {name}", f"{kind} {path}", [status]


def verdict(what, right, answer):
    """Prints how an answer differs from the right one. Returns True if it does
    not."""
    if answer == right:
        return True
    if len(right) == len(answer) == len(COLUMNS):
        wrong = [f"{column} is {a}, not {r}" if a != "-" else f"no {column}"
                 for column, a, r in zip(COLUMNS, answer, right) if a != r]
    else:
        wrong = [f"{' '.join(answer) or 'no answer'}, not {' '.join(right)}"]
    print(f"FAIL {what}: {'; '.join(wrong)}")
    return False


def main():
    """Asks the program all questions and counts its right answers."""
    command, top = sys.argv[1:], 255
    if command[:1] == ["--level"] and command[1:2] and command[1].isdigit():
        top, command = int(command[1]), command[2:]
    more = command[:1] == ["--pictures"]
    command = command[more:]
    if not command or command[0].startswith("-"):
        print(__doc__, end="",
              file=sys.stdout if command == ["--help"] else sys.stderr)
        return 0 if command == ["--help"] else 2
    with tempfile.TemporaryDirectory() as folder:
        try:
            asked = [*manifest(top), *(pictures(top) if more else ()),
                     *refusals(top, folder)]
            questions = "".join(f"{question}\n" for _, question, _ in asked)
            done = subprocess.run(command, input=questions, text=True,
                                  stdout=subprocess.PIPE, check=False)
        except (OSError, ValueError) as error:
            print(f"conform.py: {error}", file=sys.stderr)
            return 2
    answers = [line.split() for line in done.stdout.splitlines()]
    answers += [[]] * (len(asked) - len(answers))
    if len(answers) > len(asked):
        print(f"conform.py: {len(answers)} answers to {len(asked)} questions",
              file=sys.stderr)
        return 2
    passed = sum(verdict(what, right, answer)
                 for (what, _, right), answer in zip(asked, answers))
    print(f"{passed} passed, {len(asked) - passed} failed")
    return passed != len(asked)


if __name__ == "__main__":
    sys.exit(main())
