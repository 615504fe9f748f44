#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_report.py: guarantees, for the page of `saga report`,

  page        the page loads nothing from elsewhere; it contains the results and
              the bytes of the pictures; a name with HTML in it is escaped
  jpeg        pictures that were converted to JPEG are labelled as JPEGs
  foreign     files that are not pictures, or that lie outside of the results'
              folder, even by links and `..`, are not put into the page
  refused     results of another protocol, missing files, and a page that cannot
              be written are errors; no incomplete page remains
  browser     headless Chromium draws a curve for each file with a point for
              each result, a plot for each view, a bar for each file, and
              pictures; for a single result of many views it draws one plot with
              a row for each view, no plot of a single point, and no metric that
              was not measured; without Chromium it prints that this is skipped

SAGA=... is the program (build/saga).
"""
import base64
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from verdict import Verdicts, read  # noqa: E402

SAGA = os.path.abspath(os.environ.get("SAGA", "build/saga"))
GOOD = os.path.abspath("vectors/good/motion.saga")
v = Verdicts("report")


def run(*words):
    return subprocess.run([SAGA, *words], capture_output=True, text=True)


def must(*words):
    r = run(*words)
    if r.returncode:
        sys.exit(f"FAIL report: saga {' '.join(words)}: {r.stderr}")
    return r.stdout


def write(name, *results):
    with open(name, "w") as f:
        f.write("\n".join(json.dumps(r) for r in results))
    return name


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page,
                                re.S).group(1))


def make_results():
    """Makes two files of results: one with pictures in each of four sizes, and
    one whose file and camera have hostile names."""
    must("synth", "cap", "--size", "64x40", "--cameras", "3", "--hold-out",
         "1", "--frames", "2", "--depth-every", "0")
    must("encode", "cap", "-o", "x.saga", "--primitives", "100",
         "--iterations", "60")
    result = json.loads(must("eval", "x.saga", "cap", "--json", "--pictures",
                             "pictures"))
    curve = []
    for i in range(4):
        one = json.loads(json.dumps(result))
        one["nbytes"] += 1000 * i
        for view in one["views"]:
            view["psnr"] += i
        if i:
            for view in one["views"]:
                del view["picture"]
        curve.append(one)
    write("first.json", *curve)
    result["file"] = "</script><b id='evil'>"
    for view in result["views"]:
        del view["picture"]
    write("second.json", result)


def check_page():
    r = run("report", "first.json", "second.json", "-o", "page.html")
    if r.returncode or r.stdout or r.stderr:
        return v.complain("report:", r.returncode, r.stderr)
    page = read("page.html").decode()
    without = page.replace("http://www.w3.org/2000/svg", "")
    for word in "http:", "https:", "src=", "@import", "<b id='evil'":
        if word in without:
            v.complain("the page has", word)
    data = data_of(page)
    if [len(s["results"]) for s in data["series"]] != [4, 1]:
        v.complain("series:", [s["name"] for s in data["series"]])
    if data["series"][1]["results"][0]["file"] != "</script><b id='evil'>":
        v.complain("the name is", data["series"][1]["results"][0]["file"])
    names = sorted(os.listdir("pictures"))
    for name, picture in zip(names, data["pictures"]):
        png = base64.b64decode(picture["url"].split(",")[1])
        if png != read("pictures/" + name):
            v.complain(name, "is another one in the page")
    if len(names) != 3 or len(data["pictures"]) != 3:
        v.complain(len(data["pictures"]), "pictures of", names)
    if "four points" not in data["bd"][0]["bd"]["all"]["psnr"]["refused"]:
        v.complain("BD-rate:", data["bd"])


def check_jpeg():
    """A picture that became a JPEG must be labelled as JPEG."""
    for name in os.listdir("pictures"):
        with open("pictures/" + name, "wb") as f:
            f.write(b"\xff\xd8\xff\xe0 and so on")
    must("report", "first.json", "-o", "jpeg.html")
    for picture in data_of(read("jpeg.html").decode())["pictures"]:
        if not picture["url"].startswith("data:image/jpeg;base64,/9j/"):
            v.complain("a JPEG is", picture["url"][:40])


def check_foreign():
    """Checks that files which a report names, but must not contain, are left
    out."""
    os.makedirs("own/below")
    secret, png = b"root:x:0:0:secret\n", read("pictures/" +
                                               os.listdir("pictures")[0])
    for name, data in (("secret", secret), ("own/secret.png", secret),
                       ("outside.png", png), ("own/below/inside.png", png)):
        with open(name, "wb") as f:
            f.write(data)
    os.symlink("../outside.png", "own/link.png")
    os.symlink("..", "own/up")
    os.symlink("below/inside.png", "own/good.png")
    os.symlink("own", "linked")
    result = json.loads(read("first.json").split(b"\n")[0])
    for name, why in (
            ("secret", "in its folder or below"),
            (os.path.abspath("secret"), "in its folder or below"),
            ("own/secret.png", "is neither PNG nor JPEG"),
            ("outside.png", "in its folder or below"),
            (os.path.abspath("outside.png"), "in its folder or below"),
            ("own/../outside.png", "in its folder or below"),
            ("own/link.png", "in its folder or below"),
            ("own/up/outside.png", "in its folder or below"),
            ("/etc/passwd", "in its folder or below"), ("own", "does not exist"),
            ("own/below/inside.png", None), ("own/good.png", None),
            ("linked/below/inside.png", None)):
        for view in result["views"]:
            view.pop("picture", None)
            view.setdefault("picture_frame", 0)
        result["views"][0]["picture"] = name
        r = run("report", write("own/x.json", result), "-o", "foreign.html")
        pictures = data_of(read("foreign.html").decode())["pictures"]
        if r.returncode or len(pictures) != (0 if why else 1) or \
                (why or "") not in r.stderr or bool(why) != bool(r.stderr) or \
                (why and name not in r.stderr):
            v.complain(name, ":", r.returncode, len(pictures), r.stderr)
        if pictures and base64.b64decode(
                pictures[0]["url"].split(",")[1]) != png:
            v.complain(name, "is another one in the page")
        if run("compare", "own/x.json", "own/x.json").stderr:
            v.complain("compare looks at", name)


def check_refused():
    other = json.loads(read("second.json"))
    other["protocol"]["scale"] = 2
    write("other.json", other)
    for words, status, word in (
            (["first.json", "other.json", "-o", "no.html"], 1, "scale"),
            (["first.json", "none.json", "-o", "no.html"], 2, "none.json"),
            (["first.json"], 2, "-o FILE.html"), (["-o", "no.html"], 2,
                                                  "missing"),
            (["first.json", "-o", "none/no.html"], 2, "none/no.html")):
        r = run("report", *words)
        if r.returncode != status or r.stdout or word not in r.stderr:
            v.complain("report", *words, ":", r.returncode, r.stderr)
    if [n for n in os.listdir(".") if n.startswith("no.html")]:
        v.complain("half a page is left")
    shutil.move("pictures", "gone")
    r = run("report", "first.json", "-o", "without.html")
    if r.returncode or r.stderr.count("does not exist") != 3 or data_of(
            read("without.html").decode())["pictures"]:
        v.complain("without pictures:", r.returncode, r.stderr)


def dom_of(page):
    return subprocess.run(
        [shutil.which("chromium"), "--headless", "--no-sandbox",
         "--disable-gpu", "--user-data-dir=" + os.path.join(tmp, "profile"),
         "--dump-dom", "file://" + os.path.join(tmp, page)],
        capture_output=True, text=True, timeout=300).stdout


def expect(dom, counts):
    """Checks the number of elements in a part of a page."""
    for name, tag, wanted in counts:
        m = re.search(rf'<div[^>]* id="{name}">(.*?)<h2>|'
                      rf'<div id="{name}">(.*?)<h2>', dom, re.S)
        part = (m.group(1) or m.group(2)) if m else ""
        if part.count(tag) != wanted:
            v.complain(name, "has", part.count(tag), tag)


def check_browser():
    if not shutil.which("chromium"):
        print("     skipped: there is no chromium")
        return
    dom = dom_of("page.html")
    expect(dom, (("views", "<figure", 3), ("views", "<circle", 15),
                 ("bytes", "<text", 10), ("times", "<text", 10),
                 ("pictures", "background-image", 2)))
    curves = dom.split('id="curves">')[1].split('id="numbers"')[0]
    if curves.count("<circle") != 5 or curves.count("<path") != 2:
        v.complain("curves:", curves[:200])
    if dom.split('id="protocol">')[1].count("<tr") < 15:
        v.complain("no protocol")
    check_still()


def check_still():
    """Makes results of a still scene with fifty views, for one file and for
    two."""
    result = json.loads(read("second.json"))
    result["file"] = "still"
    view = result["views"][0]
    view.update(temporal_psnr=None, changing_psnr=None)
    result["views"] = [dict(view, name="view%02d" % i, psnr=30 + i % 7)
                       for i in range(50)]
    must("report", write("still.json", result), "-o", "still.html")
    dom = dom_of("still.html")
    expect(dom, (("views", "<figure", 0), ("views", "<svg", 1),
                 ("views", "<circle", 50), ("views", ">view49", 1),
                 ("curves", "<circle", 0)))
    metrics = dom.split('id="metric">')[1].split("</select>")[0]
    if "temporal" in metrics or "PSNR" not in metrics:
        v.complain("a still scene has the metrics", metrics)
    must("report", "still.json", write("other.json", result), "-o", "two.html")
    expect(dom_of("two.html"), (("views", "<svg", 1),
                                ("views", "<circle", 100)))


tmp = tempfile.mkdtemp()
os.chdir(tmp)
try:
    make_results()
    check_page()
    v.verdict("page")
    check_browser()
    v.verdict("browser")
    check_foreign()
    v.verdict("foreign")
    check_jpeg()
    v.verdict("jpeg")
    check_refused()
    v.verdict("refused")
finally:
    os.chdir("/")
    shutil.rmtree(tmp)
sys.exit(v.failed)
