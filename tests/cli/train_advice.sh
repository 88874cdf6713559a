#!/usr/bin/env bash
# sdmgen train: what auto has kept, the verdict, and the command for the next training.
# Tests: forecast.c model_before.c next_training.c report_verdict.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes

# The second kind of auto does not fit into memory: --quiet does not hide which one is kept.
cat >link.yaml <<'YAML'
shape: {name: linkage, options: {links: 1, motion: planar, limit: 0.5, edge: 0.5}}
grid: {size: [21, 19, 22], spacing: 0.34, origin: [-2.13, -3.07, -4.98]}
network: {width: 16, modes: 24, rank: 6, degree: 3}
data: {static: 0, static_share: 0, start: 100000, online: 20, holdout: 12, memory_gb: 0.0085}
train: {steps: 60, batch: 16, refine_batch: 8}
YAML
expect 0 'warning: auto: template is kept, because pod failed: ' sdmgen train link.yaml --out link --quiet
# a template keeps held-out maps alone: the others do not count among those that need too much memory
expect 2 'data.static \(0 maps\), data.start \(0\) and data.holdout \(500\) on .* need 0\.0[0-9]+ GB, data.memory_gb is 0\.001' \
    sdmgen train link.yaml network.kind=template data.holdout=500 data.memory_gb=0.001 --out vain --quiet

# Fewer maps than data.start fit into the memory: the training begins with these, and says so.
sdmgen train link.yaml network.kind=pod data.start=700 data.memory_gb=0.012 --out full >out 2>err || bad "full: $(cat err)"
grep -q '^sdmgen: data.memory_gb is 0.012: of 700 random maps (data.start) on 8.78e+03 voxels the training starts with 659, ' err ||
    bad "the memory for maps: $(cat err)"

# A template that errs far from the surface alone: nothing to change, or pod, at a price that auto has measured.
cat >far.yaml <<'YAML'
shape: {name: linkage, options: {links: 2, length: 1, radius: 1, tip: 1, joint: 1, base: 1}}
grid: {spacing: 0.2}
data: {static: 2, start: 64, online: 0, holdout: 12}
train: {minutes: 4}
YAML
pod='^  far away    where distances far from the surface matter: pod; '
expect 0 - sdmgen train far.yaml --out far --quiet
has '^  verdict     Far from the surface .*: nothing to change for surfaces, level sets and fits near the surface; where distances far away matter, set network.kind to pod'
has "${pod}auto has tried it, too: within a voxel of the surface [0-9.]+ mm, [0-9.e+]+ times worse; everywhere [0-9.]+ mm, .* \(a trial, which training improves\)\$"
has '^              sdmgen train far\.yaml train\.minutes=4 network\.kind=pod --out far-pod --compare far/model\.sdm$'
expect 0 - sdmgen train far.yaml network.kind=template train.minutes=0.02 --out named --quiet
has "${pod}this run has not measured it: near the surface it may be worse\$"
has '^              sdmgen train far\.yaml train\.minutes=0\.02 network\.kind=pod --out named-pod --compare named/model\.sdm$'
# it has learned from meshes, not from maps of whole shapes
expect 0 - sdmgen info named/model.sdm
has '^training     [0-9.]+ s, from meshes and exact maps of the parts, seed [0-9]+, sdmgen '

# A good model with a small error: the command mends the first use that it leaves out.
expect 0 - sdmgen train far.yaml network.kind=template train.minutes=0.02 grid.spacing=0.3 --out fine --quiet
has '^  better      sdmgen train far\.yaml network\.kind=template train\.minutes=0\.02 grid=auto grid\.spacing=0\.1[0-9]+ --out fine-2 --compare fine/model\.sdm$'
has '^              \(the finer grid is for volumes of surfaces, see `not for`; it has [0-9.]+ times the voxels; nothing else needs to change, because the error at the surface is only 0\.01[0-9]* voxels\)$'

# A template that saves little time against exact maps: the line names pod, and what is known of it.
expect 0 - sdmgen train far.yaml network.kind=template shape.options.edge=2 shape.options.links=1 grid.spacing=0.05 data.holdout=2 --out large --quiet
if grep -oE '[0-9.]+ times as long' out | head -1 | awk '{ exit !($1 < 2.99) }'; then
    has '^  slow        exact maps take only [0-9.]+ times as long as this template: the network saves little time; pod may take far less; this run has not measured it$'
    [ "$(grep -c 'network.kind=pod --out large-pod' out)" -eq 1 ] || bad "the command for pod: $(cat out)"
fi

# auto: the command names the kind that was kept and the cost of its maps; that of the other kind is in its line and in the JSON.
expect 0 - sdmgen train link.yaml data.start=300 data.memory_gb=6 data.holdout=12 --out both --quiet
has '^  auto        trained (pod|template), too \((good|usable|poor)\): RMSE .*, [0-9.e-]+ ms a map.*; derivatives of maps off by [0-9.]+ %, those of (pod|template) by [0-9.]+ %; its model is both/model-(pod|template)\.sdm$'
# each figure of the end stands there once
has '^  held out    12 shapes: RMSE [0-9.]+ mm \([0-9.]+ voxels\), MSE [0-9.e-]+ mm\^2; within a voxel of the surface [0-9.]+ mm \([0-9.]+ voxels\); Dice [0-9.]+, smallest [0-9.]+$'
has '^  by distance within two voxels \(0\.68 mm\) of the surface [0-9.]+ mm, '
has '^  derivatives by the parameters, of [0-9]+ shapes: .*; of volumes: see `not for`$'
has '^  (next|better) +sdmgen train link.yaml .*network.kind=(pod|template) --out both-2 --compare both/model\.sdm$'
has '^              \(the kind stays (pod|template)(, whose maps take [0-9.e-]+ ms)?; without network\.kind=(pod|template) auto chooses again[;)]'
other=$(sed -n 's/.*; its model is //p' out)
present "$other"
expect 0 - sdmgen info "$other" --quiet
sdmgen train link.yaml data.start=300 data.memory_gb=6 train.steps=0 train.minutes=0.0001 --out both --force >out 2>err || bad "hurried: $(cat err)"
grep -Eq '^sdmgen: [0-9.e+]+ exact maps a second: about 0 fit into their part of train\.minutes \(0\.0001\); [0-9] parameters? asks? for [0-9]+; if too few limit the model, the last lines of the run name the train\.minutes for more$' err ||
    bad "no word about the pace of maps: $(cat err)"
grep -Eq '^sdmgen: auto: trials of both kinds would take about [0-9.]+ s, and a fifth of train\.minutes is 0\.0012 s: template alone has one \(for both raise train\.minutes to [0-9.]+\)$' err ||
    bad "no word about the trials ahead: $(cat err)"
# the budget is too short for a trial of the other kind: the verdict says so, and the command tries both
has '^  verdict     network\.kind: auto had no time left to train pod, too: pod may be better than template, near the surface, too\. '
[ "$(grep -c 'nothing to change\|has not measured it' out)" -eq 0 ] || bad "an unfinished comparison: $(cat out)"
has '^  (next|better) +sdmgen train link\.yaml .*train\.minutes=[0-9.]+ --out both-2 --compare both/model\.sdm$'
grep -q 'train\.minutes=0\.0001 network' out && bad "minutes that did not suffice: $(cat out)"
has '^              \(auto had no time for pod: this train\.minutes is enough to try both kinds(; a training of pod alone asks for [0-9.]+)?\)$'
rm -r both
expect 0 - sdmgen train link.yaml data.start=300 data.memory_gb=6 --out both --quiet --json
has '"other": \{"kind": "(pod|template)", .*"ms_network": [0-9.e-]+, "grade": "[a-z]+", "model": "both/model-(pod|template)\.sdm"\}'
# A model that --force replaces is compared at exact surfaces, and by its RMSE on the same grid. With the kind given, the command names none.
grep -q before_ out && bad 'a model before the first one'
replace='sdmgen train link.yaml network.kind=pod data.start=300 data.memory_gb=6 network.rank=1 --out both --force --quiet'
before='^  before      distances at points of 16 exact surfaces, which are 0: '
number='[0-9.e-]+'
expect 0 - $replace
has "$before$number -> $number mm \([0-9.e+]+ times worse\); RMSE of all voxels $number -> $number mm \([0-9.e+]+ times worse\)\$"
has '^  (next|better) '
grep -q 'the kind stays' out && bad "the kind was given: $(cat out)"
expect 0 - $replace
has "$before($number) -> \1 mm \(the same\); RMSE of all voxels ($number) -> \2 mm \(the same\)\$"
# where the exact surface is, both models err by their voxels and by their networks
expect 0 - $replace --json
awk -v surface="$(json surface_mm)" -v was="$(json before_surface_mm)" -v grid="$(json grid_mm2)" -v near="$(json rmse_voxel_mm)" \
    'BEGIN { most = sqrt(grid + near ^ 2); exit !(surface == was && surface > most / 2 && surface < 2 * most) }' ||
    bad "the distance at the surface: $(cat out)"
# another grid: the surfaces are the same; smaller voxels follow them better
expect 0 - sdmgen train far.yaml network.kind=template train.minutes=0.02 grid.spacing=0.2 --out finer --compare fine/model.sdm --quiet
has "$before$number -> $number mm \([0-9.]+ times better\)\$"
# other ranges or options: not compared, and why
expect 0 - $replace 'shape.ranges.q1=[-0.4,0.4]'
has "^  before      not compared with the model of before: its range of 'q1' is another\$"
expect 0 - $replace 'shape.ranges.q1=[-0.4,0.4]' shape.options.edge=0.6
has '^  before      not compared with the model of before: the options of its shape are others$'
# --compare: refused before the training
echo '{shape: {name: ellipsoid}, train: {steps: 10}}' >round.yaml
expect 1 'none\.sdm: ' sdmgen train link.yaml --out new --compare none.sdm
expect 2 "--compare fine/model\.sdm: it is a model of the shape 'linkage', not of 'ellipsoid'" \
    sdmgen train round.yaml --out new --compare fine/model.sdm --quiet
[ ! -e new ] || bad 'a folder of a refused training'

# Keys that a template without a correction does not need: told, by kind.
sdmgen train link.yaml network.kind=template --out vain >out 2>err || bad "vain: $(cat err)"
grep -q '^sdmgen: the template needs no training, so these keys have no effect: network.width, .*, network.degree, data.online, ' err || bad "vain keys: $(cat err)"
finish
