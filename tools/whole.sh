#!/bin/sh
# SPDX-License-Identifier: MIT
#
# whole.sh WEB: prints the page of WEB with its style sheet, its modules and the
# decoder in it, so that it needs no other file. `saga export` and the page's
# button put the film, its name and a poster into the empty places.
set -eu
web=$1

# The page and its workers share one script. Each module becomes a function that
# runs when it is first needed and returns what the module exports.
link() {
    echo 'const made = {};'
    echo 'const need = (name) => made[name] ??= modules[name]();'
    echo 'const modules = {'
    for f in "$web"/*.js; do
        awk -v name="${f##*/}" '
            function import(text,   from) {
                from = text
                sub(/^[^\047]*\047\.\//, "", from)
                sub(/\047;$/, "", from)
                sub(/^import */, "", text)
                sub(/ *(from )?\047.*/, "", text)
                sub(/^\* as /, "", text)
                gsub(/ as /, ": ", text)
                print (text == "" ? "" : "const " text " = ") \
                    "need(\047" from "\047);"
            }
            function export(text,   word) {
                sub(/^export /, "", text)
                if (text ~ /^{/) {
                    gsub(/[{};]/, "", text)
                    names = names text ", "
                    return
                }
                word = text
                sub(/^(async )?(const|function|class) *\*?/, "", word)
                match(word, /^[A-Za-z_$][A-Za-z_$0-9]*/)
                names = names substr(word, 1, RLENGTH) ", "
                print text
            }
            BEGIN { print "\047" name "\047() {" }
            /^\/\// { next }
            held != "" || /^import[ {]/ {
                held = held (held == "" ? "" : " ") $0
                if (/;$/) { import(held); held = "" }
                next
            }
            /^export / { export($0); next }
            { print }
            END { print "return { " names "};\n}," }
        ' "$f"
    done
    echo '};'
    echo 'need(globalThis.document ? "page.js" : "worker.js");'
}

# A page that carries everything allows nothing else to be fetched.
policy="default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; \
worker-src data:; connect-src data:; img-src data:; media-src blob:; \
style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"

while IFS= read -r line; do
    case $line in
    *SPDX*) echo '<!-- SPDX-License-Identifier of the player: MIT -->' ;;
    '<html '*) echo '<html lang="en" data-state="loading">' ;;
    '<meta charset'*)
        echo "$line"
        echo "<meta http-equiv=\"Content-Security-Policy\" content=\"$policy\">"
        ;;
    '<title>'*) echo '<title></title>' ;;
    '<link rel="modulepreload"'*) ;;
    '<link rel="stylesheet"'*)
        echo '<style>'
        sed 's/^ *//; /^$/d; /SPDX/d' "$web/page.css"
        echo '</style>'
        ;;
    *'id="carried"'*)
        echo '<script type="application/json" id="carried"></script>'
        ;;
    *'src="page.js"'*)
        echo '<script type="module" id="code">'
        link
        echo '</script>'
        ;;
    '<main '*)
        echo "$line"
        echo '<img id="poster" alt="" src="">'
        ;;
    '</body>')
        printf '<script type="text/plain" id="decoder">'
        gzip -9nc "$web/saga_simd.wasm" | base64 | tr -d '\n'
        echo '</script>'
        echo '<script type="text/plain" id="film"></script>'
        echo "$line"
        ;;
    *) printf '%s\n' "$line" ;;
    esac
done <"$web/index.html"
