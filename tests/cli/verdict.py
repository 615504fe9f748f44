# SPDX-License-Identifier: MIT
"""Checks in Python share this, as those in bash share verdict.sh: complaints
are collected, and a verdict prints them with one line "ok   CHECKS NAME" or
"FAIL CHECKS NAME"."""

import contextlib
import os
import resource
import signal
import subprocess
import sys

# Checks run in the root of the tree, on the programs that the caller names.
ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
os.chdir(ROOT)
for folder in ("support", "stream"):
    sys.path.insert(0, os.path.join(ROOT, "tests", folder))
BUILD = os.environ.get("BUILD", "build")
SAGA = os.environ.get("SAGA", BUILD + "/saga")
SAGA_DEC = os.environ.get("SAGA_DEC", BUILD + "/saga-dec")
WEB = os.path.join(os.path.dirname(SAGA), "web")


class Verdicts:
    def __init__(self, checks):
        self.checks = checks
        self.complaints = []
        self.failed = False

    def complain(self, *words):
        self.complaints.append(" ".join(str(w) for w in words))

    def verdict(self, name):
        for c in self.complaints:
            print("     " + c)
        print(("FAIL" if self.complaints else "ok  ") +
              " %s %s" % (self.checks, name), flush=True)
        self.failed = self.failed or bool(self.complaints)
        self.complaints.clear()

    def skips(self):
        """Returns whether pages cannot be shown; prints the reason."""
        import browser
        why = "no clang or no wasm-ld, so no decoder"
        if os.path.exists(os.path.join(WEB, "saga.wasm")):
            why = "" if browser.find_chromium() else "chromium is not installed"
        if why:
            print("ok   %s skipped: %s" % (self.checks, why))
        return bool(why)

    @contextlib.contextmanager
    def tab(self):
        """A tab of a browser, closed at the end. What its console said of
        faults is the last verdict."""
        import browser
        tab = browser.Browser()
        try:
            yield tab
            self.complaints.extend(tab.log)
            self.verdict("console")
        finally:
            tab.close()

    def run(self, *command, status=0, says="", env=None, disk=None):
        """Runs a program, which must end with this status and say this; if the
        status is not 0, its message must be one line. A file of more than
        `disk` bytes fails as on a full disk. Returns what it printed."""
        def limit():
            if disk is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (disk, disk))
        done = subprocess.run([*map(str, command)], env=env, timeout=600,
                              preexec_fn=limit, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE)
        text = done.stderr.decode()
        if done.returncode != status:
            self.complain(command, "ends with", done.returncode, "not", status,
                          text)
        elif says not in text or (status and text.count("\n") != 1):
            self.complain(command, "says", repr(text), "not", repr(says))
        return done.stdout.decode()


def python_module(build=os.path.dirname(SAGA)):
    """Returns ports/python, with the library of the build."""
    os.environ["SAGA_LIBRARY"] = os.path.abspath(build + "/libsaga.so.0")
    subprocess.run([os.environ.get("MAKE", "make"), "-s", "BUILD=" + build,
                    "CC=gcc", *(["WERROR=-Werror"] if build.endswith("/gcc")
                                else []), "shared"], check=True)
    sys.path.insert(0, "ports/python")
    import saga
    return saga


def read(path):
    with open(path, "rb") as f:
        return f.read()


def table_of_bytes():
    for crc in range(256):
        for _ in range(8):
            crc = crc >> 1 ^ (0x82f63b78 if crc & 1 else 0)
        yield crc


CRC32C = list(table_of_bytes())


def crc32c(crc, data):
    crc ^= 0xffffffff
    for byte in data:
        crc = crc >> 8 ^ CRC32C[(crc ^ byte) & 255]
    return crc ^ 0xffffffff


def pixels(path, kind="rgb24"):
    """Returns the samples of a picture, or of all pictures of a film or of a
    pattern of names."""
    return subprocess.run(["ffmpeg", "-v", "error", "-i", path, "-f",
                           "rawvideo", "-pix_fmt", kind, "-"], check=True,
                          stdout=subprocess.PIPE).stdout
