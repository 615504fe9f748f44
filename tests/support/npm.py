# SPDX-License-Identifier: MIT
"""Packages of npm, in versions that the caller names. Each is fetched once for
a build folder; nothing is installed and no script of a package is run."""

import os
import shutil
import subprocess
import tarfile

FOLDER = os.path.join(os.environ.get("BUILD", "build"), "npm")


def is_there():
    return shutil.which("npm") is not None


def fetch(name, version, wanted):
    """Returns {path: bytes} of files of a package, or None if the registry
    cannot be reached."""
    path = os.path.join(FOLDER, "%s-%s.tgz" % (
        name.lstrip("@").replace("/", "-"), version))
    if not os.path.exists(path):
        os.makedirs(FOLDER, exist_ok=True)
        done = subprocess.run(
            ["npm", "pack", "%s@%s" % (name, version), "--silent",
             "--pack-destination", FOLDER], stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, timeout=300)
        if done.returncode:
            return None
    with tarfile.open(path) as tar:
        return {w: tar.extractfile("package/" + w).read() for w in wanted}
