#!/usr/bin/env bash
# Two processes share the cases of a cohort, and are killed at random: no case is lost, none is done twice, and the table is the same.
# tests/cluster/cohort_kill.sh kills more often.
# Tests: lease.c cohort_run.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive
kills=3
cases=12

shape='--shape ellipsoid -O edge=1.5'
fit="$shape --rotation 0,0,0 --spacing 1 --eps 1e-2"
for i in 1 2 3 4; do
    expect 0 - sdmgen phantom $shape -p rx=3.$i -p ry=2.$i -p rz=1.5 --spacing 0.6 --seed $i -o c.nii --label l$i.nrrd -q
done
{
    echo id,image,label
    for i in $(seq "$cases"); do echo "c$i,l$((i % 4 + 1)).nrrd,1"; done
} >cohort.csv
expect 0 - sdmgen fit $fit --cases cohort.csv -o whole -q
expect 0 - sdmgen collect whole -o whole.csv -q

# twice LOG...: the cases that were done more than once, as the processes told
twice() { cat "$@" | sed -n 's/^sdmgen: case [0-9]* of [0-9]*, \(c[0-9]*\): accepted.*/\1/p' | sort | uniq -d; }

# Two processes, from the start: each case is done by one of them.
worker() { exec "$program" fit $fit --cases cohort.csv -o "$1" --claim >"$2.out" 2>"$2"; }
worker shared a.log &
a=$!
worker shared b.log &
b=$!
wait $a && wait $b || bad "workers failed: $(cat a.log b.log)"
[ "$(cat a.log b.log | grep -c accepted)" = "$cases" ] || bad "not each case once: $(cat a.log b.log)"
[ -z "$(twice a.log b.log)" ] || bad "done twice: $(twice a.log b.log)"
expect 0 - sdmgen collect shared -o shared.csv -q
cmp whole.csv shared.csv || bad 'the table of two processes differs'

# Killed at random while others work: SIGKILL of a process also ends its fit.
RANDOM=7
n=0
while [ $n -lt "$kills" ]; do
    [ ! -d killed ] || [ $((n % 5)) != 4 ] || rm -r killed
    logs=()
    for k in 1 2; do
        worker killed kill.$n.$k.log &
        pids[k]=$!
        logs+=(kill.$n.$k.log)
    done
    sleep "$(awk -v r=$RANDOM 'BEGIN { print r / 32768 * 1.2 }')"
    kill -KILL "${pids[1]}" 2>err
    n=$((n + 1))
    [ $((n % 2)) = 0 ] || kill -KILL "${pids[2]}" 2>err
    wait "${pids[1]}" "${pids[2]}" 2>err
    [ -z "$(twice "${logs[@]}")" ] || bad "done twice: $(twice "${logs[@]}")"
done
expect 0 - sdmgen fit $fit --cases cohort.csv -o killed --claim -q
has "^$cases cases: $cases accepted, 0 refused, 0 failed, 0 with other processes"
expect 0 - sdmgen collect killed -o killed.csv -q
cmp whole.csv killed.csv || bad 'the table after kills differs'
left=$(find killed \( -name 'lease*' -o -name '*.tmp' \))
[ -z "$left" ] || bad "left over: $left"
finish
