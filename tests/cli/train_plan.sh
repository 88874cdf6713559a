#!/usr/bin/env bash
# sdmgen train --plan: time, memory and bytes of a training on several nodes; nothing is trained or written.
# Tests: plan_costs.c plan_measure.c print_plan.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
export OMP_WAIT_POLICY=passive
tiny=$source_folder/tests/cli/tiny.yaml

# equal A B: fails unless the numbers agree to 1e-9 of them
equal() { awk -v a="$1" -v b="$2" 'BEGIN { d = a - b; exit !(a != "" && d * d <= 1e-18 * b * b) }' || bad "$1 is not $2"; }

# tiny.yaml: 2688 voxels, 4 parameters; 16 + 96 + 64 maps, 8 held out; 60 steps, of which 0.4 refine; a model of 16 units and modes.
expect 0 - sdmgen train "$tiny" --plan --nodes 4 --cores 8 --json -q
[ "$(ls)" = 'err
out' ] || bad "something was written: $(ls)"
[ "$(json maps)/$(json heldout)/$(json steps)/$(json refine_steps)" = 176/8/36/24 ] || bad "work: $(cat out)"
grep -o '"stage": "[a-z]*", "seconds": [^,]*, "received_bytes": [0-9.e+]*' out | sed 's/[",]//g' | awk '{ print $2, $4, $6 }' >stages
[ "$(cut -d' ' -f1 stages | tr '\n' ' ')" = 'trials design maps bases modes fit refine ' ] || bad "stages: $(cat out)"
read -r all_seconds all_bytes <<<"$(sed 's/.*"cores": 8, "seconds": \([^,]*\), "received_bytes": \([^,]*\),.*/\1 \2/' out)"
equal "$all_seconds" "$(awk '{ s += $2 } END { printf "%.17g", s }' stages)"
equal "$all_bytes" "$(awk '{ s += $3 } END { printf "%.17g", s }' stages)"
bytes() { awk -v name="$1" '$1 == name { print $3 }' stages; }
# each of the four nodes keeps a quarter of the voxels of training maps
equal "$(bytes maps)" $(((176 * (2 * 2688 / 4 + 8 * 4 + 4) + 8 * (4 * 2688 + 8 * 4)) * 3 / 4))
# 16 modes, K coefficients: 4 R (4 (n + K) + n + h), a multiple of 4 R
[ $(($(bytes modes) % (3 * 16))) = 0 ] && [ "$(bytes modes)" -gt $((4 * 16 * (5 * 176 + 8) * 3 / 4)) ] || bad "bytes of the modes: $(bytes modes)"
# 14 inputs (degree 2), one layer: weights and biases of 16 units, 16 modes
equal "$(bytes fit)" $((36 * (16 * (8 + 4 * 16 + 8 * 16) + 4 * (15 * 16 + 16 * 16)) * 3 / 4))
equal "$(json dataset_bytes)" $((184 * (4 * 2688 + 8 * 4 + 8)))
awk '$1 != "design" && $1 != "trials" && !($2 > 0) { exit 1 }' stages || bad "times: $(cat stages)"
[ "$(grep -o '"nodes": [0-9]*, "seconds"' out | wc -l)" -eq 11 ] || bad "scaling: $(cat out)"

# Memory: as nodes keep fewer voxels, they need less of it.
four=$(json memory_bytes)
expect 0 - sdmgen train "$tiny" --plan --nodes 1 --cores 8 --json -q
[ "$four" -lt "$(json memory_bytes)" ] || bad "memory: $four bytes on one of four nodes, $(json memory_bytes) on one"

# On one node nothing is sent. A template has a design, and by default no perceptron.
cat >template.yaml <<'END'
shape: {name: ellipsoid}
grid: {size: [14, 12, 12], spacing: 1}
network: {kind: template}
data: {static: 2, online: 16, start: 24, holdout: 4}
train: {steps: 20, batch: 4}
END
expect 0 - sdmgen train template.yaml --plan -q
has '^plan for 1 node of [0-9]+ cores, from [0-9.]+ s on '
has '^  maps     52 maps +[0-9.e-]+ s  0 B  '
has '^  design  '
has '^  refine   20 steps '
has '^  nodes    1: '
has '; (more than one does not pay|it pays up to [0-9]+)'
# A budget of time: what it is for, and for how many maps it is enough. Other budgets have no such line. The trials of `auto` are a part of it.
grep -Eq '^  (budget|trials|auto) ' out && bad 'a budget of time or trials without train.minutes and auto'
expect 0 - sdmgen train template.yaml network.kind=auto train.steps=0 train.minutes=600 --plan -q
has '^  trials   36 maps +[0-9.e-]+ s  0 B +short trainings that choose between template and pod, about$'
has '^  total +10 h  0 B +the sum of these lines$'
has '^  auto     planned as pod; '
has '^  budget   train\.minutes is 600: the maps before training take [0-9.e-]+ s of it, the rest is for as many steps as fit$'
# All maps may take longer than the budget, which ends the run.
expect 0 - sdmgen train template.yaml train.steps=0 train.minutes=0.000001 --plan -q
# `total` stays the sum of the table: one line alone tells what the budget makes of it.
has '^  total +[0-9.]+ (ms|s|min)  0 B +the sum of these lines$'
has '^  budget   train\.minutes is 1e-06, less than `total`, and ends the run: after half of it \(3e-05 s\) training begins with 0 of the 36 maps that it asks for \(the other 16 of the table, data\.online, are made while it trains\); all of them take [0-9.e-]+ (s|min): raise train\.minutes to [0-9.]+, or lower data\.start or data\.static$'
# The trials are those of the kinds that are tried: where the shape allows no template, nothing but its design; a template without a
# correction needs held-out maps alone.
if ! is_brief; then
    expect 0 - sdmgen train "$tiny" network.kind=auto --plan -q
    has '^  trials  +[0-9.e-]+ s  0 B +short trainings'
    has '^  auto     planned as pod: a template does not suit the shape$'
fi
expect 0 - sdmgen train "$source_folder/configs/linkage.yaml" network.kind=auto grid=auto grid.voxels=24 data.holdout=7 --plan -q
has '^  trials   7 maps +[0-9.e-]+ s  0 B +short trainings'
# A template whose parts need no correction makes no maps for the training and no steps.
expect 0 - sdmgen train "$source_folder/configs/linkage.yaml" network.kind=template grid=auto grid.voxels=24 --plan -q
has '^  budget   train\.minutes is 4: the maps before training take [0-9.e-]+ m?s of it, the rest is for as many steps as fit$'
has '^  maps     [0-9]+ maps '
grep -q '^  refine' out && bad 'steps of a template without a correction'
expect 2 '--nodes and --cores belong to --plan' sdmgen train "$tiny" --nodes 2
expect 2 "'0'" sdmgen train "$tiny" --plan --nodes 0
# Options of a training do nothing here. A grid that cuts the shapes is told, as train does.
for option in '--ranks 2' --resume --force '--report page.html' '--dataset maps'; do
    # shellcheck disable=SC2086
    expect 2 "^sdmgen: error: --plan trains nothing: leave out ${option%% *}\$" sdmgen train template.yaml --plan $option
done
# but for the folder of an advised command
expect 0 - sdmgen train template.yaml --plan --out planned -q
[ ! -e planned ] || bad '--plan makes a folder'
cuts='warning: over the parameters the shape reaches from .*; the grid covers .* and cuts'
expect 0 "$cuts" sdmgen train template.yaml 'grid.size=[8,8,8]' --plan -q
# So does a run that is to go on, but begins, as there is no checkpoint.
expect 0 "$cuts" sdmgen train template.yaml 'grid.size=[8,8,8]' --resume --out begun -q
finish
