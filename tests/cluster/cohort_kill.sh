#!/usr/bin/env bash
# A cohort of 40 phantoms in 1, 2 and 7 parts at the same time, and with two processes that share the cases (--claim). A process is killed 50
# times each at a random time, and all start again: no case is lost, none is done twice, the table has the bits of one call without kills.
# SDMGEN_KILLS: another number than 50. SDMGEN_CASES: another number than 40.
# Tests: lease.c cohort_run.c cohort_record.c
. "$(dirname "$0")/../cli/common.sh"
export OMP_WAIT_POLICY=passive
kills=${SDMGEN_KILLS:-50}
cases=${SDMGEN_CASES:-40}
RANDOM=7

shape='--shape ellipsoid -O edge=1.5'
fit="$shape --rotation 0,0,0 --spacing 1 --eps 1e-2"
echo id,image,label >cohort.csv
for i in $(seq "$cases"); do
    expect 0 - sdmgen phantom $shape -p rx=3.$((100 + 20 * i)) -p ry=2.$((100 + 7 * i % 40 * 20)) -p rz=1.$((400 + 11 * i % 40 * 10)) --spacing 0.6 \
        --seed "$i" -o c.nii --label "l$i.nrrd" -q
    echo "c$i,l$i.nrrd,1" >>cohort.csv
done
duration=$(date +%s%N)
expect 0 - sdmgen fit $fit --cases cohort.csv -o whole --threads 1 -q
duration=$(awk -v ns=$(($(date +%s%N) - duration)) 'BEGIN { print 1e-9 * ns }') # s
expect 0 - sdmgen collect whole -o whole.csv -q

# worker WHICH LOG: a process of the present way: a part such as 3/7, or `claim`
worker() {
    local which=(--part "$1")
    [ "$1" != claim ] || which=(--claim)
    exec "$program" fit $fit --cases cohort.csv -o killed --threads 1 "${which[@]}" >/dev/null 2>>"$2"
}
told() { cat killed.*.log | sed -n 's/^sdmgen: case [0-9]* of [0-9]*, \(c[0-9]*\): accepted.*/\1/p' | sort; }

# check_whole: the cohort is done: each case once, the same table, nothing left over
check_whole() {
    local left
    cohorts=$((cohorts + 1))
    twice=$((twice + $(told | uniq -d | wc -l)))
    [ -z "$(told | uniq -d)" ] || bad "$way: done twice: $(told | uniq -d)"
    # the last message of a process that is killed may be missing
    [ "$(told | wc -l)" -ge $((cases - killed_here)) ] || bad "$way: of $cases cases $(told | wc -l) were told"
    expect 0 - sdmgen collect killed -o killed.csv -q
    cmp whole.csv killed.csv || bad "$way: the table after kills differs"
    left=$(find killed -mindepth 2 \( -name '*.tmp' -o -name 'lease*' \))
    [ -z "$left" ] || bad "$way: left over: $left"
    rm -rf killed killed.*.log
    killed_here=0
}

# try WAY WORKER...: starts the workers that have not ended well, kills one of them, and so on, until there were enough kills
try() {
    local todo again pids codes victim k code n=0
    way=$1 cohorts=0 twice=0 killed_here=0
    shift
    rm -rf killed killed.*.log
    todo=("$@")
    while [ $n -lt "$kills" ] || [ ${#todo[@]} -lt $# ] || [ -e killed ]; do
        pids=()
        for k in "${!todo[@]}"; do
            worker "${todo[$k]}" "killed.$k.log" &
            pids[k]=$!
        done
        codes=()
        if [ $n -lt "$kills" ]; then
            victim=$((RANDOM % ${#todo[@]}))
            sleep "$(awk -v d="$duration" -v r=$RANDOM -v all=$# 'BEGIN { print d * r / 32768 / (all > 1 ? 12 : 6) }')"
            kill -KILL "${pids[$victim]}" 2>err
            wait "${pids[$victim]}" 2>err # first: the shell tells of it otherwise
            codes[victim]=$?
        fi
        again=()
        for k in "${!todo[@]}"; do
            [ "${codes[$k]:-}" ] || { wait "${pids[$k]}" 2>err; codes[k]=$?; }
            code=${codes[$k]}
            [ $code = 0 ] || again+=("${todo[$k]}")
            [ $code != 137 ] || n=$((n + 1)) killed_here=$((killed_here + 1))
            case $code in 0 | 137) ;; *) bad "$way: exit code $code: $(tail -n 3 "killed.$k.log")" ;; esac
        done
        todo=("${again[@]}")
        # the other worker leaves out the case that the killed one had
        [ $1 != claim ] || [ ${#todo[@]} = 0 ] || todo=("$@")
        if [ ${#todo[@]} = 0 ]; then
            check_whole
            todo=("$@")
        fi
        [ $failures -lt 10 ] || break
    done
    printf '%-12s %6d %8d %12d\n' "$way" $n $cohorts $twice
}

printf '%-12s %6s %8s %12s   (%d cases, %.1f s by one call)\n' way kills cohorts 'done twice' "$cases" "$duration"
try '1 part' 1/1
try '2 parts' 1/2 2/2
try '7 parts' 1/7 2/7 3/7 4/7 5/7 6/7 7/7
try 'two workers' claim claim
echo "each cohort has the table of one call without kills; $failures failures; $SECONDS s"
finish
