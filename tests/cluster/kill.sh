#!/usr/bin/env bash
# One process of a training on 2 to 4 ranks is killed at a random time, 20 times each by fork, Open MPI and MPICH: all processes end within
# ten seconds, the cause is told once, and nothing is left behind, neither processes nor shared memory nor files; --resume with another
# number of ranks gives the model and the files of a training without interruption. Skipped (exit code 77) where no back-end is built.
# SDMGEN_KILLS: another number than 20.
# Tests: mpi_module.c comm_mpi.c comm_fork.c ranks.c
. "$(dirname "$0")/../cli/common.sh"
. "$(dirname "$0")/mpi_common.sh"
config=("$source_folder/tests/cli/tiny.yaml" train.steps=200 train.checkpoint_seconds=0.02)
kills=${SDMGEN_KILLS:-20}
RANDOM=7
# Open MPI puts its folder here, and a socket into it, whose name must be short
TMPDIR=$(mktemp -d /tmp/sdmgen-kill.XXXXXX)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
mark=SDMGEN_KILL_TEST=$$ # in the environment of all processes of a training, those of mpirun as well

# told HOW RANK RANKS: fails unless `err` tells once that the rank was killed.
told() {
    local text
    case $1 in
    fork) text="^sdmgen: error: rank $2 of $3 was killed by signal 9 \(Killed\): all ranks end$" ;;
    openmpi) # in rare cases it does not tell the rank
        text="process rank $2 with PID .* exited on signal 9"
        grep -q "$text" err || text='^a non-zero exit code\. Per user-direction, the job has been aborted\.'
        ;;
    mpich) text='EXIT CODE: 9$|process manager error waiting for completion$' ;; # the latter before all ranks have met
    esac
    [ "$(tr -d '\r' <err | grep -Ec "$text")" = 1 ] || bad "$1: rank $2 of $3 was killed, but the message is: $(cat err)"
    [ "$1" != fork ] || [ "$(wc -l <err)" = 1 ] || bad "not one line: $(cat err)"
    [ "$1" = fork ] || ! grep -q 'sdmgen: error' err || bad "$1: a rank tells more: $(cat err)"
}

# The processes of trainings of this test that run. A process that has ended stays in the list of the system, as a zombie without an
# environment, until its parent asks for its state. Those of mpirun become children of process 1 when it ends, which may take seconds to ask.
running() { grep -lsF "$mark" /proc/[0-9]*/environ | tr -dc '0-9\n'; }
# The files of shared memory and the folders that the libraries of MPI make.
traces() { ls -A /dev/shm; find "$TMPDIR" -mindepth 2; }
milliseconds() { echo $(($(date +%s%N) / 1000000)); }

# one_kill HOW: kills a rank of a training, and resumes
one_kill() {
    local how=$1 n=$((2 + RANDOM % 3)) victim pid all p began last left
    rm -rf killed
    traces >before
    victim=$((RANDOM % n))
    (export "${mark?}" && started "$how" $n "${config[@]}" --threads 1 --out killed) >err 2>&1 & # MPICH tells of it on stdout
    pid=$!
    for _ in $(seq 400); do
        mapfile -t all < <(ranks_of killed)
        [ ${#all[@]} -ne "$n" ] && kill -0 $pid 2>/dev/null || break
        sleep 0.02
    done
    sleep "$(awk -v d="$duration" -v r=$RANDOM 'BEGIN { print d * r / 32768 }')"
    # the ranks of fork are in the order of their numbers; MPI starts them in any order, and its variables have the numbers
    p=${all[$victim]:-none}
    case $how in
    openmpi) victim=$(tr '\0' '\n' 2>/dev/null <"/proc/$p/environ" | sed -n 's/^OMPI_COMM_WORLD_RANK=//p') ;;
    mpich) victim=$(tr '\0' '\n' 2>/dev/null <"/proc/$p/environ" | sed -n 's/^PMI_RANK=//p') ;;
    esac
    began=$(milliseconds)
    if [ ${#all[@]} -ne "$n" ] || ! kill -KILL "$p" 2>/dev/null; then # it had ended
        wait $pid
        early=$((early + 1))
        return
    fi
    if wait $pid 2>/dev/null; then # it was about to end
        early=$((early + 1))
        return
    fi
    done=$((done + 1))
    while left=$(running) && [ -n "$left" ] && [ $(($(milliseconds) - began)) -lt 20000 ]; do sleep 0.05; done
    last=$(($(milliseconds) - began))
    [ -z "$left" ] || bad "$how: still running after $last ms: $(ps -o pid,ppid,stat,args -p "${left//$'\n'/,}")"
    [ $last -lt 10000 ] || bad "$how: all ended after $last ms"
    [ $last -le $longest ] || longest=$last
    left=$(traces | diff before -) || bad "$how: left after rank $victim of $n was killed: $left"
    sed -i '/ mm thick, too thin for voxels of /d' err
    [ "$how$victim" = fork0 ] || told "$how" "$victim" "$n"
    if [ -e killed/model.sdm ]; then # the pictures were missing
        cmp one/model.sdm killed/model.sdm || bad "$how: another model"
        finished=$((finished + 1))
        return
    fi
    [ -e killed/checkpoint.sdmc ] && checkpoints=$((checkpoints + 1))
    # on another number of ranks
    expect 0 - started fork $((n % 4 + 1)) "${config[@]}" --threads 1 --out killed --resume
    cmp one/model.sdm killed/model.sdm || bad "$how: another model after rank $victim of $n was killed"
    [ "$(ls -A killed)" = "$(ls -A one)" ] || bad "$how: other files after rank $victim of $n was killed: $(ls -A killed)"
}

expect 0 - started fork 1 "${config[@]}" --threads 1 --out one
for how in fork "${mpis[@]}"; do
    duration=$(milliseconds)
    expect 0 - started "$how" 3 "${config[@]}" --threads 1 --out whole --force
    duration=$(awk -v ms=$(($(milliseconds) - duration)) 'BEGIN { print 1e-3 * ms }') # s
    cmp one/model.sdm whole/model.sdm || bad "$how: another model"
    longest=0 early=0 checkpoints=0 finished=0 done=0
    while [ $done -lt "$kills" ] && [ $early -lt $((3 * kills)) ]; do one_kill "$how"; done
    [ $done -eq "$kills" ] || bad "$how: most trainings ended before the kill"
    echo "$how: $done ranks killed; all ended within $longest ms, nothing left behind; $checkpoints trainings continued a checkpoint," \
        "$finished had written the model, the others began anew; $failures failures"
done
finish
