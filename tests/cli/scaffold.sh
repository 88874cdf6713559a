#!/usr/bin/env bash
# sdmgen shapes new: a new plug-in builds against the installed package and against the build folder and passes its own tests, which find
# faults; refusals. Third argument: the build folder.
# Tests: shapes_new.c
build=$3
. "$(dirname "$0")/common.sh"
installed=$(realpath ../files-of-consume/prefix)

# The example is what the program writes; another name changes names alone.
expect 0 - sdmgen shapes new pebble
diff -r pebble "$source_folder/examples/pebble" || bad "shapes new does not write examples/pebble"
expect 0 - sdmgen shapes new knob_2 --out "new folder"
for file in CMakeLists.txt knob_2.c knob_2.yaml test_knob_2.c; do present "new folder/$file"; done
grep -rq pebble "new folder" && bad "the name of the example is left in the new shape"
cat "new folder"/* | sed s/knob_2/pebble/g | diff - <(cat pebble/*) || bad "more than names differ"

expect 0 - sdmgen shapes new json --json
has '^\{"folder": "json", "prefix": "/.*", "files": \["CMakeLists.txt", "json.c", "json.yaml", "test_json.c"\]\}$'

# The commands that it prints work.
expect 0 - "$installed/bin/sdmgen" shapes new mug
has "^  cmake -S mug -B mug/build -DCMAKE_PREFIX_PATH=$installed\$"
sed -n 's/^  //p' out >commands
expect 0 - env PATH="$installed/bin:$PATH" bash -ec "$(grep -v 'sdmgen train' commands)" # its test trains
has '100% tests passed, 0 tests failed out of 4'
for file in mug.png mug-slices.png; do present $file; done
grep -qx "sdmgen shapes check mug -o mug.png --plugin mug/build/mug.so" commands || bad "no command for a picture of the shapes: $(cat commands)"
expect 0 '^sdmgen: grid: size: ' sdmgen config mug/mug.yaml --plugin mug/build/mug.so

# Against the build folder, and with faults that its test must find.
mutant() { # mutant PATTERN SED: with this change of knob_2.c the test of the mesh fails with the message
    sed "$2" pebble/pebble.c | sed s/pebble/knob_2/g >"new folder/knob_2.c"
    cmake --build by-build >log 2>&1 || bad "build: $(tail -n 5 log)"
    ctest --test-dir by-build -R mesh --output-on-failure >log 2>&1 && bad "the test did not find: $2"
    grep -Eq "$1" log || bad "no '$1' in $(tail -n 20 log)"
}
cmake -S "new folder" -B by-build -DCMAKE_PREFIX_PATH="$build" >log 2>&1 || bad "configure: $(tail -n 5 log)"
mutant 'clockwise' 's/face(tri, a, b, c)/face(tri, a, c, b)/; s/tri\[1\] = b, tri\[2\] = c/tri[1] = c, tri[2] = b/'
mutant 'not closed: [0-9]+ edges' 's/top + next, end)/top + next, j < 3 ? first : end)/'
more='s/reserve(host, out, TUBE_VERTICES(RINGS)/&+(p[TAPER]>0.1)/'
mutant 'vertex [0-9]+ has a coordinate that is not finite, or was never written' "$more"
mutant 'mesh\(\) has written beyond the 737 vertices that it reserved' 's/TUBE_VERTICES(RINGS)/& - 1/'
mutant 'vertices, elsewhere' "$more; s/if (failed) return failed;/& for (size_t i = 0; i < 3 * out->n_vert; i++) out->vert[i] = 0;/"

# Refusals; nothing is left.
expect 1 '^sdmgen: error: mug exists already: .* --out' sdmgen shapes new mug
expect 1 'nowhere/x: No such file' sdmgen shapes new mug --out nowhere/x
expect 2 "'Mug' is no name: names are a small letter" sdmgen shapes new Mug
expect 2 "'a-b' is no name" sdmgen shapes new a-b
expect 2 "'test' is the name of a target of CMake" sdmgen shapes new test
expect 2 "there is a shape 'torus' already" sdmgen shapes new torus
expect 2 "usage: sdmgen shapes new NAME" sdmgen shapes new
expect 2 "shapes new takes no -O and no -o" sdmgen shapes new other -O a=1
expect 2 "shapes new takes no -O and no -o" sdmgen shapes new other -o x.png
expect 2 "unexpected argument 'b'" sdmgen shapes new other b
expect 2 "usage: sdmgen shapes check NAME" sdmgen shapes check
expect 2 "unexpected argument 'b'; usage" sdmgen shapes a b
expect 2 'out needs .shapes new' sdmgen shapes torus --out x
expect 1 'File too large' bash -c 'trap "" XFSZ; ulimit -f 1; "$0" shapes new big' "$program"
absent other Mug a-b test torus a x nowhere big

# A shape that is called like a subcommand is described by its name alone.
sed s/pebble/new/g pebble/pebble.c >new.c
cc -shared -fPIC -I"$installed/include" new.c -o new.so -lm || bad "the plug-in new.so was not built"
expect 0 - sdmgen shapes new --plugin ./new.so
has '^  taper '
finish
