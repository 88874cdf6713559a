#!/usr/bin/env bash
# Training by mpirun of Open MPI and of MPICH, and by fork, on 1 to 4 processes with 1 and 2 threads, for every kind of network: the same
# model. Skipped (exit code 77) where no back-end is built. kill.sh tests the end of all after one is killed, and --resume.
# Tests: mpi_module.c comm_mpi.c ranks.c
. "$(dirname "$0")/../cli/common.sh"
. "$(dirname "$0")/mpi_common.sh"

tiny=$source_folder/tests/cli/tiny.yaml
# same NAME HOW RANKS THREADS CONFIG ARGUMENT...: the model of such a training is that in `one`, and the metrics tell of its ranks
trainings=0
same() {
    local name=$1 how=$2 n=$3 t=$4 by
    shift 4
    expect 0 - started "$how" "$n" "$@" --out many --force --threads "$t"
    cmp one/model.sdm many/model.sdm || bad "$name: $n ranks of $t threads by $how give another model"
    case $how in fork) by=fork ;; openmpi) by='Open MPI' ;; mpich) by=MPICH ;; esac
    if [ "$n" = 1 ]; then
        ! grep '"phase": "ranks"' many/metrics.jsonl || bad "$name: one process by $how is told as ranks"
    else
        [ "$(grep -c "\"phase\": \"ranks\", \"ranks\": $n, \"by\": \"$by\"" many/metrics.jsonl)" = 1 ] ||
            bad "$name: the metrics do not tell of $n ranks by $how"
    fi
    trainings=$((trainings + 1))
}

# compare NAME CONFIG ARGUMENT...: the model of one process of one thread, and those of 1 to 4 ranks of 1 and 2 threads by each way
compare() {
    local name=$1 how n t began=$SECONDS
    shift
    expect 0 - sdmgen train "$@" --out one --force --threads 1 -q
    for how in fork "${mpis[@]}"; do
        for n in 1 2 3 4; do
            for t in 1 2; do same "$name" "$how" $n $t "$@"; done
        done
    done
    echo "$name: checksum $(sha256sum one/model.sdm | cut -c1-16) for 1, 2, 3, 4 ranks of 1, 2 threads by fork ${mpis[*]}; $((SECONDS - began)) s"
}

few=(train.minutes=0 train.samples=0 train.steps=30 train.batch=8 data.start=48 data.static=2 data.online=32 data.holdout=8)
ellipsoid=("$source_folder/configs/ellipsoid.yaml" grid.spacing=0.9 'grid.size=[16,14,12]' "${few[@]}")
small=(network.depth=1 network.width=16 network.rank=8 network.modes=8)
compare pod "$tiny"
compare error "$tiny" data.sampling=error train.steps=100
compare template "${ellipsoid[@]}" network.kind=template
compare auto "${ellipsoid[@]}" network.kind=auto "${small[@]}"
for kind in deepsdf imnet; do
    compare $kind "$source_folder/configs/$kind.yaml" grid.spacing=1.2 'grid.size=[12,10,10]' network.width=67 "${few[@]}"
done
compare sdmnn "$source_folder/configs/sdmnn.yaml" grid.spacing=1.2 'grid.size=[12,10,10]' "${few[@]}"
compare fine "${ellipsoid[@]}" "${small[@]}" shape.options.edge=1.5 grid.spacing=1.5 'grid.size=[10,9,8]' network.kind=pod network.fine=4

# mpirun without a back-end
expect 1 'Open MPI started 2 processes, but its back-end cannot be loaded' env OMPI_COMM_WORLD_SIZE=2 bash -c "cp '$program' alone && ./alone train '$tiny' --out none"
echo "$trainings trainings, $failures failures; $SECONDS s"
finish
