#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_packages.sh: guarantees, for the archives that `make dist` makes,
#   wheel       the library needs only libraries that the wheel's platform tags
#               promise, and a library that needs others is refused; installed
#               in a virtual environment, the module finds the wheel's library
#               and draws the pixels of vectors/MANIFEST and of saga-dec; RECORD
#               lists every file
#   npm         every file that a package.json exports is in its package, and
#               Node can import it by its name; the decoder's package draws the
#               pixels of saga-dec. The engines are empty modules here
#               (check_engines.py uses the real ones). Without npm or the
#               decoder in WebAssembly it prints that this is skipped
#   sbom        each library that the programs load has a row in
#               docs/licences.md and stands in the bill of materials
#   dist        all archives have the release number of saga.h; the source
#               archive has the files that git tracks; SHA256SUMS lists every
#               archive; making the archives twice gives the same bytes
set -u
cd "$(dirname "$0")/../.." || exit
checks=packages
# shellcheck source=tests/cli/verdict.sh
. tests/cli/verdict.sh

built=${BUILD:-build}
[ ! -d "$built/gcc" ] || built=$built/gcc # of run_tests.sh
saga_dec=${SAGA_DEC:-$built/saga-dec}
dist=$built/dist
release=$(sed -n 's/^#define SAGA_RELEASE "\(.*\)"/\1/p' decoder/saga.h)
build() {
    "${MAKE:-make}" -s BUILD="$built" CC=gcc ${SAGA:+WERROR=-Werror} "$@" \
        >"$tmp/log" 2>&1 || complain "make $*: $(tail -n 1 "$tmp/log")"
}
rm -rf "$dist"
packs=yes
command -v npm >/dev/null && [ -e "$built/web/saga.wasm" ] || packs=
git rev-parse HEAD >/dev/null 2>&1 && all=$packs || all=
demo=$("$saga_dec" docs/demo.saga --camera rig:0 --time 0 --crc | grep -oE \
    '[0-9a-f]{8}' | tail -n 1)
[ -n "$demo" ] || complain "saga-dec tells no CRC"

# ---- wheel
[ -n "$all" ] && build dist || build wheel
cp -r "$dist" "$tmp/first"
wheel=$(echo "$dist"/saga-"$release"-py3-none-manylinux_2_17_*.whl)
python3 -m venv --without-pip "$tmp/venv" || complain "no environment"
site=$(echo "$tmp"/venv/lib/python3*/site-packages)
# pip refuses a wheel for another machine. Without pip the wheel is unpacked.
if python3 -m pip --version 2>/dev/null | grep -qE '^pip (2[3-9]|[3-9])'; then
    python3 -m pip --python "$tmp/venv/bin/python" --quiet \
        --disable-pip-version-check install --no-index --no-compile "$wheel" \
        2>>"$bad" || complain "pip does not install $wheel"
else
    python3 -m zipfile -e "$wheel" "$site"
fi
want=$(awk '$1 == "good/motion.saga" && $2 == 0 && $7 == 0 && $8 == 0 {
    print $11 }' vectors/MANIFEST)
cat >"$tmp/draw.py" <<'PYTHON'
import base64, hashlib, os, sys, zipfile
import saga

root, wheel, site, *wanted = sys.argv[1:]
for path in saga.__file__, saga._lib()._name:
    if not os.path.realpath(path).startswith(os.path.realpath(site)):
        print(path, "is not in the environment")
for name, crc in zip(("docs/demo.saga", "vectors/good/motion.saga"), wanted):
    film = saga.open(os.path.join(root, name))
    got = "%08x" % saga.crc32c(film.pixels(camera=0, frame=0))
    if got != crc:
        print("the wheel draws", got, "of", name, "not", crc)
with zipfile.ZipFile(wheel) as z:
    names = z.namelist()
    record, = [n for n in names if n.endswith("/RECORD")]
    for line in z.read(record).decode().splitlines():
        name, digest, _ = line.split(",")
        names.remove(name)
        if name != record and digest != "sha256=" + base64.urlsafe_b64encode(
                hashlib.sha256(z.read(name)).digest()).decode().rstrip("="):
            print("RECORD has another", name)
    if names:
        print("RECORD has no", *names)
PYTHON
(root=$PWD && cd "$tmp" && env -u SAGA_LIBRARY -u PYTHONPATH \
    PYTHONDONTWRITEBYTECODE=1 "$tmp/venv/bin/python" draw.py "$root" \
    "$(realpath "$root/$wheel" 2>/dev/null || echo "$wheel")" "$site" \
    "$demo" "$want") >>"$bad" 2>&1
refused() { # refused TEXT SOURCE FLAGS...: a library that no tag fits
    echo "$2" | gcc -shared -fPIC -x c - -o "$tmp/x.so" "${@:3}"
    ! tools/wheel.py "$tmp/x.so" "$tmp/none" >"$tmp/log" 2>&1 &&
        grep -q "$1" "$tmp/log" || complain "not refused: $2"
}
refused 'needs libm' 'double cos(double); double f(double x) { return cos(x); }' \
    -fno-builtin -Wl,--no-as-needed -lm
refused 'needs glibc 2.25' 'long getrandom(void *, unsigned long, unsigned);
    long f(void *p) { return getrandom(p, 1, 0); }'
verdict wheel

# ---- npm
if [ -z "$packs" ]; then
    echo "ok   packages npm skipped: no npm, or no clang and wasm-ld"
else
    [ -n "$all" ] || build npm
    for p in web three playcanvas; do
        mkdir -p "$tmp/node_modules/saga-$p"
        tar -xzf "$dist/saga-$p-$release.tgz" --strip-components=1 \
            -C "$tmp/node_modules/saga-$p" || complain "no package of $p"
        [ -s "$tmp/node_modules/saga-$p/LICENSE" ] ||
            complain "no licence in saga-$p"
    done
    # engine PACKAGE NAME...: makes an empty package, all of whose modules export
    # these names, so that the modules that import it load.
    engine() {
        local at=$tmp/node_modules/$1
        mkdir -p "$at"
        echo '{ "type": "module", "exports": { ".": "./engine.js",
            "./*": "./engine.js" } }' >"$at/package.json"
        printf 'export class %s {}\n' "${@:2}" >"$at/engine.js"
    }
    # shellcheck disable=SC2046
    engine three $(grep -oh 'THREE\.[A-Z][A-Za-z0-9]*' ports/three/*.js |
        sed 's/.*\.//' | sort -u) GaussianSplat createGaussianSplatGeometry \
        sRGBTransferEOTF vec4 writeColorBytes writeCovariance
    # shellcheck disable=SC2046
    engine playcanvas $(grep -oh 'pc\.[A-Z][A-Za-z]*' ports/playcanvas/*.js |
        sed 's/.*\.//' | sort -u)
    engine @sparkjsdev/spark ExtSplats SplatMesh utils
    cat >"$tmp/draw.mjs" <<'NODE'
import { existsSync, readFileSync } from 'node:fs';

const [root, want] = process.argv.slice(2);
const files = (entry) => Object.values(
    typeof entry === 'string' ? [entry] : entry);

for (const p of ['saga-web', 'saga-three', 'saga-playcanvas']) {
    const at = new URL(`node_modules/${p}/`, import.meta.url);
    const { exports, types } = JSON.parse(
        readFileSync(new URL('package.json', at)));

    for (const [name, entry] of Object.entries(exports)) {
        for (const f of files(entry))
            if (!f.includes('*') && !existsSync(new URL(f, at)))
                console.log(`${p} has no ${f}`);
        // The element and the page need a browser.
        if (!name.includes('*') && name !== './player.js')
            await import(p + name.slice(1));
    }
    if (!existsSync(new URL(types, at)))
        console.log(`${p} has no ${types}`);
}
const { SagaFile } = await import('saga-web');
const bytes = readFileSync(`${root}/docs/demo.saga`);
const film = await SagaFile.open(new Blob([bytes]));

await film.draw(film.rig[0], 0);
if (film.crc() !== want)
    console.log(`saga-web draws ${film.crc()}, not ${want}`);
NODE
    node "$tmp/draw.mjs" "$PWD" "$demo" >>"$bad" 2>&1
    verdict npm
fi

# ---- dist
if [ -z "$all" ]; then
    echo "ok   packages dist skipped: no clone, or no npm packages"
else
    build dist
    diff -r "$tmp/first" "$dist" >>"$bad"
    (cd "$dist" && sha256sum --quiet -c SHA256SUMS && ls ./*-"$release"[-.]* |
        wc -l) >"$tmp/sums" 2>&1
    [ "$(cat "$tmp/sums")" = 5 ] || complain "archives: $(cat "$tmp/sums")"
    [ "$(wc -l <"$dist/SHA256SUMS")" = 5 ] || complain "not 5 checksums"
    tar -tzf "$dist/saga-$release.tar.gz" | grep -v '/$' |
        sed "s|^saga-$release/||" | sort >"$tmp/there"
    git ls-tree -r --name-only HEAD | sort | diff - "$tmp/there" >>"$bad"
    verdict dist
fi

# ---- sbom
if ! command -v dpkg-query >/dev/null; then
    echo "ok   packages sbom skipped: no dpkg"
else
    tools/sbom.py "${SAGA:-$built/saga}" "$saga_dec" >"$tmp/bom" 2>>"$bad"
    python3 -c '
import json, sys
names = [c["name"] for c in json.load(open(sys.argv[1]))["components"]]
assert {"glibc", "libpng", "zlib", "jansson"} <= set(names), names
assert len(set(names)) == len(names), names' "$tmp/bom" 2>>"$bad"
    verdict sbom
fi

all_passed
