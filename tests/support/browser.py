# SPDX-License-Identifier: MIT
"""A headless Chromium, driven through its debugging pipe, which needs no driver
and no package; and a file server that records which bytes were requested."""

import fcntl
import glob
import http.server
import json
import os
import re
import select
import shutil
import subprocess
import sys
import tempfile
import threading
import time

FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-extensions", "--disable-gpu", "--mute-audio",
    "--hide-scrollbars", "--disable-dev-shm-usage", "--remote-debugging-pipe",
]
# For pages that use WebGPU, which Chromium then computes itself. Without the
# three last ones it loses the device when a canvas is shown.
WEBGPU_FLAGS = [f for f in FLAGS if f != "--disable-gpu"] + [
    "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader",
    "--enable-unsafe-swiftshader", "--use-vulkan=swiftshader",
    "--enable-features=Vulkan", "--use-angle=swiftshader"]


def find_chromium():
    return shutil.which("chromium") or shutil.which("chromium-browser")


def stat_of(folder):
    """Returns the fields that follow the name of a process or thread in
    proc(5)."""
    with open(folder + "/stat") as f:
        return f.read().rsplit(")", 1)[1].split()


def wait_for(is_true, patience=60.0):
    until = time.monotonic() + patience
    while not is_true():
        if time.monotonic() > until:
            raise TimeoutError("never true")
        time.sleep(0.001)


class Browser:
    """A tab of the browser. Calls wait for their answer, and raise TimeoutError
    after `patience` seconds."""

    def __init__(self, patience=60.0, flags=FLAGS):
        self.patience = patience
        self.profile = tempfile.mkdtemp()
        self.last = 0
        self.buffer = b""
        self.log = []          # what the page threw or wrote to its console
        ours_in, theirs_out = os.pipe()
        theirs_in, ours_out = os.pipe()
        # Chromium reads commands from file descriptor 3 and writes answers to
        # 4.
        high = [fcntl.fcntl(fd, fcntl.F_DUPFD, 20)
                for fd in (theirs_in, theirs_out)]

        def place():
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        self.process = subprocess.Popen(
            [find_chromium(), *flags, "--user-data-dir=" + self.profile,
             "about:blank"], stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            preexec_fn=place, pass_fds=(3, 4))
        for fd in (theirs_in, theirs_out, *high):
            os.close(fd)
        self.ours_in, self.ours_out = ours_in, ours_out
        self.session = None
        tab = [t for t in self.call("Target.getTargets")["targetInfos"]
               if t["type"] == "page"][0]["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=tab,
                                 flatten=True)["sessionId"]
        for domain in ("Page", "Runtime"):
            self.call(domain + ".enable")

    def close(self):
        os.close(self.ours_out)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        os.close(self.ours_in)
        shutil.rmtree(self.profile, ignore_errors=True)

    def read_message(self, until):
        while b"\0" not in self.buffer:
            if not select.select([self.ours_in], [], [],
                                 max(0.0, until - time.monotonic()))[0]:
                raise TimeoutError("the browser does not answer")
            more = os.read(self.ours_in, 1 << 20)
            if not more:
                raise TimeoutError("the browser has ended")
            self.buffer += more
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **params):
        self.last += 1
        message = {"id": self.last, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.ours_out, json.dumps(message).encode() + b"\0")
        until = time.monotonic() + self.patience
        while True:
            reply = self.read_message(until)
            self.note(reply)
            if reply.get("id") == self.last:
                if "error" in reply:
                    raise RuntimeError(method + ": " + str(reply["error"]))
                return reply["result"]

    def note(self, event):
        params = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            self.log.append(str(params["exceptionDetails"]))
        elif event.get("method") == "Runtime.consoleAPICalled":
            self.log.append(str([a.get("value") for a in params["args"]]))

    def run(self, script):
        """Returns the value of a JavaScript expression. Promises are
        awaited."""
        reply = self.call("Runtime.evaluate", expression=script,
                          awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in reply:
            raise RuntimeError(str(reply["exceptionDetails"]))
        return reply["result"].get("value")

    def wait(self, script, tell=None):
        """Waits until an expression is true. If that never happens, the value
        of the expression `tell` is added to the error."""
        until = time.monotonic() + self.patience
        while not self.run(script):
            if time.monotonic() > until:
                raise TimeoutError("never true: %s; %s; console: %s" % (
                    script, tell and self.run(tell), self.log[-3:]))
            time.sleep(0.02)

    def go(self, url):
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete' && "
                  "location.href === " + json.dumps(url))

    def workers(self):
        """Yields what stat_of returns of each worker of our pages."""
        for task in glob.glob("/proc/[0-9]*/task/*"):
            try:
                with open(task + "/comm") as f:
                    if not f.read().startswith("DedicatedWorker"):
                        continue
                if self.is_ours(task.split("/")[2]):
                    yield stat_of(task)
            except OSError:
                pass # it has ended

    def n_workers(self):
        return sum(1 for _ in self.workers())

    def worker_seconds(self):
        """Returns the CPU time that the workers of our pages have used."""
        return sum(int(f[11]) + int(f[12]) for f in self.workers()) / \
            os.sysconf("SC_CLK_TCK")

    def is_ours(self, pid):
        while int(pid) > 1:
            if int(pid) == self.process.pid:
                return True
            pid = stat_of("/proc/" + pid)[1]
        return False

    def screenshot(self, path):
        import base64
        with open(path, "wb") as f:
            f.write(base64.b64decode(
                self.call("Page.captureScreenshot")["data"]))


class Valve:
    """Limits what a server sends: it may send as many bytes as were granted,
    and then waits for the next grant. `held` is the offset of the first byte
    of the answer that waits, or None."""

    def __init__(self):
        self.change = threading.Condition()
        self.left = 0
        self.held = None

    def grant(self, nbytes):
        """Grants this number of bytes, which replaces what is left of earlier
        grants."""
        with self.change:
            self.left, self.held = nbytes, None
            self.change.notify_all()

    def take(self, wanted, first):
        """Waits for a grant, and returns how many of the wanted bytes may be
        sent, at least one."""
        with self.change:
            while self.left <= 0:
                self.held = first
                self.change.wait()
            self.held = None
            n = min(self.left, wanted)
            self.left -= n
            return n


class FileServer(http.server.ThreadingHTTPServer):
    """Serves {path: bytes} on a port of its own; a number instead of bytes is the
    status of an error. `served` lists (path, first byte, number of bytes) of
    each request, `sent` what was sent. With
    ranges=False, only whole files are served; with share=True, pages of
    other servers may read them; headers are added to each answer. Files
    *.saga pass through `valve`, if there
    is one, one answer after the other."""

    TYPES = {".html": "text/html", ".js": "text/javascript",
             ".mjs": "text/javascript",
             ".css": "text/css", ".wasm": "application/wasm"}

    def __init__(self, files, ranges=True, share=False, headers={}):
        super().__init__(("127.0.0.1", 0), FileHandler)
        self.files = files
        self.ranges = ranges
        self.share = share
        self.headers = headers
        self.valve, self.line = None, threading.Lock()
        self.served, self.sent = [], []
        self.url = "http://127.0.0.1:%d/" % self.server_port
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def handle_error(self, *args):
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(*args) # else the page has gone on


class FileHandler(http.server.BaseHTTPRequestHandler):
    def do_HEAD(self):
        self.send_response(200)
        self.end_headers()

    def do_GET(self):
        path = self.path.split("?")[0].lstrip("/")
        data = self.server.files.get(path)
        first = 0
        if data is None or isinstance(data, int):
            self.send_error(data or 404)
            return
        n = len(data)
        asked = re.fullmatch(r"bytes=(\d+)-(\d+)",
                             self.headers.get("Range", ""))
        if asked and self.server.ranges:
            first = int(asked[1])
            if first >= n:
                self.send_error(416)
                return
            part = data[first:int(asked[2]) + 1]
            self.send_response(206)
            self.send_header("Content-Range", "bytes %d-%d/%d" % (
                first, first + len(part) - 1, n))
        else:
            part = data
            self.send_response(200)
        self.server.served.append((path, first, len(part)))
        self.send_header("Content-Type", self.server.TYPES.get(
            os.path.splitext(path)[1], "application/octet-stream"))
        self.send_header("Content-Length", str(len(part)))
        if self.server.share:
            self.send_header("Access-Control-Allow-Origin", "*")
            self.send_header("Access-Control-Expose-Headers", "Content-Range")
        for name, value in self.server.headers.items():
            self.send_header(name, value)
        self.end_headers()
        if path.endswith(".saga") and self.server.valve:
            self.write_slowly(path, first, part, self.server.valve)
        else:
            self.wfile.write(part)

    def write_slowly(self, path, first, part, valve):
        at = 0
        try:
            with self.server.line:
                while at < len(part):
                    n = valve.take(len(part) - at, first)
                    self.wfile.write(part[at:at + n])
                    at += n
            self.server.sent.append((path, first, len(part)))
        except ConnectionError:
            pass # the page has gone on

    def log_message(self, *args):
        pass
