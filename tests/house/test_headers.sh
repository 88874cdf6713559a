#!/bin/sh
# test_headers.sh SOURCE_FOLDER VERSION CC CXX: checks that every header in include/sdm/ compiles on its own, also if included twice, as C11
# and as C++17, that sdm/sdmgen.h lists and includes every header for users, and that the version in sdm/export.h is that of the build.
set -eu
root=$1 version=$2 cc=$3 cxx=$4
work=$(mktemp -d "${TMPDIR:-/tmp}/test_headers.XXXXXX")
trap 'rm -rf "$work"' EXIT

compile() { # compile HEADER INCLUDE_FOLDER...
    include=$1
    shift
    flags="-Wall -Wextra -Wpedantic -Werror -fsyntax-only"
    for folder; do flags="$flags -I$folder"; done
    printf '#include "%s"\n#include "%s"\nint only_line;\n' "$include" "$include" >"$work/alone.c"
    cp "$work/alone.c" "$work/alone.cc"
    $cc -std=c11 -Wstrict-prototypes $flags "$work/alone.c" && $cxx -std=c++17 $flags "$work/alone.cc"
}

count=0
for header in "$root"/*/include/sdm/*.h "$root"/*/include/sdm/internal/*.h; do
    folder=${header%%/include/sdm/*}/include
    name=sdm/${header#*/include/sdm/}
    compile "$name" "$folder" "$root/framework/include" "$root/shapes/include" || { echo "$header does not compile alone"; exit 1; }
    # headers with functions must be callable from C++
    if grep -Eq '^(SDM_API|SDM_INTERNAL_API|sdm_status sdm_)' "$header" && ! grep -q '^extern "C" {' "$header"; then
        echo "$header has functions and no extern \"C\""
        exit 1
    fi
    count=$((count + 1))
done
[ "$count" -ge 15 ] || { echo "only $count headers found in $root"; exit 1; }

# missing_in FILE: the headers for users that FILE, the header that includes all, does not include or does not list in its first comment
missing_in() {
    for header in "$root"/*/include/sdm/*.h; do
        name=sdm/${header##*/}
        [ "$name" = sdm/sdmgen.h ] && continue
        grep -q "^#include \"$name\"$" "$1" && sed '/\*\//q' "$1" | grep -q " $name " || echo "$name"
    done
}
all=$root/runtime/include/sdm/sdmgen.h
[ -z "$(missing_in "$all")" ] || { echo "sdm/sdmgen.h does not include or list: $(missing_in "$all")"; exit 1; }
# self-test: a header that is not included and one that is not listed are found
sed '/^#include "sdm\/fit.h"/d; s/ sdm\/grid.h / /' "$all" >"$work/less.h"
[ "$(missing_in "$work/less.h" | tr '\n' ' ')" = 'sdm/grid.h sdm/fit.h ' ] || { echo "headers missing in sdm/sdmgen.h were not found"; exit 1; }

# the example in its first comment compiles
{
    printf '#include "sdm/sdmgen.h"\n#include <stdio.h>\n#include <stdlib.h>\nint main(void) {\n'
    sed -n '/distance at a point:$/,/\*\//{ s/^ \*//; s/ \*\/$//; /:$/d; p; }' "$all"
    printf 'return 0; }\n'
} >"$work/example.c"
grep -q 'sdm_generate(model' "$work/example.c" || { echo "no example in sdm/sdmgen.h"; exit 1; }
$cc -std=c11 -Wall -Wextra -Wpedantic -Werror -fsyntax-only -I"$root/framework/include" -I"$root/runtime/include" -I"$root/shapes/include" \
    "$work/example.c" || { echo "the example in sdm/sdmgen.h does not compile"; exit 1; }

# sdm/shape.h, the header for plug-ins, must not include other headers of the project
mkdir -p "$work/alone/sdm"
cp "$root/framework/include/sdm/shape.h" "$work/alone/sdm/"
compile sdm/shape.h "$work/alone" || { echo "sdm/shape.h needs other headers"; exit 1; }

# self-test: a header that lacks an #include is found
mkdir -p "$work/bad/sdm"
echo 'size_t leans_on_stddef(void);' >"$work/bad/sdm/bad.h"
if compile sdm/bad.h "$work/bad" 2>"$work/said"; then
    echo "a header that does not compile alone went through"
    exit 1
fi

printf '#include "sdm/export.h"\nsaid SDM_VERSION_TEXT SDM_VERSION_MAJOR.SDM_VERSION_MINOR.SDM_VERSION_PATCH\n' >"$work/version.c"
said=$($cc -E -P -I"$root/framework/include" "$work/version.c" | grep '^said' | tr -d ' "')
[ "$said" = "said$version$version" ] || { echo "sdm/export.h says $said, the build $version"; exit 1; }
echo "$count headers compile alone; version $version"
