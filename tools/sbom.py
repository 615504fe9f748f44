#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""sbom.py PROGRAM ...: prints a bill of materials (CycloneDX 1.5, JSON) of the
shared libraries that programs load on this machine: package, version, licence.

Versions are those of Debian's packages, licences those of the table "What is
linked" in docs/licences.md. Exit status 1: a library has no row there, or its
package is not known. The same libraries give the same bytes.
"""
import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# The name in docs/licences.md of each library, by its file's name.
ROWS = {
    "libOpenEXRCore-3_1": "OpenEXR", "libjansson": "jansson", "libpng16": "libpng",
    "libturbojpeg": "libjpeg-turbo", "libjpeg": "libjpeg-turbo", "libtiff": "libtiff",
    "libqrencode": "libqrencode",
    "libwebp": "libwebp", "libsharpyuv": "libwebp", "libzstd": "zstd",
    "liblzma": "liblzma", "libdeflate": "libdeflate", "libLerc": "LERC",
    "libjbig": "JBIG-KIT", "libstdc++": "libgcc",
    "libz": "zlib", "libgomp": "libgomp", "libgcc_s": "libgcc", "libm": "glibc",
    "libc": "glibc", "libpthread": "glibc", "ld-linux-x86-64": "glibc",
    "ld-linux-aarch64": "glibc",
}


def output(*command):
    return subprocess.run(command, check=True, text=True,
                          stdout=subprocess.PIPE).stdout


def libraries(programs):
    """Returns the paths of all shared libraries that the programs load."""
    found = set()
    for program in programs:
        found |= set(re.findall(r"(/\S+) \(0x", output("ldd", program)))
    return sorted(found)


def licences():
    """Returns the licence of each library of docs/licences.md."""
    page = (ROOT / "docs/licences.md").read_text("utf-8")
    rows = re.findall(r"^\| ([^|]*) \| `?saga`?[^|]* \| ([^|]*) \|", page, re.M)
    return {name: licence for names, licence in rows
            for name in re.findall(r"[\w-]+", names)}


def package(path):
    """Returns name and version of the package that a file belongs to."""
    for place in path, str(Path(path).resolve()), re.sub("^/usr", "", path):
        found = subprocess.run(["dpkg-query", "-S", place], text=True,
                               check=False, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL).stdout
        if found:
            name = found.split(": ")[0].split(",")[0]
            return name.split(":")[0], output("dpkg-query", "-W", "-f",
                                              "${Version}", name)
    sys.exit(f"sbom.py: no package has {path}")


def component(path, known):
    name = Path(path).name.split(".so")[0]
    row = ROWS.get(name)
    if row not in known:
        sys.exit(f"sbom.py: docs/licences.md has no row for {name}")
    debian, version = package(path)
    return debian, {
        "type": "library", "name": row, "version": version,
        "licenses": [{"license": {"name": known[row]}}],
        "purl": f"pkg:deb/debian/{debian}@{version}",
    }


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__.splitlines()[0])
    known = licences()
    parts = dict(component(path, known) for path in libraries(sys.argv[1:]))
    header = (ROOT / "decoder/saga.h").read_text("ascii")
    release = re.search(r'^#define SAGA_RELEASE "(.*)"', header, re.M).group(1)
    print(json.dumps({
        "bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
        "metadata": {"component": {
            "type": "application", "name": "saga", "version": release,
            "licenses": [{"license": {"id": "MIT"}}]}},
        # A row of the page may have several packages, of one version.
        "components": list({part["name"]: part for _, part in
                            sorted(parts.items(), reverse=True)}.values()),
    }, indent=1))


if __name__ == "__main__":
    main()
