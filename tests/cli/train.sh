#!/usr/bin/env bash
# sdmgen train: the run folder and its protection, interrupt and resume.
# train_advice.sh: the verdict and the command for the next training. Tests: cmd_train.c map_time.c train_progress.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
tiny=$source_folder/tests/cli/tiny.yaml

# interrupted FOLDER CONFIG [KEY=VALUE ...]: starts a training and stops it after 500 steps.
interrupted() {
    local folder=$1 pid code
    shift
    "$program" train "$@" train.steps=1000000000 --out "$folder" >out 2>err &
    pid=$!
    await $pid grep -qs '"step": 500,' "$folder/metrics.jsonl"
    kill -TERM $pid
    wait $pid
    code=$?
    [ $code -eq 130 ] || bad "interrupted: exit code $code: $(cat err)"
}

sdmgen train "$tiny" --out run --json --quiet >out 2>err
[ $? -eq 0 ] || bad "training failed: $(cat err)"
[ ! -s err ] || bad "--quiet, but: $(cat err)"
[ "$(wc -l <out)" -eq 1 ] || bad 'one line of JSON expected'
present run/config.yaml run/metrics.jsonl run/model.sdm run/loss.png run/slices.png
[ "$(json model)" = run/model.sdm ] || bad "model: $(json model)"
awk -v s="$(json seconds)" -v m="$(json mse_mm2)" 'BEGIN { exit !(s > 0 && m > 0 && m < 1) }' || bad "seconds, mse_mm2: $(cat out)"

# The verdict: in the JSON, and in a line of metrics.jsonl behind the errors from the first step on.
has '"verdict": \{"grade": "(good|usable|poor)", .*"bases_mm2": [0-9.e-]+, .*"key": "[a-z.]+", .*"sentence": "[^"]+: (raise|lower|set) '
head -n 1 run/metrics.jsonl | grep -q '^{"phase": "fit", "step": 0, .*"heldout_mse_mm2": [0-9]' || bad 'no error before the first step'
tail -n 1 run/metrics.jsonl | grep -q '^{"phase": "verdict", "grade": ' || bad 'no verdict in metrics.jsonl'

# A finished run is not overwritten.
before=$(cksum <run/model.sdm)
expect 2 'run holds a trained model: --force replaces it, --out DIR writes into another folder' sdmgen train "$tiny" --out run
expect 2 'run holds a trained model and no checkpoint from which --resume can go on: --force replaces it' sdmgen train "$tiny" --out run --resume
expect 2 'exclude each other' sdmgen train "$tiny" --out run --resume --force
[ "$before" = "$(cksum <run/model.sdm)" ] || bad 'the model has changed'

expect 1 "^sdmgen: error: train.steps=1: cannot open: .*: the first argument is a configuration file" sdmgen train train.steps=1

# A refused training leaves no folder that it has made, an empty one that was there stays.
mkdir -p there/already
expect 2 'data.memory_gb' sdmgen train "$tiny" --out there/already/new/run data.memory_gb=0.001 'grid.size=[60,60,60]' grid.spacing=0.25
absent there/already/new
expect 2 'data.memory_gb' sdmgen train "$tiny" --out there/already data.memory_gb=0.001 'grid.size=[60,60,60]' grid.spacing=0.25
[ -d there/already ] || bad 'a folder that was there has been removed'

# A budget of time that the maps alone exceed: told in one line, and the advice is more time.
sdmgen train "$tiny" --out hurried train.steps=0 train.minutes=0.0001 data.start=400 >out 2>err || bad "hurried: $(cat err)"
# A run of less than a second more is not told; "trained" counts the writing of files as well.
grep -q '^sdmgen: the run took [0-9]* s longer than train.minutes: ' err || awk '$1 == "trained" { short = $2 < 2 } END { exit !short }' out ||
    bad "no word about the time: $(cat err)"
grep -Eq '^sdmgen: half of the budget is over after 8 held-out maps, 16 of the static grid and 1[2-9][0-9] of 400 random ones: .*lower data.start or' err ||
    bad "no word about all maps: $(cat err)"
has '^  error from  bases +[0-9.]+ mm +[0-9]+ %  '
has '^  (good|usable|poor) \(from 8 shapes only\) +(for|not) '
has '^  verdict     .*(raise|lower|set) '

# It is told as soon as the pace of the maps is known.
sdmgen train "$tiny" --out hurried --force train.steps=0 train.minutes=0.0001 data.holdout=60 >out 2>err || bad "hurried: $(cat err)"
grep -Eq '^sdmgen: the run will take longer than train.minutes \(0.0001\): the 60 held-out maps, 16 of the static grid and 96 random ones are made in any case, which takes about [0-9]+ s \(raise train.minutes to ' err ||
    bad "no word about the time ahead: $(cat err)"

# Pictures that cannot be written do not make the training fail.
mkdir -p unpictured/loss.png unpictured/slices.png
sdmgen train "$tiny" --out unpictured >out 2>err || bad "without pictures: $(cat err)"
[ "$(grep -c '/\(loss\|slices\).png: cannot write' err)" -eq 2 ] || bad "no word about the pictures: $(cat err)"
present unpictured/model.sdm
absent unpictured/checkpoint.sdmc

# A model whose times cannot be measured is finished all the same: the summary has the figures that there are.
faulty=("shape={name: faulty, options: {fault: trained}}" 'grid={size: [16, 14, 14], spacing: 0.8, centre: [1, 0, 0]}' --plugin ../../plugins/faulty/faulty.so)
expect 0 'warning: the time of a map was not measured: .*a model is there' sdmgen train "$tiny" "${faulty[@]}" --out trained --quiet --json
[ "$(json ms_exact)" = null ] || bad "a time of the exact engine: $(json ms_exact)"
awk -v t="$(json ms_network)" 'BEGIN { exit !(t > 0) }' || bad "no time of the network: $(json ms_network)"
rm -r trained
expect 0 'not measured' sdmgen train "$tiny" "${faulty[@]}" --out trained --quiet
has '^  time        one map on one core: network [0-9.]+ ms, exact engine not measured$'
# a shape that was changed since the training: a fit by the network alone warns
rm -r trained
expect 0 - sdmgen train "$tiny" "${faulty[@]}" 'shape={name: faulty, options: {fault: changed}}' --out trained --quiet
sdmgen phantom --shape torus --spacing 0.5 -o torus.nii --quiet >out 2>err
sdmgen fit trained/model.sdm torus.nii --rotation 0,0,0 --max-iterations 1 --plugin ../../plugins/faulty/faulty.so --quiet >out 2>err
grep -q "warning: shape 'faulty' was changed after the training: at the default parameters .* (sums over all triangles: overlaps count twice); load the shape of that time, or train again$" err ||
    bad "no warning of a changed shape: $(cat err)"
rm -r trained
# its handle was only moved: volume and area are the same
expect 0 - sdmgen train "$tiny" "${faulty[@]}" 'shape={name: faulty, options: {fault: moved}}' --out trained --quiet
sdmgen verify trained/model.sdm --plugin ../../plugins/faulty/faulty.so --quiet >out 2>err
[ $? -eq 3 ] || bad 'a shape with a moved part: no exit code 3'
grep -q "error: shape 'faulty' was changed after the training: at the default parameters its mesh has the same volume and area, but at least a part of it lies elsewhere; load the shape of that time, or train again$" err ||
    bad "no error about a moved part: $(cat err)"
rm -r trained

# A model that cannot be written, because a folder has its name: the error names the checkpoint, and --quiet does not hide that.
"$program" train "$tiny" train.steps=2000 --out unwritten --quiet >out 2>err &
pid=$!
await $pid grep -qs '"step": 50,' unwritten/metrics.jsonl
mkdir unwritten/model.sdm
wait $pid && bad 'a model that cannot be written: exit code 0'
grep -q '^sdmgen: error: .*; a checkpoint is in unwritten: go on with --resume$' err || bad "no word of the checkpoint: $(cat err)"
present unwritten/checkpoint.sdmc

# A grid that is fitted to the shapes: an interrupted run goes on with the same one, and the model has its numbers.
interrupted fitted "$tiny" grid.voxels=16
grep -q '^sdmgen: grid: 16 x 16 x 11 voxels of ' err || bad "no word of the fitted grid: $(cat err)"
grep -q '^  size: \[16, ' fitted/config.yaml || bad 'the run does not have the numbers of the fitted grid'
expect 2 "has 'size: .16, 16, 11.', this configuration 'size: .20, 19, 13.'" sdmgen train "$tiny" grid.voxels=20 train.steps=1000000000 --out fitted --resume --quiet
expect 2 'is at step' sdmgen train "$tiny" grid.voxels=16 --out fitted --resume --quiet
expect 0 - sdmgen train "$tiny" grid.voxels=16 --out fitted --resume --quiet train.steps=$(($(sed -n 's/.* is at step \([0-9]*\).*/\1/p' err) + 20))
expect 0 - sdmgen info fitted/model.sdm
has '16 x 1'

# An open mesh is reported before the training, a closed one is not.
faces=$(sed -n 's/^element face //p;/^end_header/q' "$source_folder/configs/statistical/mean.ply")
sed "s/^element face $faces$/element face $((faces - 1))/" "$source_folder/configs/statistical/mean.ply" | head -n -1 >open.ply
for mean in "$PWD/open.ply" "$source_folder/configs/statistical/mean.ply"; do
    sdmgen train "$tiny" "shape={name: statistical, options: {mean: $mean, count: 1,
        modes: $source_folder/configs/statistical/modes.npy}}" train.steps=1 --force --out modes >out 2>"err-$(basename "$mean")" ||
        bad "a statistical shape: $(cat err-*)"
done
grep -q '^sdmgen: warning: open or badly oriented edges in all 35 shapes, up to 3 at ' err-open.ply || bad "no word of the open mesh: $(cat err-open.ply)"
grep -q 'edges' err-mean.ply && bad "a word of a closed mesh: $(cat err-mean.ply)"

expect 0 - sdmgen info modes/model.sdm
has '^parameters +m1 .* default 0, normal, mean 0, deviation 1$'
expect 0 - sdmgen info modes/model.sdm --json
has '"distribution": "normal", "mean": 0, "deviation": 1\}'

# --force replaces a run only after the new one has passed all checks.
before=$(cat run/* | cksum)
expect 2 "range \[0, 100\] of 'a'" sdmgen train "$tiny" --force --out run 'shape.ranges.a=[0,100]' --quiet
expect 2 'data.memory_gb' sdmgen train "$tiny" --force --out run data.memory_gb=0.001 'grid.size=[60,60,60]' grid.spacing=0.25 --quiet
expect 2 'data.memory_gb is .* a coarser grid' sdmgen train "$tiny" --force --out run 'grid.size=[100000,100000,100000]' grid.spacing=0.00015
refused_grid() {
    sdmgen train "$tiny" "$@" --quiet >out 2>err
    [ $? -eq 2 ] || bad "a grid that misses the shapes: $(cat err)"
    grep -q '^sdmgen: warning: .* cuts all shapes' err || bad "no warning: $(cat err)"
    grep -q '^sdmgen: error: .*no voxel of the grid is inside any' err || bad "no error: $(cat err)"
}
refused_grid --force --out run 'grid.centre=[900,0,0]'
[ "$before" = "$(cat run/* | cksum)" ] || bad 'a refused --force has changed the run'

# The result depends neither on the name of the folder nor on that of the file.
cp "$tiny" other.yaml
expect 0 - sdmgen train other.yaml --out other --quiet
cmp -s run/model.sdm other/model.sdm || bad 'the bits of a model depend on the name of its folder'
cmp -s run/config.yaml other/config.yaml || bad 'config.yaml depends on the name of its folder'
expect 0 - sdmgen config run/config.yaml

# The script ./run asks before it replaces a model of another configuration.
mkdir -p clone/.ci clone/configs clone/build/release/cli clone/runs
cp "$source_folder/run" clone
sed "s/width: 16/width: 24/" "$tiny" >clone/configs/cochlea.yaml
ln -s "$program" clone/build/release/cli/sdmgen
echo 'say() { :; }; install_packages() { :; }; build() { :; }' >clone/.ci/setup.sh
cp -r run clone/runs/cochlea
expect 1 '^runs/cochlea holds a training with another configuration' bash clone/run
cmp -s run/model.sdm clone/runs/cochlea/model.sdm || bad './run has replaced a model'

# An interrupt leaves a checkpoint, and --resume continues. The folder's name need not be UTF-8.
stopped=$'st\xf6pped'
interrupted "$stopped" "$tiny"
grep -q '^sdmgen: error: stopped on request at step [0-9]*; a checkpoint is in st.*pped: go on with --resume' err || bad "no such notice: $(cat err)"
present "$stopped/checkpoint.sdmc"
absent "$stopped/model.sdm"
expect 2 'st.*pped holds the checkpoint of a training' sdmgen train "$tiny" --out "$stopped"
before=$(cat "$stopped"/* | cksum)
expect 2 "^sdmgen: error: st.*pped/checkpoint.sdmc has 'width: 16', this configuration 'width: 24': " \
    sdmgen train "$tiny" train.steps=1000000000 --out "$stopped" --resume network.width=24
expect 2 'budgets of different kinds' sdmgen train "$tiny" --out "$stopped" --resume train.minutes=1
# ... with a larger or smaller number of steps, but not below the steps already trained.
expect 2 'is at step [0-9]+, this configuration ends at 60: ' sdmgen train "$tiny" --out "$stopped" --resume
[ "$before" = "$(cat "$stopped"/* | cksum)" ] || bad 'a refused --resume has changed the run'
steps=$(($(sed 's/.* is at step \([0-9]*\).*/\1/' err) + 20))
cp "$stopped/metrics.jsonl" before.jsonl
expect 0 - sdmgen train "$tiny" --out "$stopped" --resume --quiet --json train.steps=$steps
near "$(json steps)" $steps 0
cmp -s -n "$(wc -c <before.jsonl)" before.jsonl "$stopped/metrics.jsonl" || bad 'the run was not gone on with'
present "$stopped/model.sdm"
absent "$stopped/checkpoint.sdmc"
expect 0 - sdmgen info "$stopped/model.sdm"

# The run keeps copies of the data files of the shape: they are found from every working folder, after the project has moved and without
# the files themselves. A model leads to no file elsewhere.
mkdir -p project/conf elsewhere
cp -r "$source_folder"/configs/statistical* project/conf
small=(grid.size=[16,12,12] grid.spacing=0.8 data.static=2 data.start=96 data.online=32 data.holdout=8
    network.kind=pod network.depth=1 network.width=16 network.rank=6 network.modes=16 train.batch=8)
interrupted project/data project/conf/statistical.yaml "${small[@]}"
mv project moved
run=(sdmgen train moved/conf/statistical.yaml "${small[@]}" --out moved/data --resume --quiet)
expect 2 'is at step' "${run[@]}" train.steps=1
steps=$(($(sed 's/.* is at step \([0-9]*\).*/\1/' err) + 20))
cp -r moved $'m\xf6ved'
expect 2 '^config\.yaml:.*UTF-8' sdmgen train $'m\xf6ved/conf/statistical.yaml' --out never
absent never
rm -r $'m\xf6ved'
deviations=moved/conf/statistical/deviations.npy
cp $deviations kept.npy
{ head -c 128 kept.npy && tail -c 32 kept.npy && tail -c 64 kept.npy | head -c 32; } >$deviations # swap the halves: values 5 to 8, then 1 to 4
expect 2 'the maps differ from those it was written with' "${run[@]}" train.steps=$steps
cp kept.npy $deviations
expect 0 - "${run[@]}" train.steps=$steps
cd elsewhere || exit 1
expect 0 - sdmgen config ../moved/data/config.yaml
expect 0 - sdmgen verify ../moved/data/model.sdm --samples 2
has 'on 2 random shapes'
expect 0 - sdmgen info ../moved/data/model.sdm
has 'mean +shape\.mean\.ply$'
mv ../moved/conf away
expect 0 - sdmgen verify ../moved/data/model.sdm --samples 2
mv away ../moved/conf
copy=../moved/data/shape.deviations.npy
cmp $copy ../$deviations || bad 'the run has no copy of a data file'
printf 1 >>$copy
expect 3 "/moved/data/shape\.deviations\.npy: not the file 'deviations' of the training: its CRC-64 is not [0-9a-f]{16}\$" \
    sdmgen verify ../moved/data/model.sdm
expect 3 'not the file' sdmgen generate ../moved/data/model.sdm --max-error 1 -o x.npy
rm $copy
expect 1 "data file 'deviations' of the exact shape: \.\./moved/data/shape\.deviations\.npy: No such file or directory\$" \
    sdmgen eval ../moved/data/model.sdm
expect 0 - sdmgen generate ../moved/data/model.sdm -p m1=1 -o x.npy
expect 0 - sdmgen bench network ../moved/data/model.sdm
has '^  map and Jacobian +[0-9.]+ ms'
has "^  exact engine +not measured: data file 'deviations' .*: No such file"
expect 0 - sdmgen bench network ../moved/data/model.sdm --json
[ "$(json ms_exact)" = null ] || bad "bench: a time without the exact shape: $(json ms_exact)"
has '"no_exact": "data file .deviations. .*No such file'
# The file is in the working folder, but not next to the model; a link there is not followed.
cp ../kept.npy shape.deviations.npy
expect 1 'No such file' sdmgen verify ../moved/data/model.sdm
ln -s "$PWD/shape.deviations.npy" $copy
expect 1 'shape\.deviations\.npy: a symbolic link, which is not followed: put the file itself there$' sdmgen verify ../moved/data/model.sdm
rm $copy
cp ../kept.npy $copy
expect 0 - sdmgen verify ../moved/data/model.sdm --samples 2
cp ../moved/data/shape.* .
cp ../moved/data/model.sdm .
expect 0 - sdmgen verify model.sdm --samples 2
# A model that names a file elsewhere, with its checksum or without one, as those of earlier versions do: the file is not opened there.
python=
for p in python3 /usr/bin/python3; do $p -c 'import numpy' 2>/dev/null && python=$p && break; done
if [ "$python" ]; then
    mkdir secret
    mv shape.mean.ply secret/mean.ply
    for sum in with without; do
        PYTHONPATH=$source_folder/tests/oracle PYTHONDONTWRITEBYTECODE=1 $python - "$PWD/secret/mean.ply" $sum <<'END' || bad 'no model forged'
import sys
import sdm_file
data = open("model.sdm", "rb").read()
parts = sdm_file.sections(data)
lines = dict(parts)["meta"].decode().splitlines()
at = lines.index("option.name=mean") + 1
lines[at] = "option.value=" + sys.argv[1]
if sys.argv[2] == "without":
    del lines[at + 1:at + 3]
    count = next(i for i, line in enumerate(lines) if line.startswith("options="))
    lines[count] = f"options={int(lines[count][8:]) - 1}"
meta = ("\n".join(lines) + "\n").encode()
open("forged.sdm", "wb").write(sdm_file.build([(name, meta if name == "meta" else content) for name, content in parts]))
END
        expect 1 "'mean' of the exact shape: \./mean\.ply: No such file or directory; models name no files elsewhere: copy /.*/secret/mean\.ply there if you trust the model\$" \
            sdmgen verify forged.sdm --samples 2
        cp secret/mean.ply .
        expect 0 - sdmgen verify forged.sdm --samples 2
        rm mean.ply
    done
fi
cd ..

# A grid that misses the shape gives no network.
refused_grid 'grid.origin=[900,900,900]' --out missed
absent missed/model.sdm

# Mistakes in arguments.
expect 2 '^argument .network.dpth=4.: ' sdmgen train "$tiny" network.dpth=4 --out never
expect 1 'missing.yaml' sdmgen train missing.yaml --out never
touch file
expect 1 'file' sdmgen train "$tiny" --out file/run --quiet
absent never
finish
