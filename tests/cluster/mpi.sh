#!/usr/bin/env bash
# Training by mpirun of Open MPI and of MPICH, and by fork, on 1 to 4 processes with 1 and 2 threads, for every kind of network: the same
# model; the end of all after one is killed; --resume with another number. Skipped (exit code 77) where no back-end is built.
# Tests: mpi_module.c comm_mpi.c ranks.c
. "$(dirname "$0")/../cli/common.sh"
coarse_grids=yes
export OMP_WAIT_POLICY=passive OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
folder=$(dirname "$program")
mpis=()
for mpi in openmpi mpich; do
    [ -e "$folder/sdmgen_$mpi.so" ] && command -v mpirun.$mpi >/dev/null && mpis+=($mpi)
done
[ ${#mpis[@]} -gt 0 ] || { echo 'skipped: no back-end of MPI (Debian: libopenmpi-dev, libmpich-dev; -DSDM_OPENMPI=ON, -DSDM_MPICH=ON)'; exit 77; }

tiny=$source_folder/tests/cli/tiny.yaml
# started HOW RANKS ARGUMENT...: a training by fork, openmpi or mpich
started() {
    local how=$1 n=$2
    shift 2
    case $how in
    fork) sdmgen train "$@" --ranks "$n" -q ;;
    openmpi) mpirun.openmpi --oversubscribe -n "$n" "$program" train "$@" -q ;;
    mpich) mpirun.mpich -n "$n" "$program" train "$@" -q ;;
    esac
}

# compare NAME CONFIG ARGUMENT...: the model of one process and those of all others
ranks='1 2 3 4' threads='1 2'
compare() {
    local name=$1 how n t
    shift
    expect 0 - sdmgen train "$@" --out one --force --threads 1 -q
    for how in fork "${mpis[@]}"; do
        for n in $ranks; do
            for t in $threads; do
                expect 0 - started "$how" "$n" "$@" --out many --force --threads "$t"
                cmp one/model.sdm many/model.sdm || bad "$name: $n ranks of $t threads by $how give another model"
            done
        done
    done
}
compare pod "$tiny"
few=(train.minutes=0 train.samples=0 train.steps=30 train.batch=8 data.start=48 data.static=2 data.online=32 data.holdout=8)
ranks='2 3' threads=1
compare error "$tiny" data.sampling=error train.steps=300
compare auto "$tiny" network.kind=auto "${few[@]}"
compare template "$tiny" network.kind=template "${few[@]}"
compare fine "$tiny" network.fine=8 "${few[@]}"
for kind in deepsdf imnet sdmnn; do
    compare $kind "$source_folder/configs/$kind.yaml" grid.spacing=1.2 'grid.size=[12,10,10]' "${few[@]}"
done

# ranks_of FOLDER: the processes of the training with --out FOLDER
ranks_of() {
    local exe
    for exe in /proc/[0-9]*/exe; do
        [ "$(readlink "$exe")" = "$(readlink -f "$program")" ] || continue
        tr '\0' ' ' <"${exe%exe}cmdline" | grep -q -- "--out $1 " && basename "${exe%/exe}"
    done
}

# One process is killed: all end within ten seconds, and the folder has no temporary files.
for how in "${mpis[@]}"; do
    rm -rf killed
    started $how 3 "$tiny" train.steps=1000000 train.checkpoint_seconds=0.1 --out killed 2>err &
    pid=$!
    for _ in $(seq 200); do [ -e killed/checkpoint.sdmc ] && break || sleep 0.1; done
    mapfile -t all < <(ranks_of killed)
    [ ${#all[@]} -eq 3 ] || bad "$how: ${#all[@]} processes instead of three"
    begin=$SECONDS
    kill -KILL "${all[1]}"
    wait $pid && bad "$how: exit code 0 after a process was killed"
    for p in "${all[@]}"; do
        while [ -e "/proc/$p" ] && [ $((SECONDS - begin)) -lt 10 ]; do sleep 0.1; done
        [ ! -e "/proc/$p" ] || bad "$how: process $p has not ended within ten seconds"
    done
    steps=$(grep -o '"step": [0-9]*' killed/metrics.jsonl | tail -n 1 | grep -o '[0-9]*')
    cp -r killed rest
    expect 0 - started $how 2 "$tiny" train.steps=$((steps + 2000)) --out killed --resume
    expect 0 - sdmgen train "$tiny" train.steps=$((steps + 2000)) --out rest --resume -q
    cmp killed/model.sdm rest/model.sdm || bad "$how: a continued training depends on the number of processes"
    [ "$(ls killed)" = "$(ls rest)" ] || bad "$how: other files: $(ls killed)"
    rm -r killed rest
done

# mpirun without a back-end
expect 1 'Open MPI started 2 processes, but its back-end cannot be loaded' env OMPI_COMM_WORLD_SIZE=2 bash -c "cp '$program' alone && ./alone train '$tiny' --out none"
finish
