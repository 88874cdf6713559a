#!/usr/bin/env bash
# Every kind of network through all commands, from train to eval.
# Tests: bench_network.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
cat >base.yaml <<'END'
shape: {name: capsule}
grid: {size: [12, 12, 14], spacing: 1.2}
data: {static: 2, online: 16, start: 24, holdout: 4}
train: {steps: 20, batch: 4}
END

for kind in sdmnn deepsdf imnet template; do
    small="network.width=16 network.depth=2"
    [ $kind = sdmnn ] && small="$small network.channels=4"
    [ $kind = template ] && small="$small shape.name=ellipsoid" # too few voxels for the warp of a capsule
    # shellcheck disable=SC2086 # several words
    expect 0 - sdmgen train base.yaml network.kind=$kind $small --out $kind --json --quiet
    model=$kind/model.sdm
    present $model $kind/loss.png $kind/slices.png $kind/config.yaml
    expect 0 - sdmgen config $kind/config.yaml -q
    expect 0 - sdmgen info $model
    has "$kind"
    sdmgen verify $model --quiet --samples 4 >out 2>err
    code=$? # 4 is allowed: these four shapes may have larger errors than the validation shapes
    [ $code -eq 0 ] || [ $code -eq 4 ] || bad "$kind: verify: exit code $code: $(cat err)"
    has 'every checksum is right'
    # the times of the network and of the exact engine, and a word if they are about the same
    sed -En 's/^one map on one core: network ([^ ]*) ms, exact engine ([^ ]*) ms, ([^ ]*) times as long/\1 \2 \3 /p' out >times
    awk '{ ratio = $2 / $1; told = /need no network here/; near = ratio - $3 < 0.1 * ratio && $3 - ratio < 0.1 * ratio }
         END { exit !(NR == 1 && near && (told ? ratio < 2.6 : ratio > 2.4)) }' times || bad "$kind: verify: times: $(cat out)"
    # warnings of these small networks: poor, some have surface at the border of the grid or torn ones
    sdmgen generate $model -o $kind.nii -o $kind.png --json --threads 1 >out 2>err || bad "$kind: generate: $(cat err)"
    grep -Evq '^sdmgen: warning: .*(graded this model poor|distances of its maps farther than|the surface leaves the grid|the surface is torn)' err && bad "$kind: generate: $(cat err)"
    [ $kind != deepsdf ] || grep -q 'distances of its maps farther than .* are wrong by up to' err || bad "$kind: far distances: $(cat err)"
    present $kind.nii $kind.png
    hash=$(json values_crc64)
    sdmgen generate $model --json --threads 3 >out 2>err || bad "$kind: generate: $(cat err)"
    [ "$hash" = "$(json values_crc64)" ] || bad "$kind: the values depend on the number of threads"
    # a parameter out of range: the error alone, whatever is to be said of the network
    param=radius
    [ $kind != template ] || param=rx
    echo '0,0,0' >zero.csv
    for what in '-o no.npy' '--points zero.csv -o no.csv'; do
        # shellcheck disable=SC2086 # several words
        sdmgen generate $model -p $param=99 $what >out 2>err && bad "$kind: $param=99 $what"
        [ "$(grep -c . err)" = 1 ] && grep -q "^sdmgen: error: parameter '$param' = 99" err || bad "$kind: $param=99 $what: $(cat err)"
    done
    expect 0 - sdmgen eval $model --samples 2 --naive 0 --json --quiet
    awk -v v="$(json mse_mm2)" 'BEGIN { exit !(v > 0) }' || bad "$kind: eval: mse_mm2 is $(json mse_mm2)"
    expect 0 - sdmgen bench network $model --json
    awk -v v="$(json ms_network)" 'BEGIN { exit !(v > 0) }' || bad "$kind: bench: no ms_network"
    size=$(wc -c <$model)
    head -c $((size / 2)) $model >cut.sdm
    expect 3 'cut\.sdm' sdmgen generate cut.sdm -o x.npy
done
absent x.npy
expect 2 "^argument 'network.rank=4': network.rank: a network of kind deepsdf has no such key, only pod" \
    sdmgen config base.yaml network.kind=deepsdf network.rank=4
finish
