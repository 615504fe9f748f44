#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""remedies.py: compares the remedies of `saga check` and `saga encode` with the
last table of docs/troubleshooting.md, by their first words.

A message that ends a command says what is wrong and, after the last semicolon,
what to do. The first word of that, as it stands in the sources of what these
commands link, must be in a row of the table; and each word of the table must
begin a remedy. Prints a line for each that is not so.
"""

import glob
import re
import sys

ROOMS = ("basics", "capture", "gpu", "nn", "rig", "scene", "train", "warm")
COMMANDS = ("encode*", "check_*", "capture_cli", "sweep")
TEXT = r'"((?:[^"\\]|\\.)*)"'


def arguments(source, start):
    """Returns the arguments of a call, from behind its parenthesis."""
    depth, found, last = 1, [], start
    for token in re.finditer(TEXT + r"|[(),]", source[start:]):
        at = start + token.start()
        if token[0] == "(":
            depth += 1
        elif token[0] == ")":
            depth -= 1
        if depth == 0 or token[0] == "," and depth == 1:
            found.append(source[last:at])
            last = at + 1
        if depth == 0:
            return found


def texts(expression):
    """Returns the strings that an expression can be, each joined."""
    apart = re.sub(TEXT, lambda s: s[0].replace("?", "").replace(":", ""),
                   expression)
    return ["".join(re.findall(TEXT, part)) for part in re.split("[?:]", apart)]


def remedies(source):
    for call in re.finditer(r"\bsaga_fail(?:_errno)?\(|\bsaga_cli_error\(",
                            source):
        a = arguments(source, call.end())
        if "cli_error" not in call[0]:
            named = re.fullmatch(r"\w+", a[2].strip())
            yield from texts(" : ".join(
                re.findall(r"\b%s(?:\[\])? = ([^;]*);" % named[0], source))
                if named and '"' not in a[2] else a[2])
        elif a[0].strip() not in ("0", "SAGA_EXIT_OK"):
            yield from (s.rpartition("; ")[2] for s in texts(a[1]) if "; " in s)


def first_words(path):
    with open(path, encoding="utf-8") as file:
        return {re.match("[`a-z-]+", s)[0] for s in remedies(file.read())
                if re.match("[`a-z-]", s)}


def main():
    said = set()
    for pattern in ["trainer/%s/**/*.c" % room for room in ROOMS] + [
            "trainer/cli/%s.c" % name for name in COMMANDS]:
        for path in glob.glob(pattern, recursive=True):
            said |= first_words(path)
    with open("docs/troubleshooting.md", encoding="utf-8") as file:
        table = file.read().partition("| the remedy begins with |")[2]
    told = set(", ".join(re.findall(r"^\| ([^|-][^|]*) \|", table,
                                    re.M)).split(", "))
    for word in sorted(said - told):
        print("docs/troubleshooting.md: no row for remedies with " + word)
    for word in sorted(told - said):
        print("docs/troubleshooting.md: no remedy begins with " + word)
    return said != told


sys.exit(main())
