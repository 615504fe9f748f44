#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_install.sh: guarantees, for what `make install` puts below DESTDIR,
#   files       exactly the expected files are installed, none of them outside
#               of DESTDIR; all state the same release number
#   library     pkg-config suffices to build a program with the library; the
#               shared library exports the functions of saga.h and no others;
#               the examples run; the Python module finds the library that was
#               installed with it; ldconfig runs if DESTDIR is not used
#   web         build/web has all files that its package.json names
#   pages       every option of every command is in the manual page and in each
#               shell's completion; the manual page has no warnings; bash
#               completes commands, options, and the values of options
#   uninstall   `make uninstall` removes exactly the files that were installed
set -u
cd "$(dirname "$0")/../.." || exit
checks=install
# shellcheck source=tests/cli/verdict.sh
. tests/cli/verdict.sh

build=${BUILD:-build}
[ ! -d "$build/gcc" ] || build=$build/gcc # of run_tests.sh
rm -f "$build/web/package.json" "$build/web/README.md"
"${MAKE:-make}" -s BUILD="$build" CC=gcc ${SAGA:+WERROR=-Werror} install \
    DESTDIR="$tmp/root" PREFIX=/opt/saga >"$tmp/log" 2>&1 ||
    complain "make install: $(tail -n 1 "$tmp/log")"
at=$tmp/root/opt/saga
share=$at/share

# ---- files
(cd "$tmp/root" && find . ! -type d | sort) >"$tmp/there"
sort >"$tmp/wanted" <<'FILES'
./opt/saga/bin/saga
./opt/saga/bin/saga-dec
./opt/saga/bin/saga-play
./opt/saga/include/saga.h
./opt/saga/lib/libsaga.a
./opt/saga/lib/libsaga.so
./opt/saga/lib/libsaga.so.0
./opt/saga/lib/pkgconfig/saga.pc
./opt/saga/share/applications/saga.desktop
./opt/saga/share/icons/hicolor/scalable/apps/saga.svg
./opt/saga/share/mime/packages/saga.xml
./opt/saga/share/thumbnailers/saga.thumbnailer
./opt/saga/share/bash-completion/completions/saga
./opt/saga/share/bash-completion/completions/saga-dec
./opt/saga/share/bash-completion/completions/saga-play
./opt/saga/share/fish/vendor_completions.d/saga-dec.fish
./opt/saga/share/fish/vendor_completions.d/saga-play.fish
./opt/saga/share/fish/vendor_completions.d/saga.fish
./opt/saga/share/man/man1/saga-dec.1
./opt/saga/share/man/man1/saga-play.1
./opt/saga/share/man/man1/saga.1
./opt/saga/share/saga/python/saga.py
./opt/saga/share/zsh/site-functions/_saga
./opt/saga/share/zsh/site-functions/_saga-dec
./opt/saga/share/zsh/site-functions/_saga-play
FILES
diff "$tmp/wanted" "$tmp/there" >>"$bad"
release=$(sed -n 's/^#define SAGA_RELEASE "\(.*\)"/\1/p' decoder/saga.h)
for p in saga saga-dec saga-play; do
    "$at/bin/$p" --version | grep -q "^$p $release," ||
        complain "$p is no $release"
    head -n 1 "$share/man/man1/$p.1" | grep -qF "saga $release" ||
        complain "$p.1 is no $release"
done
verdict files

# ---- library
export PKG_CONFIG_PATH=$at/lib/pkgconfig
[ "$(pkg-config --modversion saga)" = "$release" ] ||
    complain "saga.pc is no $release"
# shellcheck disable=SC2046
gcc tests/api/use_from_c.c -o "$tmp/use" \
    $(pkg-config --define-variable=libdir="$at/lib" \
        --define-variable=includedir="$at/include" --cflags --libs saga) \
    2>"$tmp/log" || complain "$(head -n 1 "$tmp/log")"
want=$(awk '$1 == "good/motion.saga" && $2 == 0 && $7 == 0 && $8 == 0 {
    print $11 }' vectors/MANIFEST)
[ -n "$want" ] && [ "$(LD_LIBRARY_PATH=$at/lib "$tmp/use" \
    vectors/good/motion.saga)" = "$want" ] ||
    complain "the program with the shared library draws no $want"
# The examples, as a newcomer compiles and runs them.
# shellcheck disable=SC2046
gcc -Wall -Wextra -Werror examples/first_picture.c -o "$tmp/first" \
    $(pkg-config --define-variable=libdir="$at/lib" \
        --define-variable=includedir="$at/include" --cflags --libs saga) \
    2>"$tmp/log" || complain "$(head -n 1 "$tmp/log")"
LD_LIBRARY_PATH=$at/lib "$tmp/first" vectors/good/motion.saga >"$tmp/a.ppm"
"$at/bin/saga-dec" vectors/good/motion.saga --camera rig:0 -o "$tmp/b.ppm"
cmp -s "$tmp/a.ppm" "$tmp/b.ppm" || complain "first_picture is not saga-dec's"
SAGA_LIBRARY=$at/lib/libsaga.so.0 PYTHONDONTWRITEBYTECODE=1 \
    PYTHONPATH=$share/saga/python python3 examples/walk.py \
    vectors/good/motion.saga "$tmp/walk" 2>"$tmp/log" ||
    complain "walk.py: $(tail -n 1 "$tmp/log")"
frames=$("$at/bin/saga" info vectors/good/motion.saga --json |
    sed -n 's/^  "n_frames": \([0-9]*\).*/\1/p')
[ "$(ls "$tmp/walk" | wc -l)" = "$frames" ] ||
    complain "walk.py: $(ls "$tmp/walk" | wc -l) pictures"
grep -q 'NEEDED.*libsaga.so.0' <(objdump -p "$tmp/use") ||
    complain "the program does not use the shared library"
sed -n 's/^[a-z].*[ *]\(saga_[a-z0-9_]*\)(.*/\1/p' decoder/saga.h |
    sort -u >"$tmp/names"
nm -D --defined-only "$at/lib/libsaga.so.0" | awk '{ print $3 }' | sort |
    diff "$tmp/names" - >>"$bad"
# The module runs in another folder than this tree's, so that it cannot find a
# build above itself.
python() { # python ARGUMENTS...: without what the caller has set
    env -u SAGA_LIBRARY -u LD_LIBRARY_PATH PYTHONDONTWRITEBYTECODE=1 \
        python3 "$@"
}
for lib in lib lib64; do
    mv "$at/lib" "$at/moved" && mv "$at/moved" "$at/$lib"
    found=$(cd / && PYTHONPATH=$share/saga/python python -c \
        'import saga; print(saga._lib()._name)' 2>&1 | tail -n 1)
    [ "$(realpath -m "$found")" = "$(realpath "$at/$lib/libsaga.so.0")" ] ||
        complain "the module beside $lib finds: $found"
    mv "$at/$lib" "$at/moved" && mv "$at/moved" "$at/lib"
done
mkdir "$tmp/bin"
printf '#!/bin/sh\necho told >>"%s"\nexit "$LDCONFIG"\n' "$tmp/told" \
    >"$tmp/bin/ldconfig"
chmod +x "$tmp/bin/ldconfig"
put() { # put LDCONFIG DESTDIR: how ldconfig ends
    LDCONFIG=$1 DESTDIR=$2 PATH=$tmp/bin:$PATH BINDIR=$tmp/put/bin \
        LIBDIR=$tmp/put/lib INCLUDEDIR=$tmp/put/include \
        DATADIR=$tmp/put/share PYTHONDIR=$tmp/put/python \
        tools/install.sh put "$build" >"$tmp/log" 2>&1 ||
        complain "install.sh: $(tail -n 1 "$tmp/log")"
}
put 0 "$tmp/root2"
[ ! -e "$tmp/told" ] || complain "ldconfig runs for DESTDIR"
put 0 ''
[ -s "$tmp/told" ] || complain "ldconfig is not run"
put 1 ''
grep -q 'ldconfig' "$tmp/log" || complain "no word of ldconfig that fails"
verdict library

# ---- web
sed -n '/"files"/,/\]/s/^ *"\([^"]*\)",*$/\1/p' ports/web/package.json \
    >"$tmp/web"
(cd "$build/web" && while read -r f; do
    # shellcheck disable=SC2086
    case $f in
    *.wasm | whole.html) ;; # without clang there is none
    *) ls $f >/dev/null || echo "build/web has no $f" ;;
    esac
done <"$tmp/web"; ls package.json README.md >/dev/null) >>"$bad" 2>&1
[ "$(wc -l <"$tmp/web")" -ge 4 ] || complain "package.json names no files"
if command -v npm >/dev/null; then
    (cd "$build/web" && npm pack --dry-run --offline --json 2>/dev/null) |
        grep -q '"path": "saga.js"' || complain "npm packs no saga.js"
fi
verdict web

# ---- pages: "COMMAND OPTION" of all of them, from the help once more
options() { # options PROGRAM COMMAND ARGUMENTS...
    "$1" "${@:3}" | grep -oE '^  --?[A-Za-z][A-Za-z0-9-]*' | sed "s/^ */$2 /"
}
commands=$("$at/bin/saga" --help |
    sed -n '/^usage/,/^First/s/^  \([a-z][a-z]*\)   *[A-Z-].*/\1/p')
[ "$(echo "$commands" | wc -l)" -ge 15 ] ||
    complain "the help has the commands $commands"
for c in $commands; do options "$at/bin/saga" "$c" help "$c" --all; done >"$tmp/all"
# The help of the commands must show all options that the source has in its
# tables.
grep -hoE '^    \{ "--?[a-z-]+"' trainer/cli/*.c | cut -d'"' -f2 | sort -u |
    while read -r o; do
        grep -qE " $o\$" "$tmp/all" || complain "no command's help has $o"
    done
for p in saga-dec saga-play; do
    options "$at/bin/$p" "$p" --help
done >"$tmp/others"
python3 - "$share" "$tmp/all" "$tmp/others" >>"$bad" <<'PYTHON'
import re, sys

share, *lists = sys.argv[1:]
rows, others = ([line.split() for line in open(name)] for name in lists)


def read(path):
    with open(share + "/" + path, encoding="utf-8") as f:
        return f.read()


def page_of(program):
    return read("man/man1/%s.1" % program).replace("\\-", "-")


def in_page(text, option):
    return re.search(r"^\.B %s( |$)" % option, text, re.M)


def in_words(text, option):
    return re.search(r"['\" ]%s[' ]" % option, text)


def part(text, begins, ends):
    """Returns the lines from the one that begins so to the one that ends it."""
    found = re.search(r"^%s.*?^.*%s" % (begins, ends), text, re.M | re.S)
    return found.group() if found else ""


page, bash = page_of("saga"), read("bash-completion/completions/saga")
zsh = read("zsh/site-functions/_saga")
fish = read("fish/vendor_completions.d/saga.fish").splitlines()
for command, option in rows:
    flag = ("-l " if option[1] == "-" else "-s ") + option.lstrip("-") + " "
    own = re.findall(r"^ *%s\) words=.*" % command, bash, re.M)
    for where, there in (
            ("saga.1", in_page(part(page, r"\.SH COMMAND %s$" %
                                    command.upper(), r"^\.SH [CE]"), option)),
            ("bash", in_words("\n".join(own), option)),
            ("zsh", "'*%s[" % option in part(zsh, command + r"\)", ";;")),
            ("fish", any("from %s'" % command in line and flag in line
                         for line in fish))):
        if not there:
            print(where, "has no", command, option)
for program, option in others:
    if not in_page(page_of(program), option):
        print(program + ".1 has no", option)
    if not in_words(read("bash-completion/completions/" + program), option):
        print("bash has no", program, option)
if len(rows) < 100 or len(others) < 10:
    print("too few options:", len(rows), len(others))
PYTHON
for p in saga saga-dec saga-play; do
    if command -v groff >/dev/null; then
        groff -man -ww -z "$share/man/man1/$p.1" >>"$bad" 2>&1
    fi
done
# complete WORD...: prints what bash offers to complete the last word.
offers() {
    bash -c '. "$0"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _saga
        printf "%s\n" "${COMPREPLY[@]}"' \
        "$share/bash-completion/completions/saga" "$@"
}
[ "$(offers saga enc)" = encode ] || complain "enc: $(offers saga enc)"
[ "$(offers saga encode --prim)" = --primitives ] ||
    complain "--prim: $(offers saga encode --prim)"
[ "$(offers saga info vectors/MANI)" = vectors/MANIFEST ] ||
    complain "a file: $(offers saga info vectors/MANI)"
[ "$(offers saga imp)" = import ] || complain "imp: $(offers saga imp)"
after() { # after WORDS WORD...: what is offered after them, in one line
    local got
    got=$(offers "${@:2}" | tr '\n' ' ' | sed 's/ $//')
    [ "$got" = "$1" ] || complain "${*:2}: '$got', not '$1'"
}
after 'fast balanced best' saga encode vectors --preset ''
after presets saga help pre
after 'balanced best' saga encode vectors --preset b
after 'room ring' saga synth x --scene ''
after '0 1 2 3' saga encode vectors --level ''
after 'no-hyperprior,no-parent' saga encode vectors --ablate no-hyperprior,no-p
after '' saga encode vectors --primitives ''
after vectors/MANIFEST saga encode vectors --log vectors/M
# Each value that the help gives as a|b|c must be offered by each shell.
for c in $commands; do
    "$at/bin/saga" help "$c" --all |
        sed -nE "s/^  --([a-z-]+) ([a-z0-9]+[|][^ ]*).*/$c \1 \2/p"
done >"$tmp/sets"
[ "$(wc -l <"$tmp/sets")" -ge 4 ] || complain "sets: $(cat "$tmp/sets")"
while read -r c o value _; do
    after "${value//|/ }" saga "$c" x "--$o" ''
    sed -n "/^$c)/,/;;/p" "$share/zsh/site-functions/_saga" | grep -F -e \
        "'*--$o[" | grep -qF "(${value//|/ })" || complain "zsh: $c --$o"
    grep -F "from $c'" "$share/fish/vendor_completions.d/saga.fish" |
        grep -qF -e "-l $o -x -a '${value//|/ }'" || complain "fish: $c --$o"
done <"$tmp/sets"
verdict pages

# ---- uninstall
: >"$at/bin/other"
: >"$share/man/man1/other.1"
: >"$tmp/root/opt/other"
python3 -m compileall -q "$share/saga/python"
"${MAKE:-make}" -s BUILD="$build" CC=gcc uninstall \
    DESTDIR="$tmp/root" PREFIX=/opt/saga >"$tmp/log" 2>&1 ||
    complain "make uninstall: $(tail -n 1 "$tmp/log")"
(cd "$tmp/root" && find . | sort) >"$tmp/there"
diff - "$tmp/there" >>"$bad" <<'LEFT'
.
./opt
./opt/other
./opt/saga
./opt/saga/bin
./opt/saga/bin/other
./opt/saga/share
./opt/saga/share/man
./opt/saga/share/man/man1
./opt/saga/share/man/man1/other.1
LEFT
verdict uninstall

all_passed
