#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""wheel.py LIBRARY FOLDER: writes the Python module and the shared library as a
wheel into FOLDER, and prints its name. The same inputs give the same bytes.

A wheel's name promises on which systems its library loads. That holds if the
library needs nothing but a C library, and of that only old symbols; objdump
tells. A library that needs no other at all also loads where musl is the C
library."""

import base64
import hashlib
import os
import platform
import re
import subprocess
import sys
import zipfile

GLIBC = 2, 17           # of manylinux2014, which every pip of today takes
EPOCH = 1980, 1, 1, 0, 0, 0     # the first date of a zip file


def read(path):
    with open(path, "rb") as f:
        return f.read()


def platforms(library):
    """Returns the platform tags that the library may have. Exits with a message
    if it needs another library or too new a glibc."""
    told = subprocess.run(["objdump", "-pT", library], check=True, text=True,
                          stdout=subprocess.PIPE).stdout
    needed = set(re.findall(r"NEEDED +(\S+)", told))
    strange = sorted(needed - {"libc.so.6"})
    newest = max(((int(a), int(b)) for a, b in
                  re.findall(r"GLIBC_(\d+)\.(\d+)", told)), default=GLIBC)
    if strange or newest > GLIBC:
        sys.exit("wheel.py: %s needs %s" % (library, " ".join(
            strange or ["glibc %d.%d" % newest])))
    machine = platform.machine()
    tags = ["manylinux_%d_%d_%s" % (*GLIBC, machine)]
    # Weak symbols (w) may stay undefined.
    if not needed and not re.search(r"(?m)^\S+  [^w].* \*UND\*", told):
        tags.append("musllinux_1_1_" + machine)
    return tags


def metadata(release):
    return """Metadata-Version: 2.1
Name: saga
Version: %s
Summary: decoder of volumetric video, the same bits on every machine
License: MIT
Requires-Python: >=3.8
Provides-Extra: arrays
Requires-Dist: numpy; extra == "arrays"
Description-Content-Type: text/markdown

""" % release + read("ports/python/README.md").decode()


def record_line(name, data):
    digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest())
    return "%s,sha256=%s,%d\n" % (name, digest.rstrip(b"=").decode(),
                                  len(data))


def main(library, folder):
    release = re.search(r'^#define SAGA_RELEASE "(.*)"',
                        read("decoder/saga.h").decode(), re.M).group(1)
    tags = platforms(library)
    info = "saga-%s.dist-info/" % release
    files = {
        "saga.py": read("ports/python/saga.py"),
        "saga.libs/libsaga.so.0": read(library),
        info + "LICENSE": read("LICENSE"),
        info + "METADATA": metadata(release).encode(),
        info + "WHEEL": "".join(
            ["Wheel-Version: 1.0\nGenerator: saga\nRoot-Is-Purelib: false\n",
             *("Tag: py3-none-%s\n" % t for t in tags)]).encode(),
    }
    record = "".join(record_line(*f) for f in files.items())
    files[info + "RECORD"] = (record + info + "RECORD,,\n").encode()
    name = "saga-%s-py3-none-%s.whl" % (release, ".".join(tags))
    os.makedirs(folder, exist_ok=True)
    with zipfile.ZipFile(os.path.join(folder, name), "w") as wheel:
        for path, data in files.items():
            entry = zipfile.ZipInfo(path, EPOCH)
            entry.external_attr = 0o100644 << 16
            wheel.writestr(entry, data, zipfile.ZIP_DEFLATED)
    print(os.path.join(folder, name))


if len(sys.argv) != 3:
    sys.exit("wheel.py LIBRARY FOLDER")
main(*sys.argv[1:])
