#!/bin/sh
# test_sources.sh SOURCE_FOLDER: checks that every source file is listed by at least one test in its first comment ("Tests: bvh.c
# topology.c"), and that every listed name is that of a source file.
set -eu
root=$1
work=$(mktemp -d "${TMPDIR:-/tmp}/test_sources.XXXXXX")
trap 'rm -rf "$work"' EXIT

# named FOLDER: prints a line "TEST SOURCE" for each name between "Tests:" and the end of the comment
named() {
    (cd "$1" && find tests -type f \( -name '*.c' -o -name '*.sh' -o -name '*.py' \) ! -path 'tests/house/*' | sort | xargs awk '
        FNR == 1 { open = 0; done = 0 }
        done { next }
        /Tests:/ { open = 1; sub(/^.*Tests:/, "") }
        open {
            last = /\*\// || FILENAME ~ /[.](sh|py)$/ && !/^#/ && !/^ *[a-z]/
            n = split($0, word, /[^a-z0-9_.]+/)
            for (i = 1; i <= n; i++) if (word[i] ~ /^[a-z0-9_]+[.](c|cc)$/) print FILENAME, word[i]
            if (last) { open = 0; done = 1 }
        }')
}

check() {
    (cd "$1" && find framework shapes runtime trainer cli -name '*.c' -o -name '*.cc') | sed 's/^.*\///' | sort -u >"$work/sources"
    named "$1" >"$work/named"
    cut -d' ' -f2 "$work/named" | sort -u >"$work/names"
    comm -23 "$work/sources" "$work/names" | sed 's/$/: no file below tests names it after "Tests:"/'
    comm -13 "$work/sources" "$work/names" | while read -r name; do
        echo "$(awk -v n="$name" '$2 == n { print $1 }' "$work/named" | head -n 1): names $name, which is no source"
    done
}

found=$(check "$root")
if [ -n "$found" ]; then
    echo "$found"
    exit 1
fi
sources=$(grep -c . "$work/sources")
[ "$sources" -gt 100 ] || { echo "only $sources sources found in $root"; exit 1; }

# self-test: a source that no test lists and a listed name without a source are found
mkdir "$work/copy"
(cd "$root" && tar cf - framework shapes runtime trainer cli tests) | (cd "$work/copy" && tar xf -)
echo 'int nothing;' >"$work/copy/framework/core/untested.c"
[ "$(check "$work/copy")" = 'untested.c: no file below tests names it after "Tests:"' ] || { echo "self-test: a source without a test was not found"; exit 1; }
echo '/* Of nothing. Tests: untested.c gone.c */' >"$work/copy/tests/core/test_new.c"
[ "$(check "$work/copy")" = 'tests/core/test_new.c: names gone.c, which is no source' ] || { echo "self-test: a name without a source was not found"; exit 1; }
echo "$sources sources have tests"
