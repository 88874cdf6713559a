#!/bin/sh
# test_symbols.sh SOURCE_FOLDER LIBRARY.so...: checks that the shared libraries export exactly the functions listed in exported.txt, and
# that the headers declare the same functions.
# A line of the list is one of
# LIBRARY FUNCTION (public: declared with SDM_API in an installed header)
# LIBRARY FUNCTION internal (for the other libraries of the project: declared with SDM_INTERNAL_API in a header that is not installed)
set -eu
root=$1
shift
list=$root/tests/house/exported.txt
work=$(mktemp -d "${TMPDIR:-/tmp}/test_symbols.XXXXXX")
trap 'rm -rf "$work"' EXIT

# ignore names that begin with _ or a dot: C++ templates of OpenVDB (_Z...) have to be visible
for file; do
    name=${file##*/lib}
    nm -D -P --defined-only "$file" | awk -v name="${name%%.so*}" '$2 ~ /^[TDBR]$/ && $1 !~ /^[_.]/ { print name, $1 }'
done | sort >"$work/exported"
awk '{ print $1, $2 }' "$list" | sort >"$work/listed"
if ! diff "$work/listed" "$work/exported" >"$work/diff"; then
    echo "exported symbols differ from tests/house/exported.txt (< listed, > exported):"
    cat "$work/diff"
    exit 1
fi

# declared MACRO: reads headers from standard input, prints the names of all functions whose declaration begins with MACRO
declared() {
    tr '\n' ' ' | grep -oE "(^|[^A-Z_])$1 [^;{]*" | grep -oE 'sdm_[a-z0-9_]+\(' | tr -d '(' | sort -u
}
cat "$root"/*/include/sdm/*.h | declared SDM_API >"$work/public"
cat "$root"/*/include/sdm/internal/*.h "$root"/framework/io/*.h | declared SDM_INTERNAL_API >"$work/internal"
awk '$3 == "" { print $2 }' "$list" | sort >"$work/listed_public"
awk '$3 == "internal" { print $2 }' "$list" | sort >"$work/listed_internal"
diff "$work/listed_public" "$work/public" || { echo "SDM_API in the installed headers differs from exported.txt (< listed, > declared)"; exit 1; }
diff "$work/listed_internal" "$work/internal" || { echo "SDM_INTERNAL_API differs from exported.txt (< listed, > declared)"; exit 1; }
public=$(wc -l <"$work/public")
[ "$public" -le 150 ] || { echo "$public public functions, at most 150 are meant to be"; exit 1; }
grep -q "at most 150 functions" "$root/CONTRIBUTING.md" || { echo "CONTRIBUTING.md gives another limit than 150 functions"; exit 1; }
grep -q "for users ($public functions)" "$root/docs/architecture.md" || { echo "docs/architecture.md gives another number than $public functions"; exit 1; }
echo "$public public functions, $(wc -l <"$work/internal") internal ones exported"
