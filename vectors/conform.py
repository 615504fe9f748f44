#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""conform.py [--level N] [--pictures] PROGRAM [ARGUMENT ...]: tells whether a
decoder conforms to the format.

Asks PROGRAM about every line of MANIFEST, BOXES, VALUES and REFUSALS, with
--pictures also of PICTURES, in the folder of this file, in v1 and in v1-more.
Prints each wrong answer, then `N passed, N failed`. PROGRAM runs once; it reads
one question a line from its standard input and writes one answer a line to its
standard output:

    question                      answer
    SEGMENT T CAMERA PATH         SYMBOLS RANGE RANGE RANGE PRIMITIVES SPLATS
                                  FRAME, or the number of a status
    boxes SEGMENT T CAMERA PATH   the CRC of the boxes, or a status
    time NUM DEN PATH             the segment and t, or a status
    name CAMERA PATH              the name in hexadecimal, - for none, or a
                                  status
    gains CAMERA PATH             three gains, or a status
    world X Y Z PATH              three places, real numbers, or a status
    sector PATH                   19 numbers of the volume, or a status
    KIND PATH                     the number of a status; KIND is status, last,
                                  names, exposure, sound or volume
    KIND SEGMENT T CAMERA PATH    the CRC of a picture, or a status; KIND is
                                  wide or depth; with --pictures

Section 11 of bitstream.md defines the columns and the kinds. A column that the
decoder does not have yet is `-`; it is counted as missing and its line as
failed. With --level N files of higher levels must be refused with LEVEL, where
an earlier check does not refuse them.

Exit status: 0 all passed, 1 some failed, 2 the program or the lists cannot be
read.
"""
import math
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
FOLDERS = (HERE, HERE / "v1", HERE / "v1-more")
COLUMNS = ["SYMBOLS", "RANGE of COAR", "RANGE of FINE", "RANGE of PRIM",
           "PRIMITIVES", "SPLATS", "FRAME"]
LEVEL = "-13"       # the status of a file whose level is too high
LEVEL_AT = 12       # where the header has the level, u8
# The checks of opening that come before that of the level.
BEFORE_LEVEL = tuple(f"open.{n}" for n in range(1, 10))
# How many arguments the kinds of VALUES have.
N_ARGUMENTS = {"time": 2, "name": 1, "gains": 1, "world": 3, "sector": 0}


def lines(name):
    """Yields the folder and the fields of each line of the lists of a name that
    is not a comment."""
    for folder in FOLDERS:
        if (folder / name).exists():
            for line in (folder / name).read_text("ascii").splitlines():
                if line and not line.startswith("#"):
                    yield folder, line.split()


def is_above(file, top):
    """Returns whether a file's bytes have a level above one."""
    return len(file) > LEVEL_AT and file[LEVEL_AT] > top


def manifest(top):
    """Yields (description, question, right answer) for each line of
    MANIFEST."""
    for folder, (file, *rest) in lines("MANIFEST"):
        path = folder / file
        above = is_above(path.read_bytes(), top)
        if not rest[0].isdigit():
            # The list does not say which check refuses a bad file.
            if not above:
                yield file, f"{rest[0]} {path}", [rest[1]]
            continue
        segment, *crcs = rest
        t, camera = crcs[4:6]
        yield (f"{file} segment {segment}, t {t}, camera {camera}",
               f"{segment} {t} {camera} {path}",
               [LEVEL] if above else crcs[:4] + crcs[6:])


def pictures(name, top):
    """Yields the same for PICTURES or BOXES."""
    for folder, (file, kind, segment, t, camera, crc) in lines(name):
        path = folder / file
        yield (f"{file} {kind}, segment {segment}, t {t}, camera {camera}",
               f"{kind} {segment} {t} {camera} {path}",
               [LEVEL if is_above(path.read_bytes(), top) else crc])


def values(top):
    """Yields the same for VALUES."""
    for folder, (file, kind, *rest) in lines("VALUES"):
        path, n = folder / file, N_ARGUMENTS[kind]
        question = " ".join((kind, *rest[:n]))
        yield (f"{file} {question}", f"{question} {path}",
               [LEVEL] if is_above(path.read_bytes(), top) else rest[n:])


def refusals(top, made):
    """Yields the same for REFUSALS, and writes the files to refuse into the
    folder `made`."""
    for i, (folder, (rule, name, kind, status, file, *edits)) in \
            enumerate(lines("REFUSALS")):
        old, new, at = (folder / file).read_bytes(), b"", 0
        for edit in edits:
            place, n, text = edit.split(":")
            new += old[at:int(place)] + bytes.fromhex(text)
            at = int(place) + int(n)
        new += old[at:]
        path = Path(made) / f"{i}.saga"
        path.write_bytes(new)
        if is_above(new, top) and rule not in BEFORE_LEVEL:
            status = LEVEL
        yield f"{rule} {name}", f"{kind} {path}", [status]


def are_close(answer, right):
    """Returns whether real numbers agree as well as floats can."""
    try:
        return len(answer) == len(right) and all(
            math.isclose(float(a), float(r), rel_tol=1e-6)
            for a, r in zip(answer, right))
    except ValueError:
        return False


def verdict(what, right, answer):
    """Prints how an answer differs from the right one. Returns True if it does
    not."""
    if answer == right or " world " in what and are_close(answer, right):
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
            asked = [*manifest(top), *pictures("BOXES", top), *values(top),
                     *(pictures("PICTURES", top) if more else ()),
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
