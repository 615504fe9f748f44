#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_whole.py: guarantees, for pages that contain their film,
  file        `saga export -o x.html` writes the film's bytes unchanged, in at
              most 1.4 times the film and 300 kB, with a poster; the same bytes
              each time; a name with HTML is escaped; nothing remains of a page
              that cannot be written, and options for splats are refused
  links       with --address the page has the tags of Open Graph, whose picture
              is a PNG beside it, whatever the names are; other addresses are
              refused
  alone       opened from file:// in Chromium, in a folder with no other file,
              the page shows the picture of vectors/MANIFEST, and plays film and
              sound, also what is decoded ahead of time. It asks for nothing but
              itself, and its policy refuses to fetch what exists
  button      the page of ports/web saves what it shows as such a page, with the
              same film
  notebook    in Python a film shows itself as such a page in a frame, and as
              text without the program
Without Chromium or the decoder in WebAssembly, the check prints that it was
skipped."""

import base64
import html
import json
import os
import re
import shutil
import sys
import tempfile
import wave

sys.dont_write_bytecode = True
from verdict import SAGA, WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)

GOOD = "vectors/good/"
FILMS = ("still", "segments", "sound")
DEMO = "docs/demo.saga"
EVIL = "</script><b id='evil'> \u202e\u00e4.saga"

checks = Verdicts("whole")
complain, verdict = checks.complain, checks.verdict


def part(page, name):
    """Returns what an element of a page has, which must be there once."""
    found = re.findall(r'id="%s">(.*?)</script>' % name, page, re.S)
    if len(found) != 1:
        complain("the page has", len(found), name)
    return found[0] if found else ""


def film_of(page):
    return base64.b64decode(part(page, "film"), validate=True)


def export(film, to):
    checks.run(SAGA, "export", film, "-o", to)
    return read(to).decode()


# --- The file --------------------------------------------------------------

def check_file(tmp):
    for film in (DEMO, *(GOOD + name + ".saga" for name in FILMS)):
        page = export(film, tmp + "/x.html")
        want = read(film)
        if film_of(page) != want:
            complain(film, "is another film in its page")
        if len(page) > 1.4 * len(want) + 300000:
            complain(film, "has", len(want), "bytes, its page", len(page))
        poster = re.search(r'id="poster" alt="" src="data:image/webp;base64,'
                           r'([^"]*)"', page)
        if not poster or base64.b64decode(poster[1])[8:12] != b"WEBP":
            complain(film, "has no poster")
        if page != export(film, tmp + "/y.html"):
            complain(film, "has two pages")
    evil = tmp + "/" + EVIL.replace("/", "_")
    shutil.copy(DEMO, evil)
    page = export(evil, tmp + "/evil.html")
    if "<b id=" in page or json.loads(part(page, "carried"))["name"] != \
            os.path.basename(evil).replace("\u202e", "%E2%80%AE"):
        complain("a name in the page is", part(page, "carried"))
    for options in (["--frame", "1"], ["--sh", "2"], ["--camera", "0"],
                    ["--frames", "0:2"]):
        checks.run(SAGA, "export", DEMO, "-o", tmp + "/none.html", *options,
                   status=2, says="a page has the whole film")
    checks.run(SAGA, "export", DEMO, "-o", tmp + "/none/x.html", status=2,
               says="none")
    checks.run(SAGA, "export", DEMO, "-o", tmp + "/none.html", status=2,
               says="none.html", disk=100000)
    checks.run(SAGA, "export", "vectors/bad/crc_segment.saga", "-o",
               tmp + "/none.html", status=1, says="crc_segment.saga")
    if [name for name in os.listdir(tmp) if "none" in name]:
        complain("a page that failed leaves", os.listdir(tmp))
    verdict("file")


# --- Links to it -----------------------------------------------------------

def tags_of(page):
    return {name: html.unescape(text) for name, text in re.findall(
        r'<meta property="og:([a-z:]+)" content="([^"]*)">', page)}


def check_links(tmp):
    folder = tmp + "/links"
    os.mkdir(folder)
    if tags_of(export(DEMO, folder + "/bare.html")):
        complain("a page without address has tags")
    evil = folder + '/a "b" <i>&amp;.saga'
    shutil.copy(DEMO, evil)
    # DEMO has 24 pictures at 24 a second, of 320x180.
    for address, base in (("https://x.org/p/q.html", "https://x.org/p/"),
                          ("https://x.org", "https://x.org/"),
                          ("http://x.org/~me/", "http://x.org/~me/"),
                          ("https://x.org/a&lt;b/q.html",
                           "https://x.org/a&lt;b/")):
        page = checks.run(SAGA, "export", evil, "-o", folder + "/a b.html",
                          "--address", address) and read(
                              folder + "/a b.html").decode()
        want = {"type": "website", "title": os.path.basename(evil),
                "description": "1 second of volumetric video",
                "url": address, "image": base + "a%20b.png",
                "image:width": "320", "image:height": "180"}
        if tags_of(page) != want:
            complain(address, "gives", tags_of(page))
        title = re.search("<title>(.*?)</title>", page)[1]
        if "<" in title or html.unescape(title) != os.path.basename(evil):
            complain("the title is", title)
    png = read(folder + "/a b.png")
    if png[:8] != b"\x89PNG\r\n\x1a\n" or \
            png[16:24] != (320).to_bytes(4, "big") + (180).to_bytes(4, "big"):
        complain("the picture for links is no PNG of 320x180")
    # It shows what the page shows first.
    late, page = folder + "/late.saga", folder + "/late.html"
    checks.run(SAGA, "volume", DEMO, "--find", "--start", "5", "-o", late)
    checks.run(SAGA, "export", late, "-o", page, "--address", "https://x.org")
    checks.run(SAGA, "render", late, "--camera", "5", "--frame", "0", "-o",
               folder + "/five.png")
    if read(folder + "/late.png") != read(folder + "/five.png"):
        complain("the picture for links is not that of the first camera")
    for bad in ("x.org/a.html", "ftp://x.org/", "https:///a.html", "https://",
                "https://x.org/a b.html", 'https://x.org/"', "https://x.org/?a",
                "https://x.org/\u00e4.html"):
        checks.run(SAGA, "export", DEMO, "-o", folder + "/none.html",
                   "--address", bad, status=2, says="is no web address")
    checks.run(SAGA, "export", DEMO, "-o", folder + "/none.ply", "--address",
               "https://x.org/a.html", status=2, says="is for a page")
    if [name for name in os.listdir(folder) if "none" in name]:
        complain("what was refused left", os.listdir(folder))
    verdict("links")


# --- The page in a browser -------------------------------------------------

STATE = "document.documentElement.dataset.state"


def show(tab, url):
    tab.go(url)
    tab.wait("%s === 'problem' || (%s === 'ready' && viewer.drawn && "
             "!viewer.busy)" % (STATE, STATE), "document.body.innerText")
    if tab.run(STATE) == "problem":
        complain(url[:60], "says", tab.run(
            "document.getElementById('sentence').textContent"))
        return False
    return True


def crc_of(name):
    with open("vectors/MANIFEST") as f:
        return [line.split()[-1] for line in f
                if line.startswith("good/%s.saga" % name)][0]


def requests(tab):
    """Collects the addresses that the tab's page and its workers ask for."""
    asked = []
    note = tab.note

    def listen(event):
        note(event)
        if event.get("method") == "Network.requestWillBeSent":
            asked.append(event["params"]["request"]["url"])
    tab.note = listen
    tab.call("Network.enable")
    return asked


def check_sound(tab, tmp):
    """The <audio> element gets the sound of the film in the page."""
    with wave.open(tmp + "/x.wav", "wb") as f:
        f.setparams((1, 2, 48000, 0, "NONE", ""))
        f.writeframes(bytes(96000))
    checks.run(SAGA, "mux", DEMO, "--audio", tmp + "/x.wav", "-o",
               tmp + "/heard.saga")
    export(tmp + "/heard.saga", tmp + "/alone/heard.html")
    show(tab, "file://" + tmp + "/alone/heard.html")
    sound = "document.getElementById('player').sound"
    if not tab.run("viewer.hasSound"):
        complain("the film in the page has no sound")
    elif tab.run(sound + ".exists"): # Chromium has an Opus decoder
        tab.run("viewer.play()")
        tab.wait(sound + ".audio.duration > 0.9")


def check_alone(tab, tmp):
    os.mkdir(tmp + "/alone")
    asked = requests(tab)
    server = browser.FileServer({"x.txt": b"x"}, share=True)
    for name in FILMS:
        path = tmp + "/alone/%s.html" % name
        export(GOOD + name + ".saga", path)
        url = "file://" + path
        del asked[:]
        if not show(tab, url + "?draw=exact"):
            continue
        if tab.run("viewer.drawn.crc") != crc_of(name):
            complain(name, "has the CRC", tab.run("viewer.drawn.crc"))
        others = {a for a in asked if not a.startswith(("data:", url))}
        if others or url + "?draw=exact" not in asked:
            complain(name, "asks for", others or "nothing")
        if "refused" not in tab.run(
                "fetch('%sx.txt').then(() => 'read', () => 'refused')" %
                server.url) or server.served:
            complain(name, "may fetch from a server")
    show(tab, "file://" + tmp + "/alone/segments.html")
    tab.run("viewer.loop = true; viewer.play(); window.ahead = false; "
            "viewer.addEventListener('drawn', () => { ahead ||= "
            "viewer.drawn.ahead; })")
    tab.wait("ahead")
    check_sound(tab, tmp)
    if not show(tab, "file://" + tmp + "/evil.html") or tab.run(
            "document.getElementById('evil') !== null || "
            "document.getElementById('name').textContent") != \
            EVIL.replace("/", "_").replace("\u202e", "%E2%80%AE"):
        complain("a name with HTML is shown as", tab.run(
            "document.getElementById('name').innerHTML"))
    if [e for e in tab.log if "wasm" in e or "Error" in e]:
        complain("the console says", tab.log)
    verdict("alone")


def check_button(tab, tmp):
    files = {n: read(os.path.join(WEB, n)) for n in os.listdir(WEB)}
    files["x.saga"] = read(DEMO)
    server = browser.FileServer(files)
    show(tab, server.url + "index.html?src=x.saga")
    page = tab.run("""new Promise((resolve) => {
        const make = URL.createObjectURL;
        URL.createObjectURL = (blob) => {
            blob.text().then(resolve);
            return make(blob);
        };
        document.getElementById('save-page').click();
    })""")
    if film_of(page) != read(DEMO):
        complain("the button saves another film")
    if json.loads(part(page, "carried"))["name"] != "x.saga" or \
            "data:image/jpeg;base64,/9j/" not in page or \
            "<title>x.saga</title>" not in page:
        complain("the page has no name, no title or no poster")
    with open(tmp + "/saved.html", "w") as f:
        f.write(page)
    if not show(tab, "file://" + tmp + "/saved.html"):
        complain("the page that the button saves is not shown")
    elif not tab.run("document.getElementById('save-page').hidden"):
        complain("a page with its film offers to save itself")
    verdict("button")


def check_notebook(tab, tmp):
    sys.path.insert(0, "ports/python")
    os.environ["SAGA_LIBRARY"] = os.path.join(os.path.dirname(SAGA),
                                              "libsaga.so.0")
    import saga
    os.environ["SAGA"] = SAGA
    with saga.open(DEMO) as film:
        frame = film._repr_html_()
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', frame)[1])
    if film_of(page) != read(DEMO):
        complain("the notebook has another film")
    server = browser.FileServer({"n.html": (
        "<!doctype html>" + frame).encode()})
    tab.go(server.url + "n.html")
    inner = "document.querySelector('iframe').contentWindow."
    tab.wait(inner + "viewer?.drawn", inner + "document.body.innerText")
    tab.run(inner + "viewer.orbit(0.1, 0)")
    tab.run("new Promise((resolve) => setTimeout(resolve, 500))")
    if len(server.served) != 1 or tab.log:
        complain("the frame asks for", server.served, tab.log)
    os.environ["SAGA"] = tmp + "/missing"
    with saga.open(DEMO) as film:
        if film._repr_html_() is not None:
            complain("without the program the film shows something")
    verdict("notebook")


def main():
    if not os.path.exists(WEB + "/saga.wasm"):
        checks.run(SAGA, "export", DEMO, "-o", "x.html", status=2,
                   says="install clang and lld")
        verdict("without a decoder for browsers it says what is missing")
        return 1 if checks.failed else 0
    with tempfile.TemporaryDirectory() as tmp:
        check_file(tmp)
        check_links(tmp)
        if checks.skips():
            return 1 if checks.failed else 0
        tab = browser.Browser()
        check_alone(tab, tmp)
        check_button(tab, tmp)
        check_notebook(tab, tmp)
        tab.close()
    return 1 if checks.failed else 0


sys.exit(main())
