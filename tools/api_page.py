#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""api_page.py [PAGE]: writes docs/api.md from the sources of the libraries:
the declarations and comments of ports/*/*.d.ts, and the names and docstrings of
ports/python/saga.py. `make test` compares the page with them.
"""
import inspect
import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# The modules in the order of the page, as programs import them.
MODULES = (
    ("saga-web", "web/saga.d.ts"),
    ("saga-web/player.js", "web/player.d.ts"),
    ("saga-web/viewer.js", "web/viewer.d.ts"),
    ("saga-web/controls.js", "web/controls.d.ts"),
    ("saga-web/xr.js", "web/xr.d.ts"),
    ("saga-web/volume.js", "web/volume.d.ts"),
    ("saga-web/places.js", "web/places.d.ts"),
    ("saga-web/gpu.js", "web/gpu.d.ts"),
    ("saga-web/engine.js", "web/engine.d.ts"),
    ("saga-three", "three/saga_three.d.ts"),
    ("saga-three/spark.js", "three/saga_spark.d.ts"),
    ("saga-three/splats.js", "three/saga_splats.d.ts"),
    ("saga-playcanvas", "playcanvas/saga_playcanvas.d.ts"),
    ("saga-playcanvas/gsplat.js", "playcanvas/saga_gsplat.d.ts"),
)

COMMENT = re.compile(r"/\*\*(.*?)\*/", re.S)

HEAD = """# The libraries' reference

Every name that the JavaScript modules and the Python module export, with the
comments of their sources. `tools/api_page.py` makes this page from
`ports/*/*.d.ts` and `ports/python/saga.py`. [embed.md](embed.md) and
[ports/python](../ports/python/README.md) show how to begin; the C library's
reference is [saga.h](../decoder/saga.h).
"""


def plain(comment):
    """A comment without its stars, in one line of Markdown."""
    line = " ".join(re.sub(r"^\s*\*", "", comment, flags=re.M).split())
    return line.replace("<", "&lt;")


def declarations(text):
    """Returns (comment, declaration) for each declaration of a .d.ts text, or
    of the body of one. A declaration ends at a `;` or a block outside of
    brackets."""
    found, comment, start, depth, at = [], "", None, 0, 0
    while at < len(text):
        c = text[at]
        skipped = COMMENT.match(text, at)
        if skipped:
            if start is None:
                comment = plain(skipped.group(1))
            at = skipped.end()
            continue
        if start is None and not c.isspace():
            start = at
        depth += (c in "({[") - (c in ")}]")
        at += 1
        block = c == "}" and not re.match(r"\s*[;,)>\[|]", text[at:])
        if start is not None and depth == 0 and (c == ";" or block):
            found.append((comment, text[start:at].rstrip(";")))
            start, comment = None, ""
    return found


def cell(signature, comment):
    """A row of a table. Comments within the signature follow the main one."""
    for inner in re.finditer(COMMENT.pattern + r"\s*(?:readonly )?(\w+)",
                             signature, re.S):
        comment += f" `{inner.group(2)}`: {plain(inner.group(1))}"
    signature = " ".join(COMMENT.sub("", signature).split())
    signature = re.sub(r"([({]) ", r"\1", signature)
    signature = re.sub(r"[;,]? ([)}])", r"\1", signature)
    signature = signature.replace("|", "\\|")
    return f"| `{signature}` | {comment.strip()} |".replace("|  |", "| |")


def table(rows):
    return ["", "| | |", "|---|---|"] + rows if rows else []


def paragraph(text):
    return ["", textwrap.fill(text, 80, break_long_words=False,
                              break_on_hyphens=False)] if text else []


def javascript(name, path):
    """The lines of a module: functions and constants in a table, then each
    class and interface with its members."""
    text = (ROOT / "ports" / path).read_text(encoding="utf-8")
    text = re.sub(r"^// .*\n|^import [^;]*;\n", "", text, flags=re.M)
    plain_ones, classes = [], []
    for comment, code in declarations(text):
        kind = re.match(r"export (class|interface) ([^{]*?)\s*{(.*)}$", code,
                        re.S)
        if kind:
            rows = [cell(member, said)
                    for said, member in declarations(kind.group(3))]
            heading = f"`{' '.join(kind.group(2).split())}`"
            classes += ["", f"### {heading}, {kind.group(1)}"]
            classes += paragraph(comment) + table(rows)
        elif code.startswith("export "):
            plain_ones.append(cell(code.removeprefix("export "), comment))
    return ["", f"## {name}"] + table(plain_ones) + classes


def members(thing):
    """The rows of a Python class: its methods and properties."""
    rows = []
    for name, member in vars(thing).items():
        if name.startswith("_"):
            continue
        if isinstance(member, property):
            rows.append(cell(name, plain(inspect.getdoc(member) or "")))
        elif inspect.isfunction(member):
            rows.append(cell(call(name, member),
                             plain(inspect.getdoc(member) or "")))
    return rows


def call(name, function):
    given = [str(p) for p in inspect.signature(function).parameters.values()
             if p.name != "self"]
    return f"{name}({', '.join(given)})"


def python():
    """The lines of the Python module."""
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(ROOT / "ports/python"))
    import saga  # the source, without its library
    about, code, rest = re.split(r"\n\n(    .*?)\n\n", inspect.getdoc(saga),
                                 maxsplit=1, flags=re.S)
    lines = ["", "## Python: saga"]
    for text in about.split("\n\n"):
        lines += paragraph(" ".join(text.split()))
    lines += ["", code] + paragraph(" ".join(rest.split()))
    things = [getattr(saga, name) for name in saga.__all__]
    lines += table([cell(call(f.__name__, f), plain(inspect.getdoc(f)))
                    for f in things if inspect.isfunction(f)])
    for thing in filter(inspect.isclass, things):
        lines += ["", f"### `{thing.__name__}`"]
        lines += paragraph(plain(inspect.getdoc(thing)))
        fields = getattr(thing, "_fields_", None) or [
            (field, None) for field in getattr(thing, "_fields", ())]
        if fields:
            lines += paragraph("Fields: " + ", ".join(
                f"`{f[0]}`" + (f" ({f[1]._length_})"
                               if hasattr(f[1], "_length_") else "")
                for f in fields) + ".")
        if not hasattr(thing, "_field_defaults"):  # no named tuple
            lines += table(members(thing))
    return lines


def main():
    lines = [HEAD.rstrip()]
    unknown = {str(p.relative_to(ROOT / "ports"))
               for p in ROOT.glob("ports/*/*.d.ts")} - {p for _, p in MODULES}
    if unknown:
        sys.exit(f"tools/api_page.py: MODULES has no {', '.join(unknown)}")
    for name, path in MODULES:
        lines += javascript(name, path)
    lines += python()
    page = Path(sys.argv[1] if sys.argv[1:] else ROOT / "docs/api.md")
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
