#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_ksy.py: guarantees that docs/bitstream.ksy is what make_ksy.py prints,
and that the parser which Kaitai Struct generates from it finds in every good
vector, and in those that are cut, the values that film.py finds by the tables
of docs/bitstream.md. The
compiler comes from the registry of npm, once for a build folder; without npm,
node or the registry this part says that it was skipped."""
import json
import os
import re
import shutil
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, "stream"), os.path.join(HERE, "support")]
os.chdir(os.path.join(HERE, ".."))
import film  # noqa: E402
import make_ksy  # noqa: E402
import npm  # noqa: E402

PACKAGES = (
    ("kaitai-struct-compiler", "0.11.0", "kaitai-struct-compiler.js"),
    ("kaitai-struct", "0.11.0", "KaitaiStream.js"),
    ("js-yaml", "4.1.0", "dist/js-yaml.js"),
)
FOLDER = os.path.join(npm.FOLDER, "ksy")

# A program for node that compiles the description, reads each file and prints
# all values by their path.
PROGRAM = r"""
const fs = require("fs"), path = require("path");
const here = process.argv[2], vectors = process.argv.slice(3);
const compiler = require(path.join(here, "kaitai-struct-compiler.js"));
const yaml = require(path.join(here, "js-yaml.js"));
const KaitaiStream = require(path.join(here, "KaitaiStream.js"));
const parsed = ["header", "bank", "base", "cameras", "crc", "index", "nets",
                "base_chunks", "names", "exposures", "sound", "volume", "entries", "entry", "segment",
                "start", "fields", "layers", "chunks", "coarse", "fine",
                "prim"];

function camel(name) {
  return name.replace(/_(.)/g, (_, c) => c.toUpperCase());
}
function walk(value, at, out) {
  if (value === undefined || value === null || value instanceof Uint8Array)
    return;
  if (Array.isArray(value))
    value.forEach((v, i) => walk(v, `${at}[${i}]`, out));
  else if (typeof value === "object") {
    const names = new Set(Object.keys(value).filter((k) => k[0] !== "_"));
    for (const name of parsed)
      if (camel(name) in value)
        names.add(camel(name));
    for (const name of names)
      walk(value[name], at ? `${at}.${name}` : name, out);
  } else
    out[at] = Number(value);
}
(async () => {
  const text = fs.readFileSync("docs/bitstream.ksy", "utf8");
  const files = await compiler.compile("javascript", yaml.load(text), null,
                                       false);
  const generated = path.join(here, "Saga.js");
  fs.writeFileSync(generated, Object.values(files)[0]
    .replace(/kaitai-struct\/KaitaiStream/g, "./KaitaiStream"));
  const Saga = require(generated).Saga || require(generated);
  const all = {};
  for (const name of vectors) {
    // The buffer of a small file is a part of a larger one.
    const bytes = fs.readFileSync(name);
    const file = new Saga(new KaitaiStream(bytes.buffer.slice(
      bytes.byteOffset, bytes.byteOffset + bytes.length)));
    all[name] = {};
    walk(file, "", all[name]);
  }
  console.log(JSON.stringify(all));
})().catch((e) => { console.error(e); process.exit(1); });
"""


def check_text():
    with open("docs/bitstream.ksy") as f:
        if f.read() == make_ksy.text():
            print("ok   ksy: bitstream.ksy is what make_ksy.py prints")
            return 0
    print("FAIL ksy: bitstream.ksy is not what make_ksy.py prints (make ksy)")
    return 1


def fetch():
    os.makedirs(FOLDER, exist_ok=True)
    for name, version, path in PACKAGES:
        files = npm.fetch(name, version, (path,))
        if files is None:
            return False
        with open(os.path.join(FOLDER, os.path.basename(path)), "wb") as f:
            f.write(files[path])
    return True


def camel(name):
    first, *rest = name.split("_")
    return first + "".join(word.capitalize() for word in rest)


KINDS = {"COAR": "coarse", "FINE": "fine", "PRIM": "prim"}


def path_in_segment(number, parts):
    """Of SEGM's fields, those of a layer, and chunks, of layer 0 if there is
    no other."""
    layer = "0"
    if parts[0].startswith("layer"):
        layer = parts.pop(0)[len("layer"):]
        if len(parts) == 1:
            parts = [f"layers[{layer}]", *parts]
    if parts[0] in KINDS:
        parts = [f"chunks[{layer}]", KINDS[parts[0]], "start", parts[1]]
    elif parts[0] == "SEGM":
        parts = ["start", parts[1]]
    elif len(parts) == 1:
        parts = ["fields", *parts]
    return [f"index.entries[{number}].segment", *parts]


def path_of(name):
    """Returns the generated parser's path of a field of film.py."""
    parts = [camel(part) for part in name.split(".")]
    where = parts[0].rstrip("0123456789")
    number = parts[0][len(where):]
    if where == "camera":
        parts[0] = f"cameras[{number}]"
    elif where == "index":
        parts[0] = f"index.entries[{number}].entry"
    elif where == "segment":
        parts = path_in_segment(number, parts[1:])
    elif parts == ["header", "crc"]:
        parts = ["crc"]
    elif where in ("INDX", "NETS", "NAME", "EXPO", "OPUS", "VOLU"):
        parts[0] = {"INDX": "index", "NETS": "nets", "NAME": "names",
                    "EXPO": "exposures", "OPUS": "sound",
                    "VOLU": "volume"}[where] + ".start"
    elif where == "volume":
        parts[0] = "volume.fields"
    elif where == "exposure":
        parts[0] = f"exposures.cameras[{number}]"
    elif where == "base" and len(parts) == 3:
        parts = ["baseChunks", KINDS[parts[1]], "start", parts[2]]
    return ".".join(parts)


def differences(film_of, values):
    """Returns the fields whose values differ, and the number of fields
    compared."""
    found, n = [], 0
    for name, field in film_of.fields.items():
        path = path_of(name)
        # Texts have no number, and a single layer has no length.
        if name.endswith((".type", ".magic")) or (
                film_of.get("header.more_layers") == 0 and
                name.endswith(".layer0.nbytes")):
            continue
        for k in range(field.count):
            suffix = f"[{k}]" if field.count > 1 else ""
            want = film_of.get(name + suffix)
            if field.signed and want >> 8 * field.size - 1:
                want -= 1 << 8 * field.size
            n += 1
            if values.get(path + suffix) != want:
                found.append((name + suffix, want, values.get(path + suffix)))
    return found, n


# Files that are cut, with the file that they begin and their complete layers.
CUT = {f"vectors/cut/{name}.saga": ("vectors/good/layers_level0.saga", n)
       for name, n in (("layers_1", 1), ("layers_2", 2), ("layers_2_more", 2))}
# A file whose pictures are valid, and whose gains are outside their range.
REFUSED = ("coarsest_formats.saga",)


def whole_film(path):
    """Returns the film of a file. A cut one has no fields of the chunks of
    layers that are not complete."""
    whole, n_layers = CUT.get(path, (path, None))
    found = film.Film(*os.path.split(whole))
    for name in list(found.fields):
        layer = re.match(r"segment0\.layer(\d)\.[A-Z]", name)
        if n_layers and layer and int(layer[1]) >= n_layers:
            del found.fields[name]
    return found


def check_parser():
    paths = [f"{folder}/{name}"
             for folder in ("vectors/good", "vectors/v1-more/good")
             for name in sorted(os.listdir(folder))
             if name not in REFUSED] + list(CUT)
    program = os.path.join(FOLDER, "walk.js")
    with open(program, "w") as f:
        f.write(PROGRAM)
    done = subprocess.run(["node", program, os.path.abspath(FOLDER), *paths],
                          capture_output=True, text=True)
    if done.returncode:
        print("FAIL ksy: the generated parser:", done.stderr)
        return 1
    values, failed = json.loads(done.stdout), 0
    for path in paths:
        found, n = differences(whole_film(path), values[path])
        for field, want, got in found[:5]:
            print(f"     {field} is {want}, parsed {got}")
        print(f"{'FAIL' if found else 'ok  '} ksy {path}: {n} values")
        failed += bool(found)
    return failed


def main():
    failed = check_text()
    if not (npm.is_there() and shutil.which("node") and fetch()):
        print("ok   ksy: the generated parser was skipped: no npm or registry")
        return failed
    return failed + check_parser()


sys.exit(main() != 0)
