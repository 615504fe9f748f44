#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_view.py: guarantees, for the server of `saga view`,
  files       it serves the page, the page's modules and the film, completely or
              by ranges (RFC 9110, section 14), with their lengths and types,
              and nothing else
  refusals    it answers with an error, and continues, if a request has another
              method, names another host, has a path out of the folder, is
              invalid or does not end
  head        it answers HEAD with the header lines of GET and no body
  slow        while clients receive nothing of a large file, others are answered
              at once; Ctrl-C and SIGTERM end the server within a second; a slow
              client gets the complete file
  host        with --host it listens at that address alone, and serves the same
              files after a random token; without the token, with another one,
              or under another name nothing is served. On a terminal the address
              is also a QR code, as libqrencode makes it (a program without it
              draws none; make notices when it is installed). Addresses of other machines, and that of all
              networks, are refused
  port 80     it accepts a Host without a port (skipped, with a message, if the
              port is not available)
  checkpoint  for the checkpoint of a stopped training, from the warm-up on, it
              serves the file that the training would write now, without
              changing the training
  course      beside that film it serves the course of the training as far as
              it is, as text whose lines are whole
  finish      a POST of its own page, and of no other, lets the training stop
              and write a file of its present state; the checkpoint stays. It
              answers with a sentence if no training runs or the request cannot
              be written. A request to an earlier run does not count
  large       for a camera of 16,384 x 16,384 pixels it neither draws nor
              keeps a picture of that size
  command     the address is printed on stdout; Ctrl-C ends with status 0; a
              port in use and files that cannot be shown give a message of one
              line
check_web.py opens the page in a browser."""

import ctypes
import json
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

from verdict import SAGA, SAGA_DEC, WEB, Verdicts, pixels, read
import film  # noqa: E402  (verdict knows where)

GOOD = "vectors/good/still.saga"

checks = Verdicts("view")
complain, verdict = checks.complain, checks.verdict


class View:
    def __init__(self, *arguments):
        self.process = subprocess.Popen(
            ["env", "--default-signal=INT", SAGA, "view", *arguments],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.url = self.process.stdout.readline().decode().strip()
        found = re.fullmatch(r"http://([0-9.]+):(\d+)/(?:([0-9a-f]{32})/)?",
                             self.url)
        self.host, self.port, self.token = \
            (found[1], int(found[2]), found[3]) if found else ("", 0, None)

    def end(self, number=signal.SIGINT, timeout=20):
        self.process.send_signal(number)
        try:
            self.process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            complain("the server goes on", timeout, "s after signal", number)
            self.process.kill()
            self.process.communicate()
        return self.process.returncode

    def say(self, request):
        """Returns the whole answer: status, header lines in lower case,
        body."""
        with socket.create_connection((self.host, self.port), 20) as s:
            s.sendall(request)
            answer = b""
            while True:
                more = s.recv(1 << 20)
                if not more:
                    break
                answer += more
        head, _, body = answer.partition(b"\r\n\r\n")
        lines = head.decode().split("\r\n")
        return lines[0].partition(" ")[2], [x.lower() for x in lines[1:]], body

    def get(self, path, *lines, method="GET", host=None):
        host = host or "%s:%d" % (self.host, self.port)
        text = "\r\n".join(["%s %s HTTP/1.1" % (method, path),
                            "Host: " + host, *lines, "", ""])
        return self.say(text.encode())


def check_files(view):
    status, lines, body = view.get("/?camera=1")
    page = read(WEB + "/index.html").decode()
    parts = page.split('{ "src": null, "pictures": [] }')
    if len(parts) != 2:
        complain("index.html has no place for what it carries")
    text = body.decode()
    if status != "200 OK" or not text.startswith(parts[0]) or \
            not text.endswith(parts[-1]):
        complain("the page:", status, text[:80])
        return
    carried = json.loads(text[len(parts[0]):-len(parts[-1])])
    if [p["camera"] for p in carried["pictures"]] != [0, 1, 2]:
        complain("the page carries", carried)
    for name in os.listdir(WEB):
        wanted = name.endswith((".html", ".js", ".css", ".wasm"))
        status, lines, body = view.get("/" + name)
        if wanted and (status != "200 OK" or body != read(WEB + "/" + name)):
            complain(name, status, len(body), "bytes")
        if name.endswith(".js") and "content-type: text/javascript" not in \
                lines:
            complain(name, "has the type", lines)
    check_parts(view, "/" + carried["src"], read(GOOD))


def check_parts(view, path, data):
    n = len(data)
    for asked, first, end in (
            (None, 0, 0), ("bytes=0-0", 0, 1), ("bytes=5-9", 5, 10),
            ("bytes=%d-" % (n - 3), n - 3, n), ("bytes=-4", n - 4, n),
            ("bytes=-%d" % (2 * n), 0, n), ("bytes=7-99999999999999999999", 7,
                                            n),
            ("bytes=9-5", 0, 0), ("bytes=0-1,3-4", 0, 0), ("lines=1-2", 0, 0),
            ("bytes=-", 0, 0), ("bytes=a-b", 0, 0)):
        status, lines, body = view.get(
            path, *(["Range: " + asked] if asked else []))
        part = data[first:end] if end else data
        want = "206 Partial Content" if end else "200 OK"
        place = "content-range: bytes %d-%d/%d" % (first, end - 1, n)
        if status != want or body != part or \
                "content-length: %d" % len(part) not in lines or \
                (place in lines) != (end > 0):
            complain(asked, status, lines, len(body), "bytes")
    for asked in ("bytes=%d-" % n, "bytes=-0"):
        status, _, _ = view.get(path, "Range: " + asked)
        if status != "416 Range Not Satisfiable":
            complain(asked, status)


def check_refusals(view):
    for want, arguments in (
            ("404", {"path": "/none.js"}), ("404", {"path": "/film/"}),
            ("404", {"path": "/../" + GOOD}), ("404", {"path": "//"}),
            ("405", {"path": "/", "method": "POST"}),
            ("404", {"path": "/none.js", "method": "HEAD"}),
            ("403", {"path": "/", "host": "127.0.0.1"}),
            ("403", {"path": "/", "host": "127.0.0.10:%d" % view.port}),
            ("403", {"path": "/", "host": "example.org"}),
            ("403", {"path": "/", "host": "127.0.0.1:1"}),
            ("400", {"path": "index.html"}), ("400", {"path": ""})):
        status, _, _ = view.get(**arguments)
        if not status.startswith(want):
            complain(arguments, status, "not", want)
    if not view.get("/", host="localhost:%d" % view.port)[0] == "200 OK":
        complain("localhost is refused")
    for request, want in ((b"\r\n\r\n", "405"), (b"GET\r\n\r\n", "405"),
                          (b"GET /\r\n\r\n", "40"),
                          (b"GET / HTTP/1.1\r\n\r\n", "403"),
                          (b"GET /" + 9000 * b"a", "431")):
        if not view.say(request)[0].startswith(want):
            complain(request[:20], "is not answered", want)
    # Browsers open connections in advance and send nothing on them.
    idle = [socket.create_connection(("127.0.0.1", view.port))
            for _ in range(40)]
    idle[-1].sendall(b"GET / HT")
    if view.get("/page.js")[0] != "200 OK":
        complain("silent connections block the server")
    for s in idle:
        s.close()
    verdict("refusals")


def check_head(view):
    """HEAD must answer like GET without a body and, by RFC 9110, section 14.2,
    must ignore a range."""
    for path in "/", "/page.js", "/film/still.saga", "/none.js":
        status, lines, body = view.get(path)
        head = view.get(path, "Range: bytes=0-4", method="HEAD")
        if head != (status, lines, b""):
            complain("HEAD", path, head, "not", status, lines)
    if "allow: get, head" not in view.get("/", method="PUT")[1]:
        complain("405 does not say what is allowed")
    verdict("head")


class SlowClient:
    """A client that requests a path and reads nothing of the answer at
    first."""
    def __init__(self, view, path):
        self.socket = socket.socket()
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.socket.connect(("127.0.0.1", view.port))
        self.socket.sendall(b"GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n\r\n"
                            % (path.encode(), view.port))

    def take(self):
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        answer = b""
        while True:
            more = self.socket.recv(1 << 16)
            if not more:
                return answer.partition(b"\r\n\r\n")[2]
            answer += more


def check_slow(tmp):
    """Checks a file that is larger than any socket buffer."""
    big = tmp + "/big.saga"
    subprocess.run([SAGA, "join", *160 * ["docs/demo.saga"], "-o", big],
                   check=True, stdout=subprocess.DEVNULL)
    for number in signal.SIGINT, signal.SIGTERM:
        view = View(big)
        slow = [SlowClient(view, "/film/big.saga") for _ in range(3)]
        time.sleep(0.2)
        start = time.monotonic()
        try:
            if view.get("/page.js")[0] != "200 OK":
                complain("no answer beside slow clients")
        except OSError as e:
            complain("no answer beside slow clients:", e)
        if time.monotonic() - start > 1:
            complain("slow clients hold others up for %.1f s" %
                     (time.monotonic() - start))
        if number == signal.SIGINT and slow[1].take() != read(big):
            complain("a slow client gets another file")
        if view.end(number, 1) != 0:
            complain("signal", number, "ends with", view.process.returncode)
        for s in slow:
            s.socket.close()
    verdict("slow")


def draw_code(text):
    """Returns what a terminal shows for a QR code of libqrencode, or "" for a
    program without it: white where a module is light, with four light ones around."""
    class Code(ctypes.Structure):
        _fields_ = [("version", ctypes.c_int), ("width", ctypes.c_int),
                    ("data", ctypes.POINTER(ctypes.c_ubyte))]
    if b"libqrencode.so.4" not in read(SAGA):
        return ""
    library = ctypes.CDLL("libqrencode.so.4")
    library.QRcode_encodeString8bit.restype = ctypes.POINTER(Code)
    code = library.QRcode_encodeString8bit(text.encode(), 0, 0).contents
    n = code.width + 8

    def light(x, y):
        inside = 4 <= x < n - 4 and 4 <= y < n - 4
        return not (inside and
                    code.data[(y - 4) * code.width + x - 4] & 1)
    return "".join("\033[97;40m%s\033[0m\r\n" % "".join(
        " \u2584\u2580\u2588"[2 * light(x, y) + light(x, y + 1)]
        for x in range(n)) for y in range(0, n, 2))


def check_code():
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [SAGA, "view", GOOD, "--host", "127.0.0.2"], stdout=subprocess.PIPE,
        stderr=slave)
    os.close(slave)
    url = process.stdout.readline().decode().strip()
    told = b""
    while b"HTTPS" not in told:
        told += os.read(master, 1 << 16)
    process.terminate()
    process.communicate(timeout=20)
    os.close(master)
    code = told.decode().partition("saga:")[0]
    if code != draw_code(url):
        complain("the code of", url, "is\n" + code)


def compiled(*words):
    """Returns what make would compile for the program."""
    build = os.path.dirname(SAGA)
    done = subprocess.run(
        [os.environ.get("MAKE", "make"), "-n", "BUILD=" + build, "CC=gcc",
         *(["WERROR=-Werror"] if build.endswith("/gcc") else []), SAGA, *words],
        stdout=subprocess.PIPE, check=True, text=True,
        env=dict(os.environ, MAKEFLAGS=""))
    return set(re.findall(r"-c (trainer/\S+\.c)", done.stdout))


def check_library():
    """If libqrencode is installed or removed, the code is compiled again, and
    nothing else."""
    before = compiled()
    again = compiled("QR=-lanother") - before
    if again != {"trainer/cli/view_code.c"} - before:
        complain("another libqrencode lets make compile", sorted(again))


def check_host():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        free = s.getsockname()[1]
    one = View(GOOD, "--host", "127.0.0.2", "--port", str(free))
    other = View(GOOD, "--host", "127.0.0.2")
    if one.host != "127.0.0.2" or not one.token or one.token == other.token:
        complain("the addresses are", one.url, "and", other.url)
    token = one.token or ""
    for name in ("", "page.js", "whole.html", "film/still.saga"):
        status, _, body = one.get("/%s/%s" % (token, name))
        want = read(GOOD if "film" in name else WEB + "/" + name) if name else \
            body
        if status != "200 OK" or body != want or not body:
            complain("after the token,", name, ":", status)
        for path in (name, other.token + "/" + name, token + name,
                     token[:-1] + "0/" + name if token[-1:] != "0" else
                     token[:-1] + "1/" + name, "x/%s/%s" % (token, name),
                     "?%s/%s" % (token, name), token.upper() + "/x" + name,
                     token + "//" + name):
            status, _, body = one.get("/" + path)
            if status != "404 Not Found" or len(body) > 20:
                complain("without the token,", path, ":", status)
    for host in ("127.0.0.1", "localhost", "example.org", "0.0.0.0"):
        status = one.get("/%s/" % token, host="%s:%d" % (host, one.port))[0]
        if not status.startswith("403"):
            complain("as", host, ":", status)
    try:
        socket.create_connection(("127.0.0.1", one.port), 5).close()
        complain("--host listens on 127.0.0.1, too")
    except ConnectionRefusedError:
        pass
    for view in one, other:
        view.end()
    for host in ("0.0.0.0", "192.0.2.1", "localhost", "::1", "256.1.1.1"):
        refused([GOOD, "--host", host], 2, host + ": is no IPv4 address of this "
                "machine; give one of 127.0.0.1")
    check_code()
    check_library()
    verdict("host")


def check_port_80():
    with socket.socket() as s:
        s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            s.bind(("127.0.0.1", 80))
        except OSError as e:
            print("     skipped: port 80 cannot be had:", e.strerror)
            return
    view = View(GOOD, "--port", "80")
    for host, want in (("127.0.0.1", "200"), ("localhost", "200"),
                       ("127.0.0.1:80", "200"), ("example.org", "403"),
                       ("127.0.0.1:81", "403"), ("127.0.0.1.org", "403")):
        status = view.get("/", host=host)[0]
        if not status.startswith(want):
            complain("at port 80, host", host, ":", status)
    view.end()
    verdict("port 80")


def refused(arguments, status, says):
    if checks.run(SAGA, "view", *arguments, status=status, says=says):
        complain(arguments, "prints")


def encode(tmp, until, *options):
    """Starts a training that is stopped after `until` iterations."""
    log = tmp + "/log.csv"
    if os.path.exists(log):
        os.remove(log)
    process = subprocess.Popen(
        ["env", "--default-signal=INT", SAGA, "encode", tmp + "/cap", "-o",
         tmp + "/x.saga", "--primitives", "150", "--iterations", "3000",
         "--ablate", "no-teachers", "--log", log, *options], stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE)
    while process.poll() is None and until:
        lines = read(log).split() if os.path.exists(log) else []
        if len(lines) > 1 and int(lines[-1].split(b",")[0] or 0) >= until:
            process.send_signal(signal.SIGINT)
            break
        time.sleep(0.01)
    text = process.communicate(timeout=100)[1].decode()
    if process.returncode != (2 if until else 0):
        complain("encode ends with", process.returncode, text)


def error_of(tmp, name):
    """Returns the mean squared error of a training picture, and that of the
    picture's mean, which is far above the error of a training that works."""
    out = tmp + "/x.ppm"
    subprocess.run([SAGA_DEC, name, "--camera", "rig:0", "--time", "1", "-o",
                    out], check=True)
    got = re.sub(rb"^P6\n\d+ \d+\n255\n", b"", read(out), count=1)
    want = pixels(tmp + "/cap/images/cam00/00001.png")
    mean = sum(want) / len(want)
    return (sum((x - y) ** 2 for x, y in zip(got, want)) / len(want),
            sum((mean - y) ** 2 for y in want) / len(want))


def check_shown(tmp, checkpoint):
    before = read(checkpoint)
    view = View(checkpoint)
    if not view.port:
        complain("the address is", view.url)
        return
    film = view.get("/film/x.saga.ckpt")[2]
    text = view.get("/")[2].decode()
    view.end()
    with open(tmp + "/now.saga", "wb") as f:
        f.write(film)
    told = json.loads(re.search(r'"pictures":(\[.*?\])', text)[1])
    for p in told:
        crc = subprocess.run(
            [SAGA_DEC, tmp + "/now.saga", "--camera", "rig:%d" % p["camera"],
             "--time", "0", "--crc"], check=True, stdout=subprocess.PIPE)
        if p["crc"] not in crc.stdout.decode():
            complain("camera", p["camera"], "has another picture")
    if len(told) != 4 or read(checkpoint) != before:
        complain("the page carries", told, "or the checkpoint has changed")


def check_checkpoint(tmp):
    subprocess.run([SAGA, "synth", tmp + "/cap", "--size", "64x36",
                    "--cameras", "4", "--hold-out", "1", "--frames", "4",
                    "--points", "300", "--depth-every", "0"], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    checkpoint = tmp + "/x.saga.ckpt"
    encode(tmp, 10) # the warm-up has begun
    check_shown(tmp, checkpoint)
    with open(checkpoint + ".finish", "w"):
        pass # a request to the run before does not end this one
    encode(tmp, 2500, "--resume")
    if os.path.exists(checkpoint + ".finish"):
        complain("a request remains")
    check_shown(tmp, checkpoint)
    encode(tmp, 0, "--resume")
    now, flat = error_of(tmp, tmp + "/now.saga")
    if not 0 < now < flat / 4:
        complain("the squared error is", now, "at the checkpoint,", flat,
                 "of one colour")
    verdict("checkpoint")


def train_on(tmp):
    """Starts a training that takes far longer than the test; returns it once
    it can be viewed."""
    process = subprocess.Popen(
        [SAGA, "encode", tmp + "/cap", "-o", tmp + "/y.saga", "--primitives",
         "150", "--iterations", "1000000", "--ablate", "no-teachers",
         "--checkpoint-every", "0"],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    while process.poll() is None and not (
            os.path.exists(tmp + "/y.saga.ckpt") and
            read(tmp + "/y.saga.ckpt.csv").count(b"\n") > 3):
        time.sleep(0.01)
    return process


def check_course(view):
    status, lines, body = view.get("/course.csv")
    rows = body.decode().split("\n")
    if status != "200 OK" or "content-type: text/csv" not in lines or \
            rows[0] != "iteration,stage,psnr,bits,seconds":
        complain("the course is", status, rows[:2])
        return
    told = [re.fullmatch(r"(\d+),warm-up,([\d.]+),0,([\d.]+)", row)
            for row in rows[1:-1]]
    if not all(told) or any(int(b[1]) - int(a[1]) < 10 or
                            float(b[3]) < float(a[3])
                            for a, b in zip(told, told[1:])):
        complain("the course is", rows)
    while view.get("/course.csv")[2] == body:
        time.sleep(0.01)
    verdict("course")


def check_finish(tmp):
    process = train_on(tmp)
    request = tmp + "/y.saga.ckpt.finish"
    view = View(tmp + "/y.saga.ckpt")
    shared = View(tmp + "/y.saga.ckpt", "--host", "127.0.0.2")
    ours = "Origin: http://127.0.0.1:%d" % view.port

    def post(*lines, path="/finish", at=view):
        status, _, body = at.get(path, *lines, method="POST")
        return status, body.decode()

    check_course(view)
    for want, answer in (
            ("403", post()), ("403", post("Origin: null")),
            ("403", post("Origin: http://example.org")),
            ("403", post("Origin: http://127.0.0.1:1")),
            ("403", post(ours.replace("http", "https"))),
            ("405", post(ours, path="/")),
            ("405", post(ours, path="/course.csv")),
            ("404", post("Origin: http://127.0.0.2:%d" % shared.port,
                         at=shared)),
            ("404", view.get("/finish"))):
        if not answer[0].startswith(want):
            complain("a request to finish:", answer, "not", want)
    os.mkdir(request)
    status, told = post(ours)
    if not status.startswith("409") or "y.saga.ckpt.finish" not in told:
        complain("a request that cannot be written:", status, told)
    os.rmdir(request)
    if process.poll() is not None:
        complain("the training has ended", process.stderr.read())
    if post(ours)[0] != "202 Accepted":
        complain("the page cannot ask")
    text = process.communicate(timeout=60)[1].decode()
    if process.returncode or "y.saga has what was trained so far" not in text:
        complain("the training ends with", process.returncode, text)
    now, flat = error_of(tmp, tmp + "/y.saga")
    if not 0 < now < flat:
        complain("the squared error is", now, "at the request,", flat,
                 "of one colour")
    status, told = post(ours)
    if not status.startswith("409") or "is not in training" not in told or \
            "--resume" not in told:
        complain("after the end:", status, told)
    if sorted(n for n in os.listdir(tmp) if n.startswith("y.")) != \
            ["y.saga", "y.saga.ckpt", "y.saga.ckpt.csv"]:
        complain("it leaves", os.listdir(tmp))
    view.end()
    shared.end()
    verdict("finish")


def make_large(path):
    """Writes a film whose cameras have the largest size."""
    edit = film.Edit(film.Film("vectors", "good/still.saga"))
    for i in range(edit.film.get("header.n_cameras")):
        edit.set("camera%d.width" % i, 16384).set("camera%d.height" % i, 16384)
    with open(path, "wb") as f:
        f.write(edit.whole())


def check_large(tmp):
    make_large(tmp + "/large.saga")
    view = View(tmp + "/large.saga")
    text = view.get("/")[2].decode()
    peak = int(re.search(r"VmHWM:\s*(\d+)", open(
        "/proc/%d/status" % view.process.pid).read())[1])
    view.end()
    if '"pictures":[]' not in text or peak > 200000:
        complain("a large camera takes", peak, "kB;",
                 re.findall(r'"pictures":.*?\]', text))
    verdict("large: %d MB" % (peak // 1000))


def check_command(view):
    refused([GOOD, "--port", str(view.port)], 2, "give another --port")
    refused(["none.saga"], 2, "none.saga: cannot be opened")
    refused(["vectors/bad/crc_segment.saga"], 1, "crc_segment.saga: ")
    refused(["README.md"], 1, "README.md: ")
    refused([GOOD, "--port", "0"], 2, "--port takes N, 1 to 65535")
    with tempfile.TemporaryDirectory() as tmp:
        name = tmp + "/a b%\u00e4\"<.saga"
        with open(name, "wb") as f:
            f.write(read(GOOD))
        other = View(name)
        text = other.get("/")[2].decode()
        src = re.search(r'"src":"(film/[^"]*)"', text)
        if not src or src[1] != "film/a%20b%25%C3%A4%22%3C.saga" or \
                other.get("/" + src[1])[2] != read(GOOD):
            complain("a strange name:", src and src[1])
        if other.end(signal.SIGTERM) != 0:
            complain("SIGTERM ends with", other.process.returncode)
    if view.end() != 0:
        complain("Ctrl-C ends with", view.process.returncode)
    verdict("command")


def main():
    if not os.path.exists(WEB + "/saga.wasm"):
        refused([GOOD], 2, "install clang and lld")
        verdict("without a decoder for browsers it says what is missing")
        return 1 if checks.failed else 0
    view = View(GOOD)
    if view.host != "127.0.0.1" or view.token:
        complain("the address is", view.url)
    else:
        check_files(view)
    verdict("files")
    check_refusals(view)
    check_head(view)
    check_host()
    check_port_80()
    with tempfile.TemporaryDirectory() as tmp:
        check_slow(tmp)
        check_large(tmp)
        check_checkpoint(tmp)
        check_finish(tmp)
    check_command(view)
    return 1 if checks.failed else 0


sys.exit(main())
