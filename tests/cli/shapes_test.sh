#!/bin/bash
# sdmgen shapes test: one line for each test, the verdict as exit code, JSON, and mistakes on the command line.
# Tests: shapes_test.c only_shape.c
. "$(dirname "$0")/common.sh"
plugins=$(cd ../../plugins && pwd)
unfit=$plugins/unfit/unfit.so

expect 0 - sdmgen shapes test "$plugins/good/octahedron.so" --samples 8
has '^octahedron: the default shape, 2 corners of the ranges, 8 random shapes$'
[ "$(grep -cE '^(passed|skipped|doubtful|failed) +[a-z]+ +.' out)" -eq 11 ] || bad "not eleven tests: $(cat out)"
has '^fine: the shape keeps the contract'
expect 0 - sdmgen shapes test octahedron --plugin "$plugins/good/octahedron.so" --samples 8
expect 0 - sdmgen shapes test torus --samples 8
has '^skipped +outside'
expect 4 '^sdmgen: error: unfit_jump: 1 of 11 tests failed: maps, derivatives or trainings would suffer$' \
    sdmgen shapes test unfit_jump --plugin "$unfit" --samples 8
has '^failed +continuous vertex (8|9|1[0-5]) jumps by 0\.125 mm along size; at size=2\.0*[0-9]* reach=1\.[0-9]+$'
expect 3 'unfit_open: 1 of 11 tests failed: meshes are broken' sdmgen shapes test unfit_open --plugin "$unfit" --samples 8 --json
has '^\{"shape": "unfit_open", "verdict": "broken", "corners": 4, "samples": 8, "tests": \[\{"test": "meshes", "outcome": "passed"'
has '"test": "closed", "outcome": "failed", "figure": 3, "text": "[^"]*", "at": \{"size": '

# a cache of many meshes, which only another process shows: no jump
if [ $emulated = no ]; then
    sdmgen shapes test unfit_caches --plugin "$unfit" --samples 64 --threads 1 >out 2>err
    has "^failed +repeats +mesh\(\) depends on an earlier call: after a call in which only 'reach' differs"
    if grep -q '^failed *continuous' out; then bad "a cache is told as a jump: $(cat out)"; fi
fi

# vertices in metres: a hint, no failure
sed 's/p\[RADIUS\]/p[RADIUS] \/ 1000/g' "$source_folder/examples/plugin/octahedron.c" >metres.c
cc -shared -fPIC -I"$source_folder/framework/include" metres.c -o metres.so -lm || bad 'the plug-in metres.so was not built'
expect 0 - sdmgen shapes test ./metres.so --samples 4
has '^doubtful units +the shape is 0\.01 mm in size, 1 mm of the parameter .radius. moves its vertices by 0\.001 mm: are the vertices in m\? Multiply them by 1000$'
has '^fine: .*, with doubts$'

# a shape that crashes is tested to the end
expect 4 '1 of 11 tests failed' sdmgen shapes test picky --plugin "$unfit" --samples 8
has '^failed +options +with mode=abort: .*unfit\.so: mesh\(\): the plug-in called abort\(\)'

expect 2 '^sdmgen: error: shapes test: --plugin has 17 shapes: name one' sdmgen shapes test "$unfit"
expect 2 "unexpected argument 'more'" sdmgen shapes test torus more
expect 2 'o needs .shapes check' sdmgen shapes test torus -o x.png
expect 2 'usage: sdmgen shapes test NAME\|PLUGIN\.so' sdmgen shapes test
expect 2 "unknown shape 'toru'; did you mean 'torus'" sdmgen shapes test toru
expect 3 'no_symbol/plugin\.so: exports no function' sdmgen shapes test "$plugins/no_symbol/plugin.so"
expect 1 'missing\.so' sdmgen shapes test missing.so
finish
