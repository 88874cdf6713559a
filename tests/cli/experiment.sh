#!/usr/bin/env bash
# sdmgen experiment: the table in three formats, published reference values, pictures, a second run that loads models, rows that fail,
# mistakes.
# Tests: cmd_experiment.c experiment_draw.c experiment_engine.c experiment_job.c experiment_log.c experiment_network.c experiment_plan.c
# experiment_table.c
. "$(dirname "$0")/common.sh"

cat >tiny.yaml <<'END'
experiment: {title: tiny, samples: 4, engine_samples: 2, baseline: naive, reference: paper}
shape: {name: ellipsoid, options: {edge: 1}, ranges: {rx: [2, 4], ry: [2, 3], rz: [2, 3]}}
grid: {size: [14, 12, 12], spacing: 0.9}
network: {depth: 1, width: 16}
data: {static: 2, online: 32, start: 64, holdout: 4}
train: {steps: 20, batch: 16}
methods:
  - {name: POD, network: pod, set: {network: {rank: 8, modes: 16, degree: 2, input_degree: 2}, train.refine_batch: 8}}
  - {name: naive, engine: naive}
  - {name: exact engine, engine: exact}
  - {name: VTK, engine: vtk}
reference:
  - {row: POD, ms: 200, mse_mm2: 6e-3, source: "somebody, table 1"}
END

# csv NAME ROW FOLDER: the value in column NAME of table.csv; texts before that column must have no comma.
csv() { awk -F, -v name="$1" -v row="\"$2\"" 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) c = i } $1 == row { print $c }' "$3/table.csv"; }
# json_of METHOD KEY FOLDER: the number KEY in the row of METHOD in table.json.
json_of() { grep -o "{\"method\": *\"$1\"[^{}]*" "$3/table.json" | sed -n "s/.*\"$2\": *\\([^,}]*\\).*/\\1/p" | head -n 1; }
# md NAME ROW FOLDER: the cell of table.md in the column whose title begins with NAME.
md() { awk -F'|' -v name=" $1" -v row=" $2 " '$2 == " method " { for (i = 2; i <= NF; i++) if (!c && index($i, name) == 1) c = i } $2 == row { gsub(/ /, "", $c); print $c; exit }' "$3/table.md"; }

expect 0 - sdmgen experiment tiny.yaml --dry-run --out never
has '^POD +pod .*train, measure +20 steps +samples 4 +never/pod$'
has '^exact engine +exact .*samples 2 '
has '^trainings: 0 min in total, and 1 by steps or samples, of unknown duration; results in never$'
expect 0 - sdmgen experiment tiny.yaml --dry-run --json --out never
[ "$(json minutes)" = 0 ] || bad "minutes of the plan: $(json minutes)"
absent never

expect 0 - sdmgen experiment tiny.yaml --out run --peers none --quiet
has '^\| POD \|'
cmp -s out run/table.md || bad 'stdout is not table.md'
present run/table.md run/table.csv run/table.json run/log.txt run/pod/model.sdm run/pod/slices.png run/pod/surfaces.png \
    run/exact-engine/slices.png run/naive/surfaces.png
absent run/vtk

# The three formats agree with each other and with sdmgen eval of the same model on the same shapes.
expect 0 - sdmgen eval run/pod/model.sdm --samples 4 --naive 0 --json
for key in mse_mm2 rmse_mm rmse_near_mm max_abs_mm dice surface_mean_mm surface_hausdorff_mm; do
    mine=$(csv $key POD run)
    [ -n "$mine" ] && [ "$mine" = "$(json $key)" ] || bad "$key: '$mine' in table.csv, '$(json $key)' by eval"
    [ "$mine" = "$(json_of POD $key run)" ] || bad "$key: '$mine' in table.csv, '$(json_of POD $key run)' in table.json"
done
awk -v a="$(md MSE POD run)" -v b="$(csv mse_mm2 POD run)" 'BEGIN { exit !(b > 0 && a / b > 0.99 && a / b < 1.01) }' ||
    bad "MSE: $(md MSE POD run) in table.md, $(csv mse_mm2 POD run) in table.csv"
[ "$(csv ms naive run)" = "$(json_of naive ms run)" ] || bad 'ms of naive differ'
near "$(csv speedup naive run)" 1 0
awk -v s="$(csv speedup POD run)" -v a="$(csv ms naive run)" -v b="$(csv ms POD run)" 'BEGIN { exit !(s > 0 && s * b / a > 0.999999 && s * b / a < 1.000001) }' ||
    bad "speed-up $(csv speedup POD run)"
# The naive method is exact on a mesh without overlap.
awk -v m="$(csv max_abs_mm naive run)" 'BEGIN { exit !(m != "" && m < 1e-5) }' || bad "naive is off by $(csv max_abs_mm naive run)"

# Published values appear next to the measured ones, with their source.
[ "$(csv reference_ms POD run)" = 200 ] || bad "reference_ms: $(csv reference_ms POD run)"
[ "$(csv reference_mse_mm2 POD run)" = 0.006 ] || bad "reference_mse_mm2: $(csv reference_mse_mm2 POD run)"
grep -q '| MSE, mm^2 | MSE, mm^2 (paper) |' run/table.md || bad 'no column of the paper beside ours'
grep -q 'paper: somebody, table 1' run/table.md || bad 'no source in table.md'
grep -q '"reference": *{"ms": *200, *"mse_mm2": *0.006, *"source": *"somebody, table 1"}' run/table.json || bad 'no reference in table.json'
# Methods that are not available are listed as such.
grep -q '^| VTK (not available) |' run/table.md || bad 'VTK is missing in silence'
grep -q '"VTK",not available' run/table.csv || bad 'VTK is missing in silence (CSV)'

# The same run again loads the model and gives the same errors; another configuration trains again; other test shapes only need the model
# loaded.
before=$(cksum <run/pod/model.sdm)
mse=$(csv mse_mm2 POD run)
expect 0 - sdmgen experiment tiny.yaml --dry-run --out run
has '^POD .*load, measure'
sdmgen experiment tiny.yaml --out run --peers none --threads 1 >out 2>err || bad "second run: $(cat err)"
grep -q 'POD: the model in run/pod is loaded, not trained again' err || bad "not loaded: $(cat err)"
[ "$before" = "$(cksum <run/pod/model.sdm)" ] || bad 'the model has changed'
[ "$mse" = "$(csv mse_mm2 POD run)" ] && [ "$(csv loaded POD run)" = true ] || bad 'the loaded model measures differently'
expect 0 - sdmgen experiment tiny.yaml train.steps=21 --dry-run --out run
has '^POD .*train anew, measure'
sdmgen experiment tiny.yaml train.steps=21 experiment.pictures=no --out run --peers none >out 2>err || bad "third run: $(cat err)"
grep -q 'has another configuration and is replaced' err || bad "not said: $(cat err)"
[ "$before" != "$(cksum <run/pod/model.sdm)" ] || bad 'the model has not changed'
[ "$(grep -c 'sdmgen experiment' run/log.txt)" -eq 3 ] || bad "log: $(cat run/log.txt)"

# A checkpoint is resumed only with the same budget: with another one the model would differ from one trained in a single run.
stopped_at 'bases and' experiment tiny.yaml train.steps=1000000000 --out stopped --peers none
grep -q 'the same command continues where it stopped' err || bad "not said: $(cat err)"
present stopped/pod/checkpoint.sdmc stopped/table.md
expect 0 - sdmgen experiment tiny.yaml train.steps=1000000000 --dry-run --out stopped
has '^POD .*go on training, measure'
expect 0 - sdmgen experiment tiny.yaml --dry-run --out stopped
has '^POD .*train anew, measure'
sdmgen experiment tiny.yaml experiment.pictures=no --out stopped --peers none >out 2>err || bad "after the interrupt: $(cat err)"
grep -q 'POD: the model or checkpoint in stopped/pod has another configuration and is replaced' err || bad "not said: $(cat err)"
grep -q '"evaluate", "step": 20,' stopped/pod/metrics.jsonl || bad "not 20 steps: $(tail -n 1 stopped/pod/metrics.jsonl)"

# The same for a kind that the trainer chooses: its part of the budget is not the budget of the row.
sed -e '/network: {depth/d' -e 's/network: pod, set: .*/network: auto}/' -e '/name: VTK/d' tiny.yaml >auto.yaml
sdmgen experiment auto.yaml experiment.pictures=no --out auto --peers none >out 2>err || bad "auto: $(cat err)"
before=$(cksum <auto/pod/model.sdm)
expect 0 - sdmgen experiment auto.yaml --dry-run --out auto
has '^POD .*load, measure'
expect 0 - sdmgen experiment auto.yaml train.steps=21 --dry-run --out auto
has '^POD .*train anew, measure'
sdmgen experiment auto.yaml experiment.pictures=no --out auto --peers none >out 2>err || bad "auto again: $(cat err)"
grep -q 'POD: the model in auto/pod is loaded, not trained again' err || bad "not loaded: $(cat err)"
[ "$before" = "$(cksum <auto/pod/model.sdm)" ] || bad 'the model has changed'
stopped_at 'fit' experiment auto.yaml train.steps=1000000000 --out auto-stopped --peers none
expect 0 - sdmgen experiment auto.yaml train.steps=1000000000 --dry-run --out auto-stopped
has '^POD .*go on training, measure'
expect 0 - sdmgen experiment auto.yaml --dry-run --out auto-stopped
has '^POD .*train anew, measure'
# Two kinds are trained, one after the other: while the second trains, the model in the folder is that of the first.
cat >two.yaml <<'END'
experiment: {title: two kinds, samples: 4, pictures: no}
shape: {name: linkage, options: {links: 1, length: 1.5, radius: 1, tip: 1, edge: 0.5}}
grid: {size: [26, 26, 16], spacing: 0.4}
network: {degree: 2, width: 16, modes: 24}
data: {static: 0, static_share: 0, start: 40, online: 40, holdout: 4}
train: {steps: 60, batch: 16}
methods:
  - {name: both, network: auto}
END
sdmgen experiment two.yaml --out two --peers none >out 2>err || bad "two kinds: $(cat err)"
grep -q 'auto: pod leaves .*: it is kept' err || bad "two kinds: $(cat err)"
expect 0 - sdmgen experiment two.yaml --dry-run --out two
has '^both .*load, measure'
stopped_at 'fit +[0-9]' experiment two.yaml train.steps=1000000000 --out two-stopped --peers none
present two-stopped/both/model.sdm two-stopped/both/checkpoint.sdmc
expect 0 - sdmgen experiment two.yaml train.steps=1000000000 --dry-run --out two-stopped
has '^both .*go on training, measure'
rm two-stopped/both/checkpoint.sdmc
expect 0 - sdmgen experiment two.yaml train.steps=1000000000 --dry-run --out two-stopped
has '^both .*train, measure'

# An interrupt keeps the tables of the previous run. --force trains again; a run without --force then resumes what the forced run began.
tables=$(cksum stopped/table.*)
stopped_at 'bases and' experiment tiny.yaml train.steps=1000000000 --out stopped --peers none --force
grep -q 'the same command without --force continues where it stopped' err || bad "not said: $(cat err)"
[ "$tables" = "$(cksum stopped/table.*)" ] || bad "tables of rows that were not done: $(cat stopped/table.md)"

# A row that fails: the table states the reason, the other rows are done, the exit code is not 0.
sed 's/^  - {name: naive.*/&\n  - {name: wrong, network: pod, set: {grid.centre: [900, 900, 900], train.steps: 20}}/' tiny.yaml >wrong.yaml
sdmgen experiment wrong.yaml --out wrong --peers none --json >out 2>err
code=$?
[ $code -ne 0 ] || bad 'a failed row, but exit code 0'
[ "$(wc -l <out)" -eq 1 ] || bad 'not one line of JSON'
grep -q '^sdmgen: error: 1 of 5 rows failed; the first: .*no voxel of the grid is inside any' err || bad "no summary: $(cat err)"
grep -q '^| wrong (failed) |' wrong/table.md || bad 'no row that failed'
grep -q 'wrong: failed: .*no voxel of the grid is inside any' wrong/table.md || bad 'no reason in table.md'
grep -q '^| exact engine | [0-9.]* |' wrong/table.md || bad 'the row behind it was not done'
# No training that exceeds the time budget of the experiment.
sdmgen experiment tiny.yaml train.minutes=3 experiment.minutes=2 --out late --peers none --quiet >out 2>err
[ $? -eq 4 ] || bad "over the budget: exit code"
grep -q 'its training takes 3 (experiment.minutes)' late/table.csv || bad 'no reason in table.csv'

# Variants of the grid.
cat >grids.yaml <<'END'
shape: {name: ellipsoid, options: {edge: 1}}
grid: {size: [8, 8, 8], spacing: 2}
experiment: {engine_samples: 1, pictures: 'no'}
methods: [{name: octree, engine: octree}]
variants: [{name: coarse, set: {}}, {name: fine, set: {grid.size: [16, 16, 16], grid.spacing: 1}}]
END
expect 0 - sdmgen experiment grids.yaml experiment.seed=18446744073709551615 --out grids --quiet
grep -q '"seed": 18446744073709551615,' grids/table.json || bad 'the seed in table.json'
grep -q '^| octree, coarse |' grids/table.md && grep -q '^| octree, fine |' grids/table.md || bad 'no rows of the variants'
grep -q '16 x 16 x 16 voxels of 1 mm' grids/table.csv || bad 'the grid of the variant is not used'
absent grids/octree-coarse

# Variants that differ in the grid of the maps alone use one network, at finer voxels with its fine level.
cat >finer.yaml <<'END'
shape: {name: ellipsoid, options: {edge: 1}}
grid: {size: [12, 12, 12], spacing: 1.5}
experiment: {samples: 1, engine_samples: 1}
methods:
  - {name: net, network: pod, set: {network: {depth: 0, rank: 4, modes: 8, degree: 2, fine: 4}, data: {static: 0, start: 40, online: 0, holdout: 4},
     train: {steps: 20, batch: 16, refine: 0}}}
  - {name: exact, engine: exact}
variants: [{name: own}, {name: half, finer: 2}, {name: other, set: {seed: 7}}]
END
expect 0 - sdmgen experiment finer.yaml --out finer --dry-run
has '^net, half .*23 x 23 x 23 voxels of 0.75 mm .*load, measure .*finer/net-own$'
sdmgen experiment finer.yaml --out finer >out 2>err || bad "exit code $? of the experiment on finer grids"
grep -q 'net, half: the model in finer/net-own is loaded' err || bad 'a variant on a finer grid does not use the model of the first one'
[ "$(grep -c ': training,' err)" = 2 ] || bad "$(grep -c ': training,' err) trainings, need 2"
grep -q '^| exact, half |' finer/table.md && grep -q '23 x 23 x 23 voxels of 0.75 mm' finer/table.csv || bad 'no maps on the finer grid'
[ -f finer/net-half/slices.png ] && [ -f finer/exact-half/slices.png ] || bad 'no pictures of the finer grid'
absent finer/net-half/model.sdm
sed 's/finer: 2/finer: 0/' finer.yaml >finest.yaml
expect 2 '^finest\.yaml:8:.*finer: 0 is out of range \(1 \.\. 64\)' sdmgen experiment finest.yaml

# Mistakes in the configuration.
printf 'shape: {name: ellipsoid}\ngrid: {size: [4, 4, 4], spacing: 1}\nmethods: [{name: A, engnie: exact}]\n' >bad.yaml
expect 2 "^bad\.yaml:3:21: unknown key 'engnie'; did you mean 'engine'" sdmgen experiment bad.yaml
printf 'shape: {name: ellipsoid}\ngrid: {size: [4, 4, 4], spacing: 1}\nmethods:\n  - {name: A, engine: exakt}\n' >engine.yaml
expect 2 "^engine\.yaml:4:5: engine: 'exakt' is not one of exact, .*vtk.*did you mean 'exact'" sdmgen experiment engine.yaml
cat >ranges.yaml <<'END'
grid: {size: [8, 8, 8], spacing: 2}
methods: [{name: octree, engine: octree}, {name: exact, engine: exact, set: {shape.options: {edge: 1}}}]
shape: {name: ellipsoid,
        ranges: {rz: [1.5, 20000000]}}
END
expect 2 '^ranges\.yaml:4:18: range .* must lie within' sdmgen experiment ranges.yaml --out none
expect 2 "^argument 'shape\.ranges\.rz=\[2,90000\]': range .* must lie within" sdmgen experiment ranges.yaml 'shape.ranges.rz=[2,90000]' --out none
sed 's/edge: 1/egde: 1/; s/20000000/2/' ranges.yaml >options.yaml
expect 2 "^options\.yaml:2:94: .*'egde'" sdmgen experiment options.yaml --out none
sed 's/ellipsoid/elipsoid/; s/20000000/2/' ranges.yaml >shape.yaml
expect 2 "^shape\.yaml:3:9: unknown shape 'elipsoid'; did you mean 'ellipsoid'" sdmgen experiment shape.yaml --out none
absent none
expect 2 "^argument 'train.steeps=4': unknown key 'train.steeps'; did you mean 'train.steps'" sdmgen experiment tiny.yaml train.steeps=4
expect 2 "unexpected argument 'fast', need key=value" sdmgen experiment tiny.yaml fast
expect 2 'usage: sdmgen experiment' sdmgen experiment
expect 1 'missing\.yaml' sdmgen experiment missing.yaml
expect 2 'keys stands alone' sdmgen experiment tiny.yaml --keys

# The shipped experiments are valid, and the documentation lists every key.
for config in "$source_folder"/configs/*.yaml; do
    grep -q '^methods:' "$config" || continue
    sdmgen experiment "$config" --dry-run >out 2>err || bad "$config: $(cat err)"
    ! grep -v '^sdmgen: grid: [0-9]' err || bad "$config: the lines above" # grid: auto tells what it chose
    has '^trainings: [0-9]+ min'
done
expect 0 - sdmgen experiment --keys --markdown
cp out keys.md
sed -n '/^<!-- begin: sdmgen experiment --keys --markdown -->$/,/^<!-- end -->$/p' "$source_folder/docs/experiments.md" | sed '1d;$d' >documented.md
cmp -s keys.md documented.md || bad 'docs/experiments.md is not up to date; put in the text of: sdmgen experiment --keys --markdown'
finish
