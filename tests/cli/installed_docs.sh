#!/usr/bin/env bash
# The installed documentation: every relative link leads to an installed file and to a heading in it. Third argument: the build folder to install from.
. "$(dirname "$0")/common.sh"
build=$3
cmake --install "$build" --prefix "$PWD/prefix" >log 2>&1 || bad "install: $(tail -n 3 log)"
find prefix -name '*.md' >pages
[ "$(wc -l <pages)" -ge 15 ] || bad "few pages: $(cat pages)"

# anchors PAGE: the anchors of its headings: small letters, without punctuation, hyphens for spaces
anchors() {
    sed -n '/^```/,/^```/d; s/^#\{1,6\} //p' "$1" | tr '[:upper:] ' '[:lower:]-' | tr -cd '[:alnum:]_\n-'
}

links=0
while read -r page; do
    while read -r link; do
        links=$((links + 1))
        [ -e "$(dirname "$page")/$link" ] || bad "$page: dead link $link"
    done < <(grep -oE '\]\([^)# ]+' "$page" | sed 's/^](//' | grep -vE '^(https?|mailto):')
    while IFS='#' read -r link anchor; do
        target=$page
        [ -z "$link" ] || target=$(dirname "$page")/$link
        anchors "$target" | grep -qx -- "$anchor" || bad "$page: no heading $link#$anchor"
    done < <(grep -oE '\]\([^):]*#[^) ]+' "$page" | sed 's/^](//')
done <pages
[ "$links" -ge 60 ] || bad "only $links links"
grep -q 'share/sdmgen' prefix/share/doc/*/README.md || bad 'README.md does not name the folder of examples and configurations'
finish
