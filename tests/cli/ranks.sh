#!/usr/bin/env bash
# Training by several processes on one machine: the bits of the model, errors, the end of all after one is killed, --resume with another
# number of them.
# Tests: cmd_train.c ranks.c comm.c comm_fork.c comm_mpi.c pod_ranks.c mlp.c head.c point_mlp.c export_model.c dataset_fill.c producer.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
export OMP_WAIT_POLICY=passive
unset OMPI_COMM_WORLD_SIZE PMI_SIZE

config=$source_folder/tests/cli/tiny.yaml
# train FOLDER ARGUMENT...
train() { sdmgen train "$config" data.sampling=error --out "$@" -q; }

# same FOLDER: the model is that of one process
same() { cmp one/model.sdm "$1/model.sdm" || bad "the model in $1 has other bits"; }

expect 0 - train one --threads 1
expect 0 - train two --ranks 2 --threads 2
same two
expect 0 - train three --ranks 3
same three
grep -Eq '^  (next|better) +sdmgen train .* --ranks 3 --out three-2 --compare three/model.sdm$' out || bad "the next command does not repeat the ranks: $(cat out)"
grep -qx '{"phase": "ranks", "ranks": 3, "by": "fork"}' three/metrics.jsonl || bad 'the metrics do not tell the ranks'
grep -q ranks one/metrics.jsonl && bad 'one process tells of ranks'
[ "$(ls three)" = "$(ls one)" ] || bad "other files: $(ls three)"

# Networks that learn points: ranks share their steps and the measurement of the model. No width is a multiple of a vector's length.
kinds='deepsdf imnet' ranks='2 3'
if is_brief; then kinds=imnet ranks=3; fi
for kind in $kinds; do
    points=("$source_folder/configs/$kind.yaml" grid.spacing=1.2 'grid.size=[12,10,10]' network.width=43 network.activation=silu
        train.minutes=0 train.steps=8 train.points=77 train.eikonal=0.1 data.start=48 data.static=2 data.online=8 data.holdout=5)
    expect 0 - sdmgen train "${points[@]}" --out one-$kind --threads 1 -q
    for n in $ranks; do
        expect 0 - sdmgen train "${points[@]}" --out many-$kind --force --ranks $n -q
        cmp one-$kind/model.sdm many-$kind/model.sdm || bad "$kind: $n ranks give another model"
    done
done

# children PID: the processes that PID has made
children() {
    local file pid parent
    for file in /proc/[0-9]*/stat; do
        read -r pid _ _ parent _ 2>/dev/null <"$file" && [ "$parent" = "$1" ] && echo "$pid"
    done
}

# One process is killed: all end soon, with one line; the folder has no temporary files.
"$program" train "$config" data.sampling=error train.steps=1000000 train.checkpoint_seconds=0.1 --out killed -q --ranks 3 2>err &
pid=$!
await $pid [ -e killed/checkpoint.sdmc ]
mapfile -t others < <(children $pid)
[ ${#others[@]} -eq 2 ] || bad "${#others[@]} processes instead of two"
begin=$SECONDS
kill -KILL "${others[0]}"
wait $pid
code=$?
[ $code -eq 1 ] || bad "exit code $code after a process was killed"
[ $((SECONDS - begin)) -lt 10 ] || bad 'the others ended late'
[ ! -e "/proc/${others[1]}" ] || bad 'a process is left'
sed -i '/ mm thick, too thin for voxels of /d' err
grep -Eq '^sdmgen: error: rank [12] of 3 was killed by signal 9 \(Killed\): all ranks end$' err && [ "$(wc -l <err)" -eq 1 ] || bad "message: $(cat err)"
[ "$(ls killed)" = 'checkpoint.sdmc
config.yaml
metrics.jsonl' ] || bad "files after a process was killed: $(ls killed)"

# A checkpoint of three processes, continued by two and by one.
stopped() {
    "$program" train "$config" data.sampling=error train.steps=1000000 train.checkpoint_seconds=0.05 --out "$1" -q --ranks 3 2>err &
    local pid=$!
    await $pid [ -e "$1/checkpoint.sdmc" ]
    kill -TERM $pid
    wait $pid
    [ $? -eq 130 ] || bad "exit code after an interrupt: $(cat err)"
}
stopped rest
steps=$(grep -o 'at step [0-9]*' err | grep -o '[0-9]*')
cp -r rest other
more="train.steps=$((steps + 60))"
expect 0 - train rest "$more" --resume --ranks 2
expect 0 - train other "$more" --resume
cmp rest/model.sdm other/model.sdm || bad 'a continued training depends on the number of processes'
grep -c '"phase": "ranks"' rest/metrics.jsonl | grep -qx 2 || bad 'the metrics of a continued training do not tell the ranks'

# Mistakes are told once.
expect 2 'holds a trained model' train one --ranks 3
expect 2 "unknown key 'networ'" train new networ=1 --ranks 3
finish
