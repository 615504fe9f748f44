#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_desktop.py: guarantees, for the files of ports/desktop,
  type        the media type is that of docs/bitstream.md: good vectors have it
              by their contents alone, other files by the ending .saga
  entry       the menu entry is valid, is for that type, and its command opens
              the page of a file in the browser, which outlives the server and
              does not hold its port
  thumbnail   the command of the thumbnailer draws the camera's picture with the
              given longer side, for names with spaces and quotes and without
              an ending; of a file that is none it makes nothing
Without gio, update-mime-database or desktop-file-validate it prints what is
skipped."""

import glob
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request

from verdict import SAGA, WEB, Verdicts, read

PORT = "ports/desktop/"
checks = Verdicts("desktop")
complain, verdict = checks.complain, checks.verdict


def missing(*programs):
    without = [p for p in programs if not shutil.which(p)]
    if without:
        print("     skipped:", ", ".join(without), "cannot be had")
    return without


def value_of(name, key):
    return re.search("^%s=(.*)" % key, read(PORT + name).decode(), re.M)[1]


def check_type(tmp):
    if missing("gio", "update-mime-database"):
        return
    there = tmp + "/data/mime/packages"
    os.makedirs(there)
    shutil.copy(PORT + "saga.xml", there)
    known = {**os.environ, "XDG_DATA_HOME": tmp + "/data"}
    subprocess.run(["update-mime-database", tmp + "/data/mime"], env=known,
                   check=True, stdout=subprocess.DEVNULL)
    named = {"x.saga": b"\0\1\2\3", "text": b"SAGA of the Volsungs\n",
             "later": b"SAGA\2\0\0\0"}
    for path in glob.glob("vectors/good/*.saga")[:10]:
        named["film " + os.path.basename(path)[:-5]] = read(path)
    for name, data in named.items():
        with open(tmp + "/" + name, "wb") as f:
            f.write(data)
        told = subprocess.run(
            ["gio", "info", "-a", "standard::content-type", tmp + "/" + name],
            env=known, check=True, stdout=subprocess.PIPE).stdout.decode()
        if ("video/vnd.saga" in told) != name.startswith(("x.", "film")):
            complain(name, "is of the type", told.split()[-1])
    page = read("docs/bitstream.md").decode()
    if "media type of a `.saga` file is `video/vnd.saga`" not in page:
        complain("the page has another type")
    verdict("type")


def check_entry(tmp):
    if not missing("desktop-file-validate"):
        told = subprocess.run(["desktop-file-validate", PORT + "saga.desktop"],
                              stdout=subprocess.PIPE).stdout.decode()
        if told:
            complain(told)
    for name in "saga.desktop", "saga.thumbnailer":
        if value_of(name, "MimeType") != "video/vnd.saga;":
            complain(name, "is for", value_of(name, "MimeType"))
    if not os.path.exists(WEB + "/saga.wasm"):
        print("     skipped: this program has no page")
        return verdict("entry")
    # A browser that writes down what it is to show, and stays.
    told = tmp + "/told"
    with open(tmp + "/bin/xdg-open", "w") as f:
        f.write('#!/bin/sh\necho "$1 $$" >"%s"\nexec sleep 60\n' % told)
    os.chmod(tmp + "/bin/xdg-open", 0o755)
    command = value_of("saga.desktop", "Exec").replace(
        "%f", "vectors/good/still.saga")
    view = subprocess.Popen(["env", "--default-signal=INT",
                             *shlex.split(command)], env=with_saga(tmp),
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            start_new_session=True)
    url = view.stdout.readline().decode().strip()
    for _ in range(1000):
        if os.path.exists(told) and read(told).endswith(b"\n"):
            break
        time.sleep(0.01)
    shown, browser = read(told).decode().split()
    page = urllib.request.urlopen(url, timeout=20).read()
    if shown != url or b"film/still.saga" not in page:
        complain("the browser shows", shown, "for", url)
    # Ctrl-C in a terminal reaches the group of what it runs.
    if os.getpgid(int(browser)) == view.pid:
        complain("Ctrl-C ends the browser")
    view.send_signal(signal.SIGINT)
    view.wait(20)
    port = url.split(":")[2].strip("/")
    again = subprocess.Popen([SAGA, "view", "vectors/good/still.saga", "--port",
                              port], stdout=subprocess.PIPE)
    if again.stdout.readline().decode().strip() != url:
        complain("the browser holds the port")
    again.terminate()
    again.communicate()
    os.kill(int(browser), signal.SIGTERM)
    alone = subprocess.Popen([SAGA, "view", "vectors/good/still.saga",
                              "--open"], env={"PATH": tmp + "/none"},
                             stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    line = alone.stderr.readline().decode()
    if "xdg-open cannot be run" not in line or "open the address" not in line:
        complain("without xdg-open:", line)
    alone.terminate()
    if alone.wait(20):
        complain("without xdg-open it ends with", alone.returncode)
    checks.run(SAGA, "view", "vectors/good/still.saga", "--open", "--host",
               "127.0.0.2", status=2, says="--open and --host exclude")
    verdict("entry")


def with_saga(tmp):
    """Returns an environment in which `saga` is the program under test, and
    xdg-open the test's."""
    return {**os.environ, "PATH": tmp + "/bin:" + os.environ["PATH"]}


def thumbnail(tmp, film, to, side):
    """Runs the thumbnailer as file managers do: they split the command, and
    then put in the values."""
    values = {"%i": film, "%o": to, "%s": str(side)}
    command = [values.get(word, word) for word in
               shlex.split(value_of("saga.thumbnailer", "Exec"))]
    return subprocess.run(command, env=with_saga(tmp), stderr=subprocess.PIPE)


def check_thumbnail(tmp):
    film = tmp + "/a \"film\" of '$1.saga"
    shutil.copy("docs/demo.saga", film)
    # The cameras of the demo have 320 x 180 pixels.
    for side, size in (256, "256x144"), (64, "64x36"), (1, "1x1"):
        to = tmp + "/it's a thumb"
        made = thumbnail(tmp, film, to, side)
        subprocess.run([SAGA, "render", "docs/demo.saga", "--size", size, "-o",
                        tmp + "/want.png"], check=True)
        if made.returncode or read(to) != read(tmp + "/want.png"):
            complain("a thumbnail of", side, ":", made)
    os.remove(to)
    made = thumbnail(tmp, os.path.abspath("README.md"), to, 64)
    if made.returncode == 0 or [n for n in os.listdir(tmp) if "thumb" in n]:
        complain("a thumbnail of no film:", made)
    verdict("thumbnail")


def main():
    with tempfile.TemporaryDirectory() as tmp:
        os.mkdir(tmp + "/bin")
        os.symlink(os.path.abspath(SAGA), tmp + "/bin/saga")
        check_type(tmp)
        check_entry(tmp)
        check_thumbnail(tmp)
    return 1 if checks.failed else 0


sys.exit(main())
