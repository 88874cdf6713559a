#!/usr/bin/env bash
# docs/symptoms.md: the program has the messages of its first columns; every key and option that it recommends exists. docs/fitting-doubtful.md: the same;
# every option of the guides to fits belongs to fit.
# Tests: help.c option_table.c schema.c
. "$(dirname "$0")/common.sh"
page=$source_folder/docs/symptoms.md
refused=$source_folder/docs/fitting-doubtful.md
guides=("$source_folder"/docs/fitting{,-points,-doubtful}.md)

# first column: texts in backticks, cut at "..." into pieces that are in the program
awk -F ' [|] ' '/^\| / && !/^\| you see/ { print $1 }' "$page" | grep -oE '`[^`]+`' | tr -d '`' | grep ' ' >messages
[ "$(wc -l <messages)" -ge 25 ] || bad "only $(wc -l <messages) messages found"
# the third column of the page on fits that are right, but refused
awk -F ' [|] ' '/^\| / { print $3 }' "$refused" | grep -oE '`[^`]+`' | tr -d '`' | grep ' ' >more
[ "$(wc -l <more)" -ge 5 ] || bad "only $(wc -l <more) messages found in its page"
cat more >>messages
unknown() { # unknown PROGRAM: the pieces of the messages that PROGRAM does not have
    sed 's/\.\.\./\n/g' messages | sed 's/^ *//; s/ *$//' | grep -E '.{4}' | while read -r piece; do
        grep -aqF -- "$piece" "$1" || echo "$piece"
    done
}
[ -z "$(unknown "$binary")" ] || bad "the program has no such message: $(unknown "$binary")"
[ -n "$(unknown /bin/true)" ] || bad 'messages are found where they are not'

# keys and options in the whole page
sdmgen config --keys >keys
sdmgen help --markdown >options
grep -oE '`(shape|grid|network|data|train|output)\.[a-z_]+' "$page" | tr -d '`' | sort -u | while read -r key; do
    grep -Eq "^ *$key( |$)" keys || echo "$key"
done >wrong
grep -oE -- '--[a-z][a-z-]+' "$page" | sort -u | while read -r option; do
    grep -qF -- "$option" options || echo "$option"
done >>wrong
sdmgen fit --help >options
sdmgen phantom --help >>options
grep -ohE -- '--[a-z][a-z-]+' "${guides[@]}" | sort -u | while read -r option; do
    grep -qF -- "$option " options || echo "$option of the guide"
done >>wrong
[ ! -s wrong ] || bad "no such keys or options: $(cat wrong)"
[ "$(grep -oE '`(grid|data|train)\.[a-z_]+' "$page" | wc -l)" -ge 10 ] || bad 'no keys found'
finish
