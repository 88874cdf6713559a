#!/usr/bin/env bash
# sdmgen config: the shipped configurations are valid; every mistake gives a line with its position.
# Tests: cmd_config.c config_shape.c
. "$(dirname "$0")/common.sh"

for config in "$source_folder"/configs/*.yaml; do
    if grep -q '^methods:' "$config"; then continue; fi # tested in experiment.sh
    sdmgen config "$config" -q >out 2>err || bad "config $config: $(cat err)"
    case $config in # the box of the published figures, and boxes like it, cut a few shapes
    */linkage.yaml | */ellipsoid.yaml) [ ! -s err ] || bad "config $config: $(cat err)" ;;
    *) grep -Ev '^sdmgen: warning: .* and cuts ([0-9.]+ % of the|only) shapes' err && bad "config $config: $(cat err)" ;;
    esac
    has 'no mistakes(, 1 warning)?$'
    expect 0 - sdmgen config "$config" --dump
    cp out resolved.yaml
    expect 0 - sdmgen config "$config" --dump
    cmp -s out resolved.yaml || bad "two dumps of $config differ"
done
cochlea=$source_folder/configs/cochlea.yaml
expect 0 - sdmgen config "$cochlea" network.depth=4 --dump
has '^  depth: 4$'
expect 0 - sdmgen config "$cochlea" --seed 77 --dump
has '^seed: 77$'
# Keys that have no effect are told in one line.
echo 'shape: {name: ellipsoid}
train: {minutes: 1}' >vain.yaml
vain() {
    sdmgen config vain.yaml "$@" >out 2>err || bad "config vain.yaml $*: $(cat err)"
    grep -E 'no effect' err | sed 's/^sdmgen: //' >told
    cat told
}
[ -z "$(vain network.kind=pod network.rank=12 train.refine_batch=8 network.width=64)" ] || bad "keys in vain: $(cat told)"
[ "$(vain train.refine=0 train.refine_batch=8 train.refine_rate=1e-4)" = 'train.refine is 0, so these keys have no effect: train.refine_batch, train.refine_rate' ] || bad "refinement in vain: $(cat told)"
[ "$(vain network.kind=pod network.depth=0 network.width=64)" = 'network.depth is 0, so these keys have no effect: network.width' ] || bad "width in vain: $(cat told)"
vain network.kind=template network.rank=12 | grep -q '^these keys are for the correction of a template, .* no effect: network.rank$' || bad "rank of a template: $(cat told)"
echo 'shape: {name: ellipsoid}
network: {kind: sdmnn, channels: 16, dropout: 0.1, depth: 3}
train: {minutes: 1}' >other.yaml
sdmgen config other.yaml network.kind=pod >out 2>err || bad "other.yaml: $(cat err)"
grep -q '^sdmgen: the kind of network on the command line has no such keys, so these of other\.yaml have no effect: network\.channels, network\.dropout$' err || bad "dropped keys: $(cat err)"
sdmgen config other.yaml 2>err || bad "other.yaml: $(cat err)"
if grep -q 'no effect' err; then bad "keys of its own kind: $(cat err)"; fi
expect 0 - sdmgen config --keys
has 'network\.depth'
expect 0 - sdmgen config --keys --markdown
has '^\|.*network\.depth'

# A grid that is fitted to the shapes: one notice, and the numbers in the resolved configuration, which gives the same grid again.
printf 'shape: {name: torus}\ntrain: {steps: 1}\n' >fitted.yaml
expect 0 '^sdmgen: grid: size: \[60, 60, 22\], spacing: 0.21, origin: \[.*over the ranges the shape reaches from' sdmgen config fitted.yaml --dump
has '^  size: \[60, 60, 22\]$'
grep -q voxels: out && bad 'voxels beside the numbers of a fitted grid'
cp out resolved.yaml
expect 0 - sdmgen config resolved.yaml --dump
cmp -s out resolved.yaml || bad 'a fitted grid does not read back'
expect 0 - sdmgen config "$cochlea" grid=auto grid.voxels=40 --dump --quiet
has '^  size: \[40, '
expect 2 "^argument 'grid.size=\[4,4,4\]': grid: size does not determine a grid; give size and spacing" sdmgen config fitted.yaml 'grid.size=[4,4,4]'

# Distributions are checked against the parameters of the shape and their ranges.
statistical=$source_folder/configs/statistical.yaml
expect 0 - sdmgen config "$statistical" 'shape.distribution={m1: uniform, m2: {mean: 0.5, deviation: 2}}' --dump
has '^    m2: \{mean: 0\.5, deviation: 2\}\}$'
expect 2 "^argument '.*': shape 'statistical' has no parameter 'm9'; did you mean 'm" \
    sdmgen config "$statistical" shape.distribution.m9=normal
expect 2 "distribution of 'm2': a normal distribution of mean 30 and deviation 1 has no values in the range -2\.5 \.\. 2\.5" \
    sdmgen config "$statistical" 'shape.distribution={m2: {mean: 30, deviation: 1}}'
sed 's/limit: 2.5 .*/limit: 10/;s/m3: .*/m3: [8, 9]/' "$statistical" >narrow.yaml # too narrow for what the shape states
cp -r "$source_folder/configs/statistical" .
expect 2 "^narrow\.yaml:$(grep -n 'm3:' narrow.yaml | cut -d: -f1):5: distribution of 'm3': a normal distribution of mean 0 and deviation 1" \
    sdmgen config narrow.yaml

# Three mistakes give three lines, each with file, line and column, and exit code 2.
cat >bad.yaml <<'END'
shape:
  name: cochlea
grid:
  size: [60, 50, 50]
  spacing: 0.2
network:
  dpeth: 3
  width: wide
train:
  minutes: 5
  batch: -4
END
sdmgen config bad.yaml >out 2>err
[ $? -eq 2 ] || bad 'three mistakes: wrong exit code'
[ "$(wc -l <err)" -eq 3 ] || bad "three mistakes need three lines: $(cat err)"
grep -Eq "^bad\.yaml:7:3: .*dpeth.*did you mean '(network\.)?depth'" err || bad "no line for dpeth: $(cat err)"
grep -Eq '^bad\.yaml:8:[0-9]+: .*width' err || bad "no line for width: $(cat err)"
grep -Eq '^bad\.yaml:11:[0-9]+: .*batch' err || bad "no line for batch: $(cat err)"
sdmgen train bad.yaml --out never >out 2>err
[ "$?,$(wc -l <err)" = 2,3 ] || bad "train must refuse it in the same way: $(cat err)"
absent never

expect 2 "^argument 'network.dpth=4': .*did you mean" sdmgen config "$cochlea" network.dpth=4
expect 2 "unexpected argument 'depth', need key=value" sdmgen config "$cochlea" depth
expect 1 'missing\.yaml' sdmgen config missing.yaml
expect 2 'usage: sdmgen config' sdmgen config
expect 2 'keys stands alone' sdmgen config "$cochlea" --keys

# Mistakes that only the shape can detect: its name, options and ranges.
base='shape: {name: %s}\ngrid: {size: [8, 8, 8], spacing: 1}\ntrain: {steps: 5}\n'
# shellcheck disable=SC2059 # the format is the file
printf "$base" cochlae >unknown.yaml
expect 2 "^unknown\.yaml:1:[0-9]+: .*'cochlae'.*did you mean 'cochlea'" sdmgen config unknown.yaml
# shellcheck disable=SC2059
printf "$base" 'cochlea, options: {eer: left}' >option.yaml
expect 2 "^option\.yaml:1:[0-9]+: .*'eer'" sdmgen config option.yaml
# shellcheck disable=SC2059
printf "$base" 'cochlea, ranges: {a: [1, 9]}' >range.yaml
expect 2 '^range\.yaml:1:[0-9]+: .*a' sdmgen config range.yaml

# All mistakes in one run: in the keys of the file and in options, ranges and distributions of the shape; the same by train.
cat >all.yaml <<'END'
shape:
  name: cochlea
  options:
    eer: left
    start: square
    edge: 0.3
    zzzz: 1
  ranges:
    a: [1, 9]
    alpha: [0.1, 0.2]
    qqqqqq: [0, 1]
  distribution: {b: normal, c: normal}
grid: {size: [8, 8, 8], spacing: 1}
train: {steps: 5}
END
sed '/eer:/d;/start:/d;/zzzz/d' all.yaml >ranges.yaml
sdmgen config ranges.yaml >out 2>err
[ "$?,$(wc -l <err)" = 2,3 ] || bad "three mistakes in ranges and distributions: $(cat err)"
grep -Eq "^ranges\.yaml:6:[0-9]+: range \[1, 9\] of 'a' must lie within" err || bad "no line for a: $(cat err)"
grep -Eq "^ranges\.yaml:8:[0-9]+: shape 'cochlea' has no parameter 'qqqqqq'; its parameters are a, alpha, b, phi" err ||
    bad "no line for qqqqqq: $(cat err)"
grep -Eq "^ranges\.yaml:9:[0-9]+: shape 'cochlea' has no parameter 'c'" err || bad "no line for c: $(cat err)"
sed 's/cochlea/torus/;/start:/d;s/eer: left/edge: 9/;/edge: 0.3/d' all.yaml >torus.yaml # a shape without create(): options and ranges together
sdmgen config torus.yaml network.width=wide >out 2>err
cat >expected <<'END'
^argument 'network\.width=wide': .*width
^torus\.yaml:4:5: shape 'torus': option 'edge' is 9 mm, need 0\.02 \.\. 1$
^torus\.yaml:5:5: shape 'torus' has no option 'zzzz'; its options are edge$
^torus\.yaml:7:5: shape 'torus' has no parameter 'a'; its parameters are major, minor$
^torus\.yaml:8:5: shape 'torus' has no parameter 'alpha'
^torus\.yaml:9:5: shape 'torus' has no parameter 'qqqqqq'
^torus\.yaml:10:[0-9]+: shape 'torus' has no parameter 'b'
^torus\.yaml:10:[0-9]+: shape 'torus' has no parameter 'c'
END
[ "$(wc -l <err)" -eq 8 ] || bad "eight mistakes: $(cat err)"
paste -d '\n' expected err | while read -r pattern && read -r line; do
    [[ $line =~ $pattern ]] || echo "'$line' does not match '$pattern'"
done >wrong
[ -s wrong ] && bad "$(cat wrong)"
cp err config.err
sdmgen train torus.yaml network.width=wide --out never >out 2>err
[ $? -eq 2 ] && cmp -s err config.err || bad "train must report the same mistakes: $(cat err)"
absent never
sdmgen config all.yaml >out 2>err # the cochlea has other parameters with other options: those first
[ "$?,$(wc -l <err)" = 2,3 ] || bad "three mistakes in options: $(cat err)"
grep -Eq "^all\.yaml:5:[0-9]+: shape 'cochlea': option 'start' is 'square'" err || bad "no line for start: $(cat err)"
# a file that is no text
printf 'shape: {name: torus}\n' | gzip >image.nii.gz
expect 2 'image.nii.gz:1:1: a file compressed by gzip, no configuration$' sdmgen config image.nii.gz
finish
