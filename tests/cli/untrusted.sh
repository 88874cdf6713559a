#!/usr/bin/env bash
# Inputs of unknown origin: texts that command a terminal, links in place of voxels, images that declare more than they hold, models that are
# not the expected ones, limits of memory.
# Tests: main.c model_open.c model_shape.c setup.c stream.c terminal.c headroom.c memory_end.cc
. "$(dirname "$0")/common.sh"
golden=$source_folder/tests/golden

# nifti DESCRIPTION: the header of a NIfTI image of 1000 x 1000 x 1000 bytes, 352 bytes long.
nifti() {
    printf '\x5c\x01\x00\x00' # 348
    head -c 36 /dev/zero
    printf '\x03\x00\xe8\x03\xe8\x03\xe8\x03\x01\x00\x01\x00\x01\x00\x01\x00' # 3 dimensions of 1000
    head -c 14 /dev/zero
    printf '\x02\x00\x08\x00\x00\x00' # bytes
    printf '\x00\x00\x80\x3f\x00\x00\x80\x3f\x00\x00\x80\x3f\x00\x00\x80\x3f\x00\x00\x80\x3f\x00\x00\x80\x3f\x00\x00\x80\x3f\x00\x00\x80\x3f'
    printf '\x00\x00\xb0\x43' # voxels at 352
    head -c 36 /dev/zero
    printf '%s' "$1" | head -c 80
    head -c $((80 - $(printf '%s' "$1" | wc -c))) /dev/zero
    head -c 116 /dev/zero
    printf 'n+1\x00\x00\x00\x00\x00'
}

# Texts that command a terminal are shown, not obeyed; JSON is UTF-8 whatever a file holds.
expect 1 '^sdmgen: error: x\\x1B\[31mred\.sdm: cannot open: ' sdmgen info $'x\x1b[31mred.sdm'
expect 1 '"error": "x\\u001b\[31m\.sdm: cannot open: ' sdmgen generate $'x\x1b[31m.sdm' --progress json -o x.npy
cat >segments.nrrd <<END
NRRD0004
type: uint8
dimension: 3
space: left-posterior-superior
sizes: 2 2 2
space directions: (1,0,0) (0,1,0) (0,0,1)
encoding: raw
space origin: (0,0,0)
Segment0_ID:=$(printf 's\xc2\x9b1')
Segment0_Name:=$(printf 'gr\xfcn\x1b]0;title\x07')
Segment0_LabelValue:=1
Segment0_Layer:=0

$(printf '\1\1\1\1\1\1\1')
END
expect 0 - sdmgen info segments.nrrd
LC_ALL=C grep -q "[$(printf '\x1b\x07\x9b\xfc')]" out && bad "a control character on the terminal: $(cat -v out)"
has 'gr\\xFCn'
expect 0 - sdmgen info segments.nrrd --json
iconv -f UTF-8 -t UTF-8 out >/dev/null || bad 'the JSON is not UTF-8'

# The voxels of a detached header are a file beside it, not a link to another one.
printf 'NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: 1 1 1\nencoding: raw\ndata file: voxels.raw\n' >detached.nhdr
printf 'secrets!' >secret
ln -s secret voxels.raw
expect 1 'voxels\.raw: a symbolic link, which is not followed' sdmgen info detached.nhdr
rm voxels.raw
cp secret voxels.raw
expect 0 - sdmgen info detached.nhdr
mkfifo pipe.nrrd
expect 1 'pipe\.nrrd: not a regular file' timeout -s KILL 100 "$program" info pipe.nrrd

# A compressed image takes memory for the voxels that it holds, not for those that it declares: 1 MB here, and 4 GB.
{ nifti 'a bomb' && head -c 1000000 /dev/urandom; } | gzip -1 >bomb.nii.gz
expect 3 'bomb\.nii\.gz: the compressed data are cut off|the file ends too early' sdmgen info bomb.nii.gz
if command -v python3 >/dev/null; then
    python3 - "$program" <<'END' || bad 'an image that declares 4 GB takes them'
import resource, subprocess, sys
subprocess.run([sys.argv[1], "info", "bomb.nii.gz"], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
sys.exit(f"{used} MB" if used > 1000 else 0)
END
fi

# A model is the one that is expected, or refused.
model=$golden/imnet.sdm
hash=$(sha256sum <"$model" | cut -d' ' -f1)
other=$(sha256sum <"$golden/deepsdf.sdm" | cut -d' ' -f1)
expect 0 - sdmgen info "$model"
has "^SHA-256 +$hash\$"
expect 0 - sdmgen info "$model" --json
[ "$(json sha256)" = "$hash" ] || bad "sha256 in the JSON: $(json sha256)"
for command in info "verify --samples 1 -q" "generate -q -o map.npy" "eval --samples 1 --naive 0 -q" "export -q -o net.onnx" "bench network" \
    "report --no-model -q -o page.html" "fit $golden/README.md -q -o fit.stl"; do
    # shellcheck disable=SC2086 # several words
    set -- $command
    name=$1 topic=
    shift
    [ $name != bench ] || { topic=$1 && shift; }
    expect 3 'imnet\.sdm: not the model of --expect: its SHA-256 is '"$hash" sdmgen $name $topic "$model" "$@" --expect "$other"
    expect 2 'need a SHA-256, 64 digits' sdmgen $name $topic "$model" "$@" --expect "${hash%?}"
    absent map.npy net.onnx page.html fit.stl
    # shellcheck disable=SC2086 # no topic: no argument
    sdmgen $name $topic "$model" "$@" --expect "$hash" >out 2>err
    ! grep -q -- '--expect' err || bad "$name: the expected model is refused: $(cat err)"
    case $name in generate | export | report) [ -s map.npy ] || [ -s net.onnx ] || [ -s page.html ] || bad "$name: no output" ;; esac
    rm -f map.npy net.onnx page.html
done
expect 2 'there is none' sdmgen info segments.nrrd --expect "$hash"
expect 2 'there is none' sdmgen bench exact --expect "$hash"
expect 2 'there is none' sdmgen export --shape torus -o x.glb --expect "$hash"

# Limits of memory: an error of one line, no crash, no file. Sanitizers and emulators need more addresses than the limits leave.
if [ $emulated = no ] && (ulimit -v 4000000 && "$program" --version) >/dev/null 2>&1; then
    nifti 'large' >large.nii
    truncate -s 1000000352 large.nii
    expect 1 'large\.nii: no memory for 4[0-9]{9} bytes' sdmgen info large.nii --max-memory 2
    rm large.nii
    for limit in $(seq 60000 4000 400000); do
        { (ulimit -v "$limit" && exec "$program" --version) >/dev/null; } 2>/dev/null && break
    done
    succeeded=0 refused=0
    for more in $(seq 4000 3000 130000); do
        (ulimit -v $((limit + more)) && exec "$program" exact --shape torus --size 40,40,20 --spacing 0.6 -q --threads 1 -o short.vdb) >out 2>err
        code=$?
        case $code in
        0) succeeded=$((succeeded + 1)) && rm short.vdb ;;
        1) refused=$((refused + 1)) && [ "$(wc -l <err)" -eq 1 ] || bad "limit $limit + $more: not one line: $(cat err)" ;;
        *) bad "limit $limit + $more kB: exit code $code: $(cat err)" ;;
        esac
        absent short.vdb
    done
    [ $succeeded -gt 0 ] && [ $refused -gt 0 ] || bad "limits of memory: $succeeded succeeded, $refused refused: the test does not test"
fi
finish
