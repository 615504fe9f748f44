#!/bin/sh
# SPDX-License-Identifier: MIT
#
# strip.sh FILE.js: prints a module without comments on lines of their own, but
# for the first line, and without indentation: a quarter of its bytes, also of
# the compressed ones. Such lines in our strings are comments as well, of GLSL.
sed '1!{/^ *\/\//d}; s/^ *//; /^$/d' "$1"
