#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_debian.sh: guarantees that
#   release     debian/changelog begins with the release number of saga.h
#   build       dpkg-buildpackage makes the four packages in a clean copy; they
#               have all files that `make install` installs
#   lintian     lintian finds nothing
#   run         the packages' program runs, and their Python module with the
#               packages' library
# It builds the whole tree. If dh or lintian is missing, it prints that this is
# skipped.
set -u
cd "$(dirname "$0")/../.." || exit
checks=debian
# shellcheck source=tests/cli/verdict.sh
. tests/cli/verdict.sh

# ---- release
release=$(sed -n 's/^#define SAGA_RELEASE "\(.*\)"/\1/p' decoder/saga.h)
head -n 1 debian/changelog | grep -qF "saga ($release) " ||
    complain "debian/changelog begins with $(head -n 1 debian/changelog)"
verdict release

if ! command -v dh >/dev/null || ! command -v dh_python3 >/dev/null; then
    echo "ok   debian skipped: debhelper or dh-python is not installed"
    exit
fi

# ---- build
mkdir "$tmp/saga"
git ls-files -co --exclude-standard | while read -r f; do
    [ ! -f "$f" ] || echo "$f"
done | tar -cT - | tar -xC "$tmp/saga"
(cd "$tmp/saga" && DEB_BUILD_OPTIONS=parallel=${JOBS:-$(nproc)} \
    dpkg-buildpackage -us -uc -b) >"$tmp/log" 2>&1 </dev/null ||
    complain "dpkg-buildpackage: $(tail -n 3 "$tmp/log")"
! grep '^dh_missing: ' "$tmp/log" >>"$bad"
for p in saga libsaga0 libsaga-dev python3-saga; do
    deb=$(echo "$tmp/${p}_${release}_"*.deb)
    dpkg -x "$deb" "$tmp/root" 2>>"$bad"
done
verdict build

# ---- lintian
if command -v lintian >/dev/null; then
    lintian --allow-root "$tmp"/*.changes >>"$bad" 2>&1
    verdict lintian
else
    echo "ok   debian lintian skipped: it is not installed"
fi

# ---- run
usr=$tmp/root/usr
"$usr/bin/saga" --version | grep -q "^saga $release," || complain "no saga"
"$usr/bin/saga" view --help >/dev/null || complain "no saga view"
SAGA_LIBRARY=$(echo "$usr"/lib/*/libsaga.so.0) PYTHONDONTWRITEBYTECODE=1 \
    PYTHONPATH=$usr/lib/python3/dist-packages python3 -c '
import saga, sys
film = saga.open("vectors/good/still.saga")
sys.exit(not any(film.pixels(camera=0, frame=0)))
' 2>>"$bad" || complain "the module does not draw"
verdict run

all_passed
