#!/usr/bin/env bash
# The modules of 3D Slicer: their descriptions against a schema, and a host that calls them as Slicer does on a phantom.
# Tests: cmd_slicer.c results_file.c slicer_arguments.c slicer_description.c slicer_modules.c fit_return.c
. "$(dirname "$0")/common.sh"
tests=$source_folder/tests/cli
export OMP_WAIT_POLICY=passive

expect 2 'need one of SdmgenFit, SdmgenExact, SdmgenGenerate' sdmgen slicer SdmgenTrain
expect 2 '--install DIR or the name of a module' sdmgen slicer
expect 0 'additional module paths' sdmgen slicer --install a/modules
expect 0 'additional module paths' sdmgen slicer --install a/modules # again
for name in SdmgenFit SdmgenExact SdmgenGenerate; do
    expect 0 - a/modules/$name --xml
    cmp -s out a/modules/$name.xml || bad "$name.xml differs from --xml"
    expect 0 - sdmgen slicer $name
    cmp -s out a/modules/$name.xml || bad "$name.xml differs from sdmgen slicer $name"
    [ "$(head -c 5 out)" = '<?xml' ] || bad "$name does not begin with <?xml"
    if command -v xmllint >/dev/null; then
        xmllint --noout --relaxng "$tests/slicer_module.rng" a/modules/$name.xml 2>err || bad "$(head -n 3 err)"
    fi
done
# a file of this name that is no link stays
mkdir b && echo mine >b/SdmgenExact
expect 1 'a file of this name that is no link' sdmgen slicer --install b
[ "$(cat b/SdmgenExact)" = mine ] || bad 'a file was overwritten'

# Slicer's command line: texts may be lists, choices may be "default", a region is centre and half edges
expect 0 - a/modules/SdmgenExact --returnparameterfile r --shape cochlea --param 'a=4.2; alpha=0.5;' --option edge=0.6 --size 12,10,10 \
    --spacing 1 --method default --sign auto --distances by-slicer.npy --quiet
grep -q '^closed = yes$' r || bad "no 'closed' in $(cat r)"
expect 0 - sdmgen exact --shape cochlea -p a=4.2 -p alpha=0.5 -O edge=0.6 --size 12,10,10 --spacing 1 -o direct.npy --quiet
cmp -s by-slicer.npy direct.npy || bad 'the module makes another map than the command'
sdmgen phantom --shape torus --spacing 0.5 -o ct.nrrd --label label.nrrd -o ct.nii.gz --quiet
expect 2 'more than one of image, labels and surface' a/modules/SdmgenFit --image ct.nrrd --labels label.nrrd
expect 2 'need six numbers, centre and half edges' a/modules/SdmgenFit --image ct.nrrd --shape torus --region 1,2,3
expect 2 'unknown option --frob' a/modules/SdmgenExact --frob 2
expect 2 'needs a value' a/modules/SdmgenExact --mesh
expect 3 'label' a/modules/SdmgenFit --labels ct.nrrd --label 77777 --shape torus --rotation 0,0,0
[ "$failures" -eq 0 ] || finish

# Slicer hands surfaces over in the first format of this list
[ "$(grep -c 'fileExtensions="\.vtp,' a/modules/SdmgenFit.xml)" -eq 2 ] || bad 'surfaces are not passed as .vtp'
[ "$failures" -eq 0 ] || finish

# the host
python=/usr/bin/python3
[ -x $python ] || python=python3
if ! $python -c 'import nibabel, vtk' 2>/dev/null; then
    echo 'skipped: nibabel and VTK for Python are not installed'
    finish
fi
host() { $python "$tests/slicer_host.py" a/modules "$@"; }
host_without_notices() { host "$@" 2>errors; }
expect 0 - host SdmgenExact shape=torus 'param=major=3;minor=1' size=20,20,10 spacing=0.5 distances=d.nii.gz
has '^modules SdmgenExact SdmgenFit SdmgenGenerate$'
has '^closed: yes$'
volume=$(sed -n 's/^volume: //p' out)
near "$volume" 59.2 1.2 # 2 pi^2 R r^2
has '^file distances: .20, 20, 10. -0\.'

cat >more.txt <<'END'
rotation=0,0,0
shape=torus
spacing=0.4
END
mapfile -t more <more.txt
expect 0 - host_without_notices SdmgenFit image=ct.nrrd reference=label.nrrd surface=s.vtp segmentation=l.nrrd distances=d.nrrd results=r.json "${more[@]}"
has '^progress [1-9][0-9]* 1$'
has '^verdict: (passed|doubtful)$'
has '^parameters: *major=3\.[0-9]* minor='
dice=$(sed -n 's/^dice: //p' out)
near "$dice" 0.95 0.03
has '^file surface: [0-9]+ points, volume (5[6-9]|60)\.'
has '^file segmentation: .* 0\.000 1\.000$'
has '^file distances: .* -(0\.[89]|1\.0)'
present r.json
expect 0 - host_without_notices SdmgenFit labels=label.nrrd surface=s.ply "${more[@]}" # label 1 is the default
expect 0 - host_without_notices SdmgenFit points=s.vtp surface=t.ply "${more[@]}"
expect 4 - host_without_notices SdmgenFit image=ct.nrrd surface=no.ply inside=5000,10 max_iterations=1 "${more[@]}"
grep -q 'the image shows no such shape' errors || bad "no reason: $(cat errors)"
absent no.ply

model=../files-of-trained/run/model.sdm
present $model
expect 0 'warning: c.vtp: the surface encloses .* less than the shape' host SdmgenGenerate model=$model param=a=4.2 surface=c.vtp distances=c.nrrd
has '^parameters: *a=4\.2 '
has '^file surface: [0-9]+ points'
expect 5 'allowed' host SdmgenGenerate model=$model param=a=9 surface=no.ply
absent no.ply
finish
