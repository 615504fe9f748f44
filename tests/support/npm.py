# SPDX-License-Identifier: MIT
"""Fetches packages of npm in versions that the caller names, once for a build
folder. Nothing is installed, and no script of a package is run."""

import os
import shutil
import subprocess
import tarfile

FOLDER = os.path.join(os.environ.get("BUILD", "build"), "npm")


def is_there():
    return shutil.which("npm") is not None


def archive(name, version):
    """Returns the path of a package's archive, or None if the registry cannot be
    reached."""
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
    return path


def fetch(name, version, wanted):
    """Returns {path: bytes} of files of a package, or None if the registry
    cannot be reached."""
    path = archive(name, version)
    if path is None:
        return None
    with tarfile.open(path) as tar:
        return {w: tar.extractfile("package/" + w).read() for w in wanted}


def unpack(name, version, folder):
    """Puts all files of a package below folder/name. Returns False if the
    registry cannot be reached."""
    path = archive(name, version)
    if path is None:
        return False
    to = os.path.join(folder, name)
    with tarfile.open(path) as tar:
        for member in tar.getmembers():
            # The first folder of the archive may have any name.
            _, _, inside = member.name.partition("/")
            if member.isfile() and ".." not in inside.split("/"):
                at = os.path.join(to, inside)
                os.makedirs(os.path.dirname(at), exist_ok=True)
                with open(at, "wb") as f:
                    f.write(tar.extractfile(member).read())
    return True
