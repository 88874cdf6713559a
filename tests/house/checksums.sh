#!/usr/bin/env bash
# checksums.sh SDMGEN SOURCE_FOLDER NEW_FOLDER: runs about 150 commands of the program (training of every kind of network, maps by every
# method, level sets, images, surfaces, phantoms, fits) in NEW_FOLDER and prints a checksum for each output. Two programs that print the same
# list compute the same bits: use it before and after a change that must not change results.
#   tests/house/checksums.sh build/before/cli/sdmgen . /tmp/before >before.txt
#   tests/house/checksums.sh build/release/cli/sdmgen . /tmp/after >after.txt && diff before.txt after.txt
# Pictures are left out. Help texts and notices may differ after a change of wording.
set -u
p=$(realpath "$1")
src=$(realpath "$2")
work=$3
export LC_ALL=C OMP_WAIT_POLICY=passive
mkdir -p "$work"
cd "$work"
# "ms_..", "seconds..", threads and versions differ from run to run
strip() { sed -E "s%$src%SRC%g" | sed -E 's/"(ms_[a-z_]*|seconds[a-z_]*|threads|[a-z_]*_over_network|naive_share|workers|memory_mb|made_by|build)": [^,}]*//g'; }
r() { local name=$1; shift; "$p" "$@" >$name.raw 2>$name.err; echo "exit $?" >>$name.raw; strip <$name.raw >$name.out; rm $name.raw; }
# training
cp $src/tests/cli/tiny.yaml tiny.yaml
cat >base.yaml <<'END'
shape: {name: capsule}
grid: {size: [14, 12, 10], spacing: 1.2}
data: {static: 2, online: 16, start: 24, holdout: 4}
train: {steps: 20, batch: 4}
END
cat >ell.yaml <<'END'
shape: {name: ellipsoid, options: {edge: 0.6}, ranges: {rx: [3, 4.2], ry: [2.2, 3], rz: [1.5, 2.2]}}
grid: {size: [26, 22, 18], spacing: 0.45}
network: {kind: pod, depth: 1, width: 16, rank: 8, modes: 16, degree: 2, input_degree: 2}
data: {static: 2, online: 64, start: 96, holdout: 8}
train: {steps: 60, batch: 16, refine_batch: 8}
seed: 3
END
r train_pod train tiny.yaml --out pod --json -q
r train_ell train ell.yaml --out ell --json -q --threads 1
for k in sdmnn deepsdf imnet template; do small="network.width=16 network.depth=2"; [ $k = sdmnn ] && small="$small network.channels=4"
  [ $k = template ] && small="$small shape.name=ellipsoid"
  r train_$k train base.yaml network.kind=$k $small --out $k --json -q; done
for m in pod ell sdmnn deepsdf imnet template; do
  r info_$m info $m/model.sdm --json
  r gen_$m generate $m/model.sdm --json -o $m.nii -o $m.nii.gz -o $m.nrrd -o $m.mha -o $m.npy -o $m.ply -o $m.stl -o $m.obj -o $m.off -o $m.vdb --gradient $m.g.npy --jacobian $m.j.npy --check
  r gend_$m generate $m/model.sdm -o $m.d.vdb --dense --half --json
  r genb_$m generate $m/model.sdm -o $m.b.vdb --band 4 --json
  r genx_$m generate $m/model.sdm --policy exact --max-error 0.05 -o $m.x.npy --json
  r ver_$m verify $m/model.sdm --samples 5 --json
  r eval_$m eval $m/model.sdm --samples 4 --naive 0 --json -q
done
for f in pod.nii pod.nii.gz pod.nrrd pod.mha pod.npy pod.ply pod.stl pod.obj pod.off pod.vdb pod.d.vdb pod.b.vdb; do r info_f_$f info $f --json; r ver_f_$f verify $f --json; done
r gen_bad generate pod/model.sdm -p a=99 -o x.npy
r gen_clamp generate pod/model.sdm -p a=99 --policy clamp -o clamp.npy --json
# exact
for s in cochlea torus ellipsoid capsule linkage; do
  r ex_$s exact --shape $s --json -o ex_$s.npy -o ex_$s.nrrd -o ex_$s.ply -o ex_$s.vdb --closest ex_$s.c.npy --normal ex_$s.n.npy --triangle ex_$s.t.npy --jacobian ex_$s.j.npy --certify
  for m in naive cells octree edt; do sz="--size 20,18,16"; [ $m != naive ] && sz="--size 40,36,32"; r ex_${s}_$m exact --shape $s --method $m $sz --json -o ex_${s}_$m.npy; done
  for g in crossings pseudonormal winding; do r ex_${s}_s$g exact --shape $s --sign $g --size 30,30,30 --json -o ex_${s}_s$g.npy; done
  r ex_${s}_k exact --shape $s --keep-overlap --size 33,31,30 --json -o ex_${s}_k.npy
  r ex_${s}_n exact --shape $s --narrow 5 --json -o ex_${s}_n.npy -o ex_${s}_n.vdb
  r mesh_$s mesh --shape $s --audit --json -o m_$s.ply -o m_$s.stl -o m_$s.obj -o m_$s.off
  r ex_m_$s exact --mesh m_$s.stl --size 31,29,30 --certify --json -o ex_m_$s.npy
  r shapes_$s shapes $s --json
  r ph_$s phantom --shape $s --spacing 0.4 --random-params --random-pose 20,1 --seed 5 --air-cells 0.3,1,0.5 -o ph_$s.nii.gz -o ph_$s.npy --label ph_$s.nrrd --truth ph_$s.json --json
done
r ex_g exact --shape cochlea --size 60,50,50 --spacing 0.2 --json -o ex_g.npy --jacobian ex_g.j.npy
r ex_big exact --shape cochlea --size 160,160,120 --spacing 0.08 --json -o ex_big.npy
r ex_stat exact --shape statistical -O mean=$src/configs/statistical/mean.ply -O modes=$src/configs/statistical/modes.npy --size 40,40,40 --json -o ex_stat.npy --jacobian ex_stat.j.npy
# open, broken meshes
printf 'OFF\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n' >open.off
r ex_open exact --mesh open.off --size 25,25,25 --json -o ex_open.npy --certify
cat > two.py <<'END'
import sys
# two overlapping boxes, the second inside out
def box(o,s,flip):
    v=[(o[0]+s*(i&1),o[1]+s*(i>>1&1),o[2]+s*(i>>2&1)) for i in range(8)]
    f=[(0,2,1),(1,2,3),(4,5,6),(5,7,6),(0,1,4),(1,5,4),(2,6,3),(3,6,7),(0,4,2),(2,4,6),(1,3,5),(3,7,5)]
    return v,[(a,c,b) if flip else (a,b,c) for a,b,c in f]
A=box((0,0,0),2,False);B=box((1.1,.7,.9),2,False);C=box((6,0,0),1,True)
V=A[0]+B[0]+C[0];F=A[1]+[tuple(i+8 for i in f) for f in B[1]]+[tuple(i+16 for i in f) for f in C[1]]
print('OFF\n%d %d 0'%(len(V),len(F)))
for v in V: print(*v)
for f in F: print(3,*f)
END
python3 two.py >two.off
r ex_two exact --mesh two.off --size 64,40,40 --json -o ex_two.npy -o ex_two.ply --certify --closest ex_two.c.npy
r mesh_two info two.off --json
# fits
r phe phantom --shape ellipsoid -O edge=0.6 -p rx=3.5 -p ry=2.5 -p rz=2 --rotation 0.1,-0.2,0.3 --translation 20,-30,10 --spacing 0.4 -o ct.nii.gz --label label.nrrd --truth truth.json
near='--rotation 0,0,0 --start-centre 20.3,-30.2,9.9 --spacing 0.35'
fe="fit --shape ellipsoid -O edge=0.6 --eps 1e-4 --json"
r fit_exact $fe --exact ct.nii.gz $near --reference label.nrrd -o fit.stl -o fit.npy -o fit.nrrd --label-out fitted.nrrd
r fit_label $fe label.nrrd --label 1 $near -o fitl.npy
r fit_mesh $fe fit.stl $near -o fitm.npy
r fit_sphere $fe ct.nii.gz --start-centre 20.3,-30.2,9.9 --spacing 0.5 --turns-sphere 12
r fit_axis $fe ct.nii.gz --start-centre 20.3,-30.2,9.9 --start-axis 0,0,1 --turns 6 --spacing 0.5
r fit_cavity $fe ct.nii.gz $near --cavity 2 --tissue-places 2 --region 14,-36,4,26,-24,16
r fit_labelmodel $fe ct.nii.gz --image-model labels --inside 40,170 --outside 1300,270 $near
r fit_white $fe ct.nii.gz $near --tissue-places 0 --keep blur --keep appearance --prior-sd 0.5 --prior-rotation 0.1
r fit_model fit ell/model.sdm ct.nii.gz --rotation 0,0,0 --start-centre 20.3,-30.2,9.9 --policy clamp --json --polish --force -o fitpol.npy
r fit_net fit ell/model.sdm ct.nii.gz --rotation 0,0,0 --start-centre 20.3,-30.2,9.9 --json --force -o fitnet.npy
printf 'shape_x,shape_y,shape_z,x,y,z\n0,0,0,20,-30,10\n1,0,0,21,-30,10\n0,1,0,20,-29,10\n0,0,1,20,-30,11\n' >pts.csv
r fit_points $fe ct.nii.gz --start-points pts.csv --spacing 0.4
# experiments
cat >exp.yaml <<'END'
experiment: {title: fits, baseline: exact}
fit: {phantoms: 2, off_mm: 0.5, off_deg: 10, voxel: 0.5, range: 0.6, prior_sd: 0}
shape: {name: ellipsoid, options: {edge: 0.6}, ranges: {rx: [3.4, 4.2], ry: [2.4, 3], rz: [1.5, 2]}}
grid: {size: [26, 22, 18], spacing: 0.45}
network: {depth: 1, width: 16}
data: {static: 2, online: 32, start: 64, holdout: 4}
train: {steps: 20, batch: 16}
methods:
  - {name: network, network: pod, fit: network, set: {network: {rank: 8, modes: 16, degree: 2, input_degree: 2}, train.refine_batch: 8}}
  - {name: exact, fit: exact}
END
r exp experiment exp.yaml --out exprun --quiet --threads 1
r exp_dry experiment $src/configs/paper.yaml --dry-run --out never
for c in $src/configs/*.yaml; do r cfg_$(basename $c) config $c --dump; done
r cfg_keys config --keys
r shapes shapes --json
# the names and syntax of options, without their texts
"$p" help --markdown | grep -oE '^(## .*|sdmgen .*|\| `[^`]*`)' >options.out
"$p" help --completion >completion.out
find . -type f ! -name '*.vdb' ! -name '*.png' ! -name '*.svg' ! -name '*.err' ! -name metrics.jsonl ! -name '*.py' ! -name '*.yaml' ! -path './exprun/*' ! -name 'exp.out' | sort | xargs sha256sum | sed 's/ \.\// /'
sha256sum pod/config.yaml ell/config.yaml sdmnn/config.yaml exprun/*/model.sdm
cut -d, -f1,2,3,4 exprun/parameters.csv | sha256sum
for f in *.vdb; do echo "$(head -c -9 $f | sed -E 's/[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}//g' | sha256sum) $f"; done
grep -h '^exit' *.out | sort | uniq -c
