#!/bin/sh
# SPDX-License-Identifier: MIT
#
# install.sh put|remove BUILD: installs from BUILD the programs, libraries,
# header, description for pkg-config, manual pages, completions, Python module and
# the files of ports/desktop, or removes them and the folders that are empty then. They go to BINDIR, LIBDIR,
# INCLUDEDIR, DATADIR and PYTHONDIR below DESTDIR. `make install` and `make
# uninstall` run it. Without DESTDIR it also runs ldconfig, so that programs find
# the library.
set -eu

verb=$1
build=$2

take_away() { # take_away PLACE
    folder=$(dirname "$1")
    rm -f "$DESTDIR$1"
    # The root and DESTDIR itself are never removed.
    while [ "$folder" != / ] && rmdir "$DESTDIR$folder" 2>/dev/null; do
        folder=$(dirname "$folder")
    done
}

put() { # put MODE FILE PLACE
    if [ "$verb" = remove ]; then
        take_away "$3"
        return
    fi
    mkdir -p "$DESTDIR$(dirname "$3")"
    install -m "$1" "$2" "$DESTDIR$3"
}

for p in saga saga-dec saga-play; do
    put 755 "$build/$p" "$BINDIR/$p"
    put 644 "$build/pages/$p.man" "$DATADIR/man/man1/$p.1"
    put 644 "$build/pages/$p.bash" "$DATADIR/bash-completion/completions/$p"
    put 644 "$build/pages/$p.zsh" "$DATADIR/zsh/site-functions/_$p"
    put 644 "$build/pages/$p.fish" "$DATADIR/fish/vendor_completions.d/$p.fish"
done
# What file managers know of films.
put 644 ports/desktop/saga.xml "$DATADIR/mime/packages/saga.xml"
put 644 ports/desktop/saga.desktop "$DATADIR/applications/saga.desktop"
put 644 ports/desktop/saga.thumbnailer "$DATADIR/thumbnailers/saga.thumbnailer"
put 644 ports/desktop/saga.svg "$DATADIR/icons/hicolor/scalable/apps/saga.svg"
put 644 "$build/libsaga.a" "$LIBDIR/libsaga.a"
put 644 "$build/libsaga.so.0" "$LIBDIR/libsaga.so.0"
if [ "$verb" = remove ]; then
    take_away "$LIBDIR/libsaga.so"
else
    ln -sf libsaga.so.0 "$DESTDIR$LIBDIR/libsaga.so"
fi
put 644 "$build/include/saga.h" "$INCLUDEDIR/saga.h"
put 644 ports/python/saga.py "$PYTHONDIR/saga.py"

# The bytecode that Python has compiled from the module is removed with the
# module.
[ "$verb" = put ] || for f in "$DESTDIR$PYTHONDIR"/__pycache__/saga.*.pyc; do
    take_away "${f#"$DESTDIR"}"
done

release=$(sed -n 's/^#define SAGA_RELEASE "\(.*\)"/\1/p' decoder/saga.h)
[ "$verb" = remove ] || cat >"$build/pages/saga.pc" <<PC
libdir=$LIBDIR
includedir=$INCLUDEDIR

Name: saga
Description: decoder of volumetric video, the same bits on every machine
Version: $release
Libs: -L\${libdir} -lsaga
Cflags: -I\${includedir}
PC
put 644 "$build/pages/saga.pc" "$LIBDIR/pkgconfig/saga.pc"

if [ -z "$DESTDIR" ] &&
    ! PATH=$PATH:/usr/sbin:/sbin ldconfig 2>/dev/null; then
    echo "ldconfig failed: run it as root, or programs need" \
        "LD_LIBRARY_PATH=$LIBDIR"
fi
