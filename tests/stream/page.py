# SPDX-License-Identifier: MIT
"""The tables of docs/bitstream.md: fields with their places and ranges, sizes
of structures, examples of names."""
import os
import re

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
TYPES = {"u8": 1, "u16": 2, "u32": 4, "u64": 8, "i16": 2, "i32": 4}


def bound(text):
    """Returns the value of a number, 2^k, 2^k-1, or the negative of one of
    them."""
    sign = -1 if text.startswith("-") else 1
    power = re.fullmatch(r"2\^(\d+)(-1)?", text.lstrip("-"))
    if power:
        return sign * (2 ** int(power[1]) - (1 if power[2] else 0))
    return sign * int(text.lstrip("-"))


def ranges(text):
    """Returns pairs of bounds; none if the table has words instead."""
    if not re.match(r"-?\d", text):
        return []
    pairs = []
    for item in text.split(", "):
        ends = item.split("..")
        pairs.append((bound(ends[0]), bound(ends[-1])))
    return pairs


class Field:
    def __init__(self, cells):
        kind = re.fullmatch(r"([A-Za-z0-9 ]+)(?:\[(\d+)\])?", cells[2])
        self.offset, self.name = int(cells[0]), cells[3]
        self.type, self.count = kind[1], int(kind[2] or 1)
        self.size = int(cells[1]) // self.count
        self.signed = self.type in ("i16", "i32")
        self.ranges = ranges(cells[4])


def cells_of(line):
    return [c.strip() for c in line.strip().strip("|").split("|")]


def read():
    """Returns the structures by their names, and the lines of the page."""
    with open(os.path.join(ROOT, "docs", "bitstream.md")) as f:
        lines = f.read().splitlines()
    found, heading, inside = {}, None, False
    for line in lines:
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if line.startswith("| offset | bytes |"):
            inside = True
            found[heading] = []
        elif not line.startswith("|"):
            inside = False
        elif inside and not line.startswith("|-"):
            found[heading].append(Field(cells_of(line)))
    return found, lines


structures, lines = read()
sizes = {name: max(f.offset + f.size * f.count for f in fields)
         for name, fields in structures.items()}


def examples():
    """Yields the examples of the payload of NAME, after its first fields, with
    their status."""
    for line in lines:
        match = re.match(r"\| `((?:[0-9a-f]{2} ?)+)` \|.*\| (OK|DATA) \|$", line)
        if match:
            yield bytes.fromhex(match[1]), 0 if match[2] == "OK" else -10
