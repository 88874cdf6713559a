#!/usr/bin/env bash
# A cohort of one case is killed at each of its output operations, at every other one before it and at the rest after half of it (in the run
# with the label "long" both ways at each): the same command goes on at once, the table is the same, and no lease is left. Third argument:
# libfail_output.so.
# Tests: lease.c
. "$(dirname "$0")/../cli/common.sh"
shim=$3
export OMP_WAIT_POLICY=passive FAIL_AT=0 FAIL_MODE=kill
shape='--shape ellipsoid -O edge=1.5'
fit="$shape --rotation 0,0,0 --spacing 1 --eps 1e-2 --cases cohort.csv --threads 1 -q"
expect 0 - sdmgen phantom $shape -p rx=3.3 -p ry=2.3 -p rz=1.5 --spacing 0.6 --seed 1 -o c.nii --label l.nrrd -q
printf 'id,image,label\na,l.nrrd,1\n' >cohort.csv
expect 0 - sdmgen fit $fit -o whole
expect 0 - sdmgen collect whole -o whole.csv -q

kills=0
for FAIL_MODE in kill half; do
    for FAIL_AT in $(seq 100); do
        if ! is_long && [ $FAIL_MODE = "$([ $((FAIL_AT % 2)) = 0 ] && echo kill || echo half)" ]; then continue; fi
        rm -rf killed
        (LD_PRELOAD=$shim exec "$program" fit $fit -o killed) >out 2>err
        code=$?
        [ $code != 0 ] || break # it has fewer operations
        # 6: the process that fits the case was killed, and the cohort tells that it failed
        [ $code = 137 ] || [ $code = 6 ] || bad "exit code $code when killed at $FAIL_AT: $(cat err)"
        kills=$((kills + 1))
        expect 0 - sdmgen fit $fit -o killed
        expect 0 - sdmgen collect killed -o killed.csv -q
        cmp whole.csv killed.csv || bad "another table after $FAIL_MODE at $FAIL_AT"
        absent killed/a/lease* killed/a/*.tmp
    done
done
least=10
if is_long; then least=20; fi
[ $kills -ge $least ] || bad "killed $kills times only"
rm -rf killed # temporary files of the list of cases may stay
finish
