#!/bin/sh
# SPDX-License-Identifier: MIT
#
# help_pages.sh man|bash|zsh|fish PROGRAM: prints a manual page, or the
# completion for a shell. Both are made from the program's own --help, which
# saga prints from its tables of options, so that they never disagree with it.
set -eu

form=$1
program=$2
name=$(basename "$program")
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

"$program" --help >"$tmp/all"
# Only saga has commands; each is a line "  NAME ARGUMENTS  SUMMARY", where an
# argument is a word in capitals or an option.
if grep -q "^usage: $name COMMAND" "$tmp/all"; then
    sed -n '/^usage:/,/^  saga help/s/^  \([a-z][a-z]*\)  *[A-Z-].*/\1/p' \
        "$tmp/all" >"$tmp/commands"
else
    : >"$tmp/commands"
fi
while read -r c; do "$program" help "$c" --all >"$tmp/$c"; done <"$tmp/commands"

# table FILE: prints "NAME<tab>VALUE<tab>FIRST LINE OF ITS HELP<tab>CHOICES" for
# each option. The help may begin on the next line. The choices are the words of
# a VALUE such as a|b|c; or "*" if the VALUE is a file's name; or, if the VALUE
# is LIST, the first column of the list below its help.
table() {
    awk '
        function flush() {
            if (name) print name "\t" value "\t" help "\t" words
        }
        function choices(of) {
            if (of ~ /^(FILE|DIR|OUT|PATH)/) return "*"
            return of ~ /[|]/ ? of : ""
        }
        /^  --?[A-Za-z]/ {
            flush()
            name = $1
            rest = substr($0, 3 + length(name))
            value = rest ~ /^ [^ ]/ ? $2 : ""
            help = substr(rest, value == "" ? 1 : 2 + length(value))
            sub(/^ */, "", help)
            words = choices(value)
            gsub(/[|]/, " ", words)
            next
        }
        value == "LIST" && /^ +[a-z-]+  / {
            words = words (words == "" ? "" : " ") $1
        }
        name && help == "" { help = $0; sub(/^ */, "", help) }
        END { flush() }' "$1"
}

summary() { sed -nE "s/^  $1 +[A-Z-][^ ]*( [^ ]+)*  +(.*)/\2/p" "$tmp/all"; }

# ---- manual pages

# roff FILE: prints a command's help, without the usage line, as roff.
roff() {
    sed 1,2d "$1" | sed 's/\\/\\e/g; s/-/\\-/g' | awk '
        function text(line) {
            if (paragraph) print ".PP"
            paragraph = 0
            print (line ~ /^[.'"'"']/ ? "\\&" : "") line
        }
        function example(on) {
            if (on && paragraph) print ".PP"
            if (on) paragraph = 0
            if (on != nf) print on ? ".nf" : ".fi"
            nf = on
        }
        /^  \\-/ {
            example(0)
            paragraph = 0
            print ".TP"
            rest = substr($0, 3)
            n = match(rest, /  +/)
            if (n == 0) n = length(rest) + 1
            print ".B " substr(rest, 1, n - 1)
            indent = n + RLENGTH + 1
            rest = substr(rest, n)
            sub(/^ */, "", rest)
            if (rest != "") text(rest)
            option = 1
            next
        }
        /^$/ { example(0); paragraph = 1; option = 0; next }
        option {
            line = $0
            sub(/^ */, "", line)
            # A list in the help of an option keeps its lines.
            if (line ~ /  /) print ".br"
            text(line)
            next
        }
        { example(/^  /); text($0) }
        END { example(0) }'
}

man() {
    release=$("$program" --version | sed 's/^[^ ]* \([0-9.]*\).*/\1/')
    about=$(sed '/^usage:/d; /^  /d; /^$/d' "$tmp/all" | head -n 1)
    upper=$(echo "$name" | tr a-z A-Z)
    echo ".TH $upper 1 \"\" \"saga $release\" \"User commands\""
    echo ".SH NAME"
    case $name in
    saga) echo "saga \\- volumetric video in small files" ;;
    *) echo "$name \\- ${about%.}" | sed 's/- D/- d/' ;;
    esac
    echo ".SH SYNOPSIS"
    echo ".nf"
    sed -n '/^usage:/,/^$/p' "$tmp/all" |
        sed '/^$/d; s/^usage: //; s/^  *//; s/-/\\-/g'
    echo ".fi"
    echo ".SH DESCRIPTION"
    if [ -s "$tmp/commands" ]; then
        sed '/^usage:/,$d' "$tmp/all"
        while read -r c; do
            echo ".SH COMMAND $c" | tr a-z A-Z
            echo ".B $(sed -n '1s/^usage: //p' "$tmp/$c" | sed 's/-/\\-/g')"
            echo ".PP"
            roff "$tmp/$c"
        done <"$tmp/commands"
        echo ".SH EXAMPLES"
        echo ".nf"
        sed -n '/^First steps:/,/^On small/p' "$tmp/all" | sed -n 's/^  //p' |
            sed 's/\\/\\e/g; s/-/\\-/g'
        echo ".fi"
        others="saga-dec (1), saga-play"
    else
        sed '/^usage:/,/^$/d' "$tmp/all" | sed '1i\\n' >"$tmp/rest"
        sed '/^Exit status/,$d' "$tmp/rest" >"$tmp/options"
        roff "$tmp/options"
        others="saga"
    fi
    echo ".SH EXIT STATUS"
    sed -n '/^Exit status/,$p' "$tmp/all" | sed 's/^Exit status: //'
    echo ".SH SEE ALSO"
    echo ".BR $others (1)"
}

# ---- completion

# topics: prints the words that `help` explains besides the commands.
topics() { sed -n 's/^  '"$name"' help \([a-z][a-z]*\) .*/\1/p' "$tmp/all"; }

# words FILE: prints the names of its options in one line.
words() { table "$1" | cut -f 1 | tr '\n' ' ' | sed 's/ $//'; }

# bash_values FILE PATTERN: prints the branches of a case that complete the
# values of options. Their patterns begin with PATTERN. An option that takes any
# number or word has no branch.
bash_values() {
    table "$1" | awk -F '\t' -v before="$2" -v quote="'" '
        $2 == "" { next }
        !($1 in words) { names[n++] = $1 }
        !($1 in words) || $4 != "" { words[$1] = ($2 == "LIST" ? "," : "") $4 }
        END {
            for (i = 0; i < n; i++) {
                key = words[names[i]]
                if (!(key in all)) keys[m++] = key
                all[key] = all[key] " | " quote before names[i] quote
            }
            for (i = 0; i < m; i++) {
                key = keys[i]
                print "    " substr(all[key], 4) ")"
                if (key == "*") {
                    print "        COMPREPLY=($(compgen -f -- \"$cur\"))"
                } else if (key ~ /^,/) {
                    print "        local last=${cur##*,}"
                    print "        COMPREPLY=($(compgen -P" \
                        " \"${cur%\"$last\"}\" -W " quote substr(key, 2) quote \
                        " -- \"$last\"))"
                } else if (key != "") {
                    print "        COMPREPLY=($(compgen -W " quote key quote \
                        " -- \"$cur\"))"
                }
                print "        return ;;"
            }
        }'
}

bash_completion() {
    echo "# Made by tools/help_pages.sh."
    echo "_$(echo "$name" | tr - _)() {"
    echo "    local cur=\${COMP_WORDS[COMP_CWORD]} words="
    echo "    local before=\${COMP_WORDS[COMP_CWORD - 1]}"
    if [ -s "$tmp/commands" ]; then
        echo "    case \"\${COMP_WORDS[1]} \$before\" in"
        while read -r c; do bash_values "$tmp/$c" "$c "; done <"$tmp/commands"
    else
        echo "    case \$before in"
        bash_values "$tmp/all" ""
    fi
    echo "    esac"
    if [ -s "$tmp/commands" ]; then
        echo "    if [ \"\$COMP_CWORD\" = 1 ]; then"
        echo "        words='$(tr '\n' ' ' <"$tmp/commands")help --version'"
        echo "    else"
        echo "        case \${COMP_WORDS[1]} in"
        while read -r c; do
            echo "        $c) words='$(words "$tmp/$c") --help' ;;"
        done <"$tmp/commands"
        echo "        help) words='$(tr '\n' ' ' <"$tmp/commands")$(topics)' ;;"
        echo "        esac"
        echo "    fi"
    else
        echo "    words='$(words "$tmp/all") --help'"
    fi
    echo "    case \$cur in"
    echo "    -*) ;;"
    echo "    *) COMPREPLY=(\$(compgen -f -- \"\$cur\")) ;;"
    echo "    esac"
    echo "    COMPREPLY+=(\$(compgen -W \"\$words\" -- \"\$cur\"))"
    echo "}"
    echo "complete -o filenames -F _$(echo "$name" | tr - _) $name"
}

# zsh_options FILE: prints the arguments for _arguments, one on each line.
zsh_options() {
    table "$1" | sed "s/'//g; s/\[/(/g; s/\]/)/g; s/:/ /g" |
        awk -F '\t' '{
            after = $4 == "*" ? "_files" : $4 == "" ? " " : $2 == "LIST" ? \
                "_sequence compadd - " $4 : "(" $4 ")"
            sub(/.*[|].*/, "one", $2)
            printf "        '"'"'*%s[%s]%s'"'"' \\\n", $1, $3, \
                $2 == "" ? "" : ":" $2 ":" after }'
    echo "        '*:file:_files'"
}

zsh_completion() {
    echo "#compdef $name"
    echo "# Made by tools/help_pages.sh."
    if [ ! -s "$tmp/commands" ]; then
        echo "_arguments \\"
        zsh_options "$tmp/all"
        return
    fi
    echo "if ((CURRENT == 2)); then"
    echo "    local -a commands=("
    while read -r c; do
        echo "        '$c:$(summary "$c" | sed "s/'//g")'"
    done <"$tmp/commands"
    echo "    )"
    echo "    _describe command commands"
    echo "    return"
    echo "fi"
    echo "case \${words[2]} in"
    while read -r c; do
        echo "$c)"
        echo "    _arguments \\"
        zsh_options "$tmp/$c"
        echo "    ;;"
    done <"$tmp/commands"
    echo "esac"
}

# fish_options FILE CONDITION: prints a `complete` command for each option,
# which fish offers if CONDITION holds.
fish_options() {
    table "$1" | sed "s/'//g" | awk -F '\t' -v p="$name" -v when="$2" '{
        flag = $1 ~ /^--/ ? " -l " substr($1, 3) : " -s " substr($1, 2)
        takes = $2 == "" ? "" : $4 == "*" ? " -r" : " -x"
        if ($4 != "" && $4 != "*") takes = takes " -a '"'"'" $4 "'"'"'"
        print "complete -c " p when flag takes \
            " -d '"'"'" $3 "'"'"'" }'
}

fish_completion() {
    echo "# Made by tools/help_pages.sh."
    if [ ! -s "$tmp/commands" ]; then
        fish_options "$tmp/all" ""
        return
    fi
    while read -r c; do
        echo "complete -c $name -n __fish_use_subcommand -a $c -d" \
            "'$(summary "$c" | sed "s/'//g")'"
        fish_options "$tmp/$c" " -n '__fish_seen_subcommand_from $c'"
    done <"$tmp/commands"
}

case $form in
man) man ;;
bash) bash_completion ;;
zsh) zsh_completion ;;
fish) fish_completion ;;
*) echo "help_pages.sh man|bash|zsh|fish PROGRAM" >&2; exit 2 ;;
esac
