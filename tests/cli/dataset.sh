#!/usr/bin/env bash
# sdmgen dataset: shards in parts, continued, damaged, foreign; a training that takes its maps from them gives the same bits.
# Tests: cmd_dataset.c compare_maps.c make_dataset.c map_store.c option_texts.c part.c shard.c shard_identity.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
export OMP_WAIT_POLICY=passive
cat >small.yaml <<'END'
shape: {name: torus, options: {edge: 1}, ranges: {major: [2, 3.5]}}
grid: {size: [14, 14, 6], spacing: 0.8}
network: {kind: pod, depth: 1, width: 16, rank: 4, modes: 16, degree: 2, input_degree: 2}
data: {static: 4, online: 100, start: 100, holdout: 8}
train: {steps: 20, batch: 8, refine_batch: 4}
END

# All at once, and in parts in any order: the same files.
expect 0 - sdmgen dataset small.yaml -o all -q
has '^4 files: 4 made, 0 were there, 0 failed; 224 maps, '
[ "$(cd all && echo *)" = 'holdout-00000000.sdms random-00000000.sdms random-00000128.sdms static-00000000.sdms' ] || bad "files: $(ls all)"
for i in 3 1 2; do expect 0 - sdmgen dataset small.yaml -o parts --part $i/3 -q --threads $i; done
diff -r all parts || bad 'parts make other files'
expect 0 'part 2 of 3: files 2 to 2 of 4; the others are not made by this call' sdmgen dataset small.yaml -o parts --part 2/3
expect 0 - sdmgen dataset small.yaml -o parts --part 2/3 --json -q
[ "$(json kept)/$(json made)/$(json files_of_all_parts)" = 1/0/4 ] || bad "JSON: $(cat out)"
expect 2 "part '4/3': need I/N" sdmgen dataset small.yaml -o parts --part 4/3
expect 2 'need one -o DIR' sdmgen dataset small.yaml

# A training with maps from files: the same bits, for all maps, for some, and for another kind of network.
expect 0 - sdmgen train small.yaml --out plain -q
sdmgen train small.yaml --out stored --dataset all/ 2>err >out
grep -q '^sdmgen: all 224 maps come from the dataset' err || bad "$(cat err)"
cmp plain/model.sdm stored/model.sdm || bad 'another model'
cmp plain/metrics.jsonl stored/metrics.jsonl || bad 'other metrics'
rm parts/random-00000128.sdms
sdmgen train small.yaml --out some --dataset parts 2>err >out
grep -q '^sdmgen: 152 of 224 maps come from the dataset, the other 72 are made now' err || bad "$(cat err)"
cmp plain/model.sdm some/model.sdm || bad 'another model with some of the maps'
for more in network.kind=auto data.sampling=error; do
    expect 0 - sdmgen train small.yaml $more --out plain --force -q
    expect 0 - sdmgen train small.yaml $more --out stored --force --dataset all -q
    cmp plain/model.sdm stored/model.sdm || bad "another model: $more"
done

# More maps: the maps that are there are kept, the last file is longer.
expect 0 - sdmgen dataset small.yaml -o parts -q
expect 0 - sdmgen dataset small.yaml -o parts -q --maps 300
has '^5 files: 2 made, 3 were there, 0 failed; 324 maps'
expect 0 - sdmgen dataset small.yaml -o more -q --maps 300
diff -r more parts || bad 'a longer dataset differs'
expect 0 - sdmgen dataset small.yaml -o more -q --maps 0
has '^2 files: 0 made, 2 were there, 0 failed; 24 maps'

# Maps of another configuration.
for change in seed=2 data.static=3 shape.ranges.major='[2.5,4]' grid.spacing=0.9 shape.options.edge=0.4 shape.distribution=normal; do
    key=${change%%=*}
    expect 2 "all/[a-z]*-0*.sdms: its maps are those of another configuration: $key.* there, .* here$" sdmgen train small.yaml "$change" --out no --dataset all
    expect 2 "all/[a-z]*-0*.sdms: its maps are those of another configuration: $key.* there, .* here$" sdmgen dataset small.yaml "$change" -o all
done
sed 's/{name: torus.*/{name: capsule}/' small.yaml >capsule.yaml
expect 2 "another configuration: shape.name is torus there, capsule here" sdmgen train capsule.yaml --out no --dataset all
mkdir none
expect 2 'none: no shards of maps \(\*.sdms\): `sdmgen dataset` makes them' sdmgen train small.yaml --out no --dataset none
expect 2 'nowhere: no shards of maps' sdmgen train small.yaml --out no --dataset nowhere
absent no
expect 3 'a shard of maps, not a model' sdmgen info all/static-00000000.sdms

# Damaged files: a training refuses them, another call makes them again.
byte() { printf '\x55' | dd of="$1" bs=1 seek="$2" conv=notrunc status=none; }
byte all/random-00000000.sdms 20000
expect 3 'all/random-00000000.sdms: damaged: the checksum of map [0-9]* is wrong: `sdmgen dataset` makes the file again' sdmgen train small.yaml --out no --dataset all -q
absent no
expect 0 'warning: all/random-00000000.sdms: damaged: the checksum of section .maps. is wrong' sdmgen dataset small.yaml -o all -q
has '^4 files: 1 made, 3 were there, 0 failed'
byte all/holdout-00000000.sdms 100
expect 3 'all/holdout-00000000.sdms: damaged: the checksum of the header is wrong' sdmgen train small.yaml --out no --dataset all -q
expect 0 'warning: all/holdout-00000000.sdms: damaged: the checksum of the header' sdmgen dataset small.yaml -o all -q
truncate -s 5000 all/static-00000000.sdms
expect 0 'warning: all/static-00000000.sdms: truncated' sdmgen dataset small.yaml -o all -q
mv all/static-00000000.sdms all/static-00000128.sdms
expect 3 'static-00000128.sdms: this is static-00000000.sdms under another name' sdmgen train small.yaml --out no --dataset all -q
mv all/static-00000128.sdms all/static-00000000.sdms
for i in 1 2; do expect 0 - sdmgen dataset small.yaml -o parts --part $i/2 -q; done
for name in all/*; do [ "$name" = all/random-00000128.sdms ] || cmp "$name" "parts/${name#all/}" || bad "$name was not mended"; done

# Nowhere to write; an interrupt leaves whole files.
echo >file
expect 1 'file' sdmgen dataset small.yaml -o file -q
stopped_at '"progress"' dataset small.yaml grid.size=[60,60,30] grid.spacing=0.18 -o long --maps 20000 --progress json
expect 0 - sdmgen dataset small.yaml grid.size=[60,60,30] grid.spacing=0.18 -o long --maps 0 -q

# The reader of the page, against the exact engine.
python=
for p in python3 /usr/bin/python3; do $p -c 'import numpy' 2>/dev/null && python=$p && break; done
if [ -z "$python" ]; then
    finish
    echo 'python3 with numpy is missing'
    exit 77
fi
sed -n '/^```python$/,/^```$/p' "$source_folder/docs/dataset.md" | sed '/^```/d' >reader.py
cat >>reader.py <<'END'

import subprocess, sys
about, params, maps = read_shard("all/random-00000128.sdms")
assert about["set"] == "random" and int(about["first"]) == 128 and len(maps) == len(params) == 72, about
origin = ",".join(about["grid.origin"].split())
for k in (0, 71):
    major, minor = params[k]
    subprocess.run([sys.argv[1], "exact", "--shape", "torus", "-O", "edge=1", "-p", f"major={major!r}", "-p", f"minor={minor!r}", "--size", "14,14,6",
                    "--spacing", "0.8", f"--origin={origin}", "-o", "one.npy", "-q"], check=True)
    assert np.array_equal(np.load("one.npy"), maps[k]), k
END
expect 0 - "$python" reader.py "$program"

# Maps of another program: one value of a held-out map differs, with right checksums.
cat >other.py <<'END'
import struct, sys
sys.path.insert(0, sys.argv[1])
from sdm_file import crc64
path = "all/holdout-00000000.sdms"
data = bytearray(open(path, "rb").read())
n, = struct.unpack_from("<I", data, 12)
place = {data[at:at + 24].rstrip(b"\0").decode(): at for at in range(24, 24 + 48 * n, 48)}
bounds = lambda name: struct.unpack_from("<QQ", data, place[name] + 24)
maps, size = bounds("maps")
value, = struct.unpack_from("<f", data, maps)
struct.pack_into("<f", data, maps, value + 0.25)
struct.pack_into("<Q", data, bounds("sums")[0], crc64(data[maps:maps + size // 8]))
for name in ("sums", "maps"):
    at, size = bounds(name)
    struct.pack_into("<Q", data, place[name] + 40, crc64(data[at:at + size]))
struct.pack_into("<Q", data, 24 + 48 * n, crc64(data[:24 + 48 * n]))
struct.pack_into("<Q", data, len(data) - 8, crc64(data[:-8]))
open(path, "wb").write(data)
END
expect 0 - env PYTHONDONTWRITEBYTECODE=1 "$python" other.py "$source_folder/tests/oracle"
expect 2 'holdout-00000000.sdms: map 0 differs from the one that this program makes by up to 0.25 mm: another version of sdmgen' sdmgen train small.yaml --out no --dataset all -q
finish
