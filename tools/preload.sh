#!/bin/sh
# SPDX-License-Identifier: MIT
#
# preload.sh WEB: prints the page of WEB with links to all modules that it needs
# from the start. Without them a browser finds out only level by level what
# modules import, each after another way to the server and back.
set -eu
web=$1

# The queue begins with page.js; each module adds what it imports.
modules='page.js'
queue=$modules
while [ -n "$queue" ]; do
    first=${queue%% *}
    queue=${queue#"$first"}
    queue=${queue# }
    for f in $(grep -v '^ *//' "$web/$first" | tr '\n' ' ' | tr ';' '\n' |
        sed -n "s/^ *import .*'\.\/\([a-z]*\.js\)'$/\1/p"); do
        case " $modules " in *" $f "*) continue ;; esac
        modules="$modules $f"
        queue="${queue:+$queue }$f"
    done
done

while IFS= read -r line; do
    printf '%s\n' "$line"
    case $line in *'src="page.js"'*)
        for f in ${modules#page.js }; do
            echo "<link rel=\"modulepreload\" href=\"$f\">"
        done ;;
    esac
done <"$web/index.html"
