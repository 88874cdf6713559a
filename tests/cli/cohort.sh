#!/usr/bin/env bash
# sdmgen fit --cases and sdmgen collect: the table does not depend on parts; what is missing or changed is done again; bad tables.
# Tests: cmd_collect.c cohort_check.c cohort_child.c cohort_list.c cohort_record.c cohort_run.c cohort_table.c cohort_words.c collect_outliers.c
# collect_page.c collect_table.c collect_write.c csv_cells.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive

shape='--shape ellipsoid -O edge=1.5'
fit="$shape --rotation 0,0,0 --spacing 1 --eps 1e-2"
mkdir data
for i in 1 2 3 4 5 6 7 8; do
    size="-p rx=3.$((10 + 5 * i)) -p ry=2.$((10 + i * 3 % 8 * 4)) -p rz=1.$((40 + i * 5 % 8 * 4))"
    [ $i != 8 ] || size='-p rx=4.5 -p ry=2.2 -p rz=1.5' # the outlier
    expect 0 - sdmgen phantom $shape $size --spacing 0.6 --seed $i -o data/c$i.nii --label data/l$i.nrrd -q
done
# Labels, with a quoted list, a flag, a comment and an empty line; an image that shows no such shape; a file that is not there.
{
    printf '\xef\xbb\xbfid,image,label,"keep",translation,ras\r\n'
    echo '# a comment'
    for i in 8 2 3 4 5 6 7; do echo "ear_0$i, l$i.nrrd ,1,,,"; done
    echo
    echo 'ear_01,l1.nrrd,"1;1",,"0,0,0",no'
    echo 'refused,l1.nrrd,1,pose,"1.5,0,0",'
    echo 'gone,none.nrrd,1,,,'
} >data/cohort.csv

# All at once: what each case leaves behind.
expect 6 'data/cohort.csv: 1 of 10 cases failed: one/failed.csv has the reasons' sdmgen fit $fit --cases data/cohort.csv -o one/ -o fit.ply -q
has '^10 cases: 8 accepted, 1 refused, 1 failed, 0 with other processes; 0 were done before$'
present one/ear_08/{fit.json,fit.ply,case.json,log.txt} one/refused/fit.json
absent one/refused/fit.ply one/gone/fit.json one/*/lease*
[ "$(cat one/failed.csv)" = 'id,exit_code,reason
gone,1,"data/none.nrrd: cannot open: No such file or directory"' ] || bad "failed.csv: $(cat one/failed.csv)"
grep -Eq 'verdict: (passed|doubtful)' one/ear_02/log.txt || bad "log: $(cat one/ear_02/log.txt)"
# the command of a case repeats its fit
expect 0 - eval "\"$program\" fit -q --output=again.json $(sed -n 's/.*"command": "sdmgen fit \([^"]*\)", "inputs".*/\1/p' one/ear_08/fit.json)"
[ "$(sed 's/.*"covariance": //; s/"seconds.*//' again.json)" = "$(sed 's/.*"covariance": //; s/"seconds.*//' one/ear_08/fit.json)" ] ||
    bad 'the command does not repeat the fit'

# The table: order of the rows, outliers, the figures of fit.json.
expect 6 '^sdmgen: error: one: of 10 cases 1 failed \(gone\)' sdmgen collect one -o one.csv -q
sdmgen collect one -o again.csv 2>err
grep -q 'refused (refused): their results' err || bad "no refused fit: $(cat err)"
grep -Eq '2 outliers, .*: ear_08 \(rx [0-9.]+\), refused \(rx ' err || bad "no outlier: $(cat err)"
cmp -s one.csv again.csv || bad 'two tables of the same results differ'
[ "$(cut -d, -f1-3 one.csv | tr '\n' ' ')" = "id,state,exit_code $(printf 'ear_0%s,accepted,0 ' 8 2 3 4 5 6 7 1)refused,refused,4 gone,failed,1 " ] ||
    bad "rows: $(cut -d, -f1-3 one.csv)"
[ "$(cut -d, -f4 one.csv | sed -n '1p;10,11p' | tr '\n' ' ')" = 'verdict failed  ' ] || bad "verdicts: $(cut -d, -f4 one.csv)"
# cell ROW NAME: a cell of the table
cell() { awk -F, -v row="$1" -v name="$2" 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) k = i } $1 == row { print $k }' one.csv; }
figure() { sed -n "s/.*\"$2\": {[^}]*\"$3\": \\([^,}]*\\).*/\\1/p" "one/$1/fit.json"; }
[ "$(cell ear_03 rx)" = "$(figure ear_03 parameters rx)" ] || bad "rx $(cell ear_03 rx)"
[ "$(cell ear_03 rz_sd)" = "$(figure ear_03 parameters_sd rz)" ] || bad "rz_sd $(cell ear_03 rz_sd)"
[ "$(cell ear_03 dice)" = "$(figure ear_03 overlap dice)" ] || bad "dice $(cell ear_03 dice)"
[ "$(cell ear_03 translation_y)" = "$(sed 's/.*"translation_mm": \[[^,]*, \([^,]*\),.*/\1/' one/ear_03/fit.json)" ] || bad translation_y
near "$(cell ear_08 rx)" 4.5 0.1
expect 6 'of 10 cases 1 failed' sdmgen collect one -q
cmp -s out one.csv || bad 'the table on stdout differs'
expect 6 'of 10 cases 1 failed' sdmgen collect one --json -q
[ "$(json n)" = 10 ] && has '"id": "gone", "state": "failed", "exit_code": 1' || bad 'JSON of the table'

# The page: outliers first, then failed, refused and other cases; links to the files of the cases where it lies beside them.
expect 6 'of 10 cases 1 failed' sdmgen collect one -o one/cohort.html -o page.html -q
rows=$(sed -n 's/^<tr class="[a-z ]*"><th>\([a-z0-9_]*\)<.*/\1/p' one/cohort.html | tr '\n' ' ')
case $rows in "ear_08 refused gone ear_0"*) [ "$(wc -w <<<"$rows")" = 10 ] ;; *) false ;; esac || bad "order of the page: $rows"
grep -q 'href="ear_03/fit.json"' one/cohort.html || bad 'the page has no links'
! grep -q href page.html || bad 'links that lead nowhere'

# In parts, in any order: the same table, bit by bit.
for n in 2 7; do
    for i in $(seq $n -1 1); do
        "$program" fit $fit --cases data/cohort.csv --part $i/$n -o parts$n -o fit.ply >out 2>err
        code=$?
        [ $code = $((i == n ? 6 : 0)) ] || bad "part $i of $n: exit code $code: $(cat err)"
        [ "$i/$n" != 2/7 ] || grep -q 'part 2 of 7: cases 2 to 2 of 10; the others are not done by this call' err || bad "part: $(cat err)"
        [ "$i/$n" != 7/7 ] || [ "$(sdmgen collect parts7 -q 2>&1 >out)" = 'sdmgen: error: parts7: of 10 cases 8 missing (ear_08, ear_02, ear_03, ear_04, ear_05, ear_06, ear_07, ear_01), 1 failed (gone): `sdmgen fit --cases` does them' ] ||
            bad 'missing cases are not told'
    done
    expect 6 '1 failed' sdmgen collect parts$n -o parts$n.csv -q
    cmp one.csv parts$n.csv || bad "the table of $n parts differs"
done
expect 0 'part 1 of 20: none of the 10 cases; the others do them' sdmgen fit $fit --cases data/cohort.csv --part 1/20 -o parts7 -o fit.ply
has '^0 cases: '

# redone PATTERN: runs the cohort again; the cases that are done must be those of the pattern (and "gone", which is tried each time).
redone() {
    sdmgen fit $fit --cases data/cohort.csv -o one -o fit.ply >out 2>err
    local done
    done=$(sed -n 's/^sdmgen: case [0-9]* of 10, \([a-z_0-9]*\): .*/\1/p' err | tr '\n' ' ')
    [ "$done" = "$1gone " ] || bad "done again: $done, not $1gone: $(cat err)"
    sdmgen collect one -o again.csv -q 2>err
}
redone ''
has '; 9 were done before'
printf '{' | dd of=one/ear_03/fit.json bs=1 seek=40 conv=notrunc 2>err # damage
rm one/ear_06/fit.ply
redone 'ear_03 ear_06 '
cmp one.csv again.csv || bad 'the mended table differs'
cp data/l3.nrrd data/l2.nrrd # a changed image
redone 'ear_02 '
[ "$(grep ear_02 again.csv | cut -d, -f6)" = "$(cell ear_03 rx)" ] || bad 'the changed image was not used'
sed -i 's/^ear_05, l5.nrrd ,1,,,/ear_05,l5.nrrd,1,,"0.1,0,0",/' data/cohort.csv # a changed option
redone 'ear_05 '
cp data/l4.nrrd data/none.nrrd # the missing file appears
expect 0 - sdmgen fit $fit --cases data/cohort.csv -o one -o fit.ply -q --json
[ "$(json accepted) $(json done_before) $(json failed)" = '9 9 0' ] || bad "summary $(cat out)"
absent one/failed.csv
expect 0 - sdmgen collect one -o again.csv -q

# A crash of one case is its failure; the run goes on.
printf 'id,image,label,turns-sphere\nslow,data/l1.nrrd,1,4000\nfast,data/l1.nrrd,1,1\n' >two.csv
"$program" fit $shape --spacing 1 --eps 1e-2 --cases two.csv -o crash -q >out 2>err &
pid=$!
await $pid [ -e crash/slow/log.txt ]
kill -KILL $(cat /proc/$pid/task/$pid/children) || { bad 'no child to kill'; kill -KILL $pid; }
wait $pid
[ $? = 6 ] || bad "a crash: $(cat err)"
grep -q '^slow,137,"the fit was ended by signal 9 (Killed)' crash/failed.csv || bad "crash: $(cat crash/failed.csv)"
present crash/fast/fit.json

# An interrupt abandons the case and gives its lease back; the next run does it.
printf 'id,image,label,turns-sphere\nslow,data/l1.nrrd,1,4000\n' >slow.csv
"$program" fit $shape --spacing 1 --eps 1e-2 --cases slow.csv -o stop -q >out 2>err &
pid=$!
await $pid [ -e stop/slow/log.txt ]
present stop/slow/lease-1
kill -TERM $pid
wait $pid
[ $? = 130 ] || bad "an interrupt: $(cat err)"
absent stop/slow/lease* stop/slow/case.json stop/slow/*.tmp

# Leases: of a process that works, of one that is dead, of a host that fell silent.
printf 'id,image,label\na,data/l1.nrrd,1\n' >a.csv
mkdir -p lease/a
echo 'host elsewhere/1 process 1 since 2020-01-01T00:00:00Z' >lease/a/lease-1
expect 6 'a.csv: another process works on 1 of 1 cases; --claim shares them' sdmgen fit $fit --cases a.csv -o lease -q
expect 0 'case 1 of 1, a: process 1 on elsewhere works on it' sdmgen fit $fit --cases a.csv -o lease --claim
has '1 with other processes'
touch -d '10 minutes ago' lease/a/lease-1
expect 0 - sdmgen fit $fit --cases a.csv -o lease --claim -q
has '1 accepted, 0 refused, 0 failed, 0 with'
absent lease/a/lease-1 lease/a/lease-2
rm -r lease/a && mkdir lease/a
sleep 0 & # a process that has ended
wait $!
echo "host $(hostname)/$(stat -L -c %i /proc/self/ns/pid) process $! since 2020-01-01T00:00:00Z" >lease/a/lease-1
expect 0 - sdmgen fit $fit --cases a.csv -o lease -q
has '1 accepted'

# Bad tables: the line, the allowed values; nothing is written.
refuse() { # PATTERN LINE...: the table of these lines is refused
    local pattern=$1
    shift
    printf '%s\n' "$@" >bad.csv
    expect 3 "^sdmgen: error: bad.csv$pattern" sdmgen fit $fit --cases bad.csv -o no
}
refuse ": no header line" '# nothing'
refuse ": no row after the header" id,image
refuse ":2: column 'lable': unknown; did you mean 'label'\?" '#' id,image,lable x,y,1
refuse ":1: column 'mesh': unknown; need id, image \(an image, labels, a mesh or points\)" id,image,mesh a,b,c
refuse ":1: column 'plugin': this option is not one of a single case" id,image,plugin a,b,c
refuse ":1: column 'label' appears twice" id,image,label,label a,b,1,1
refuse ":1: no column 'image'" id,label a,1
refuse ":1: no column 'id'" image,label a,1
refuse ":3: 2 cells, the header has 3" id,image,label a,b,1 c,d
refuse ":2: more cells than the 3 of the header: a cell with commas needs double quotes" id,image,start-axis a,b,0,0,1
refuse ":2: the cell number 2 begins with a double quote and must end" id,image 'a,"b'
refuse ":2: the cell number 2 begins with a double quote and must end" id,image 'a,"b"c'
refuse ":2: the id is empty" id,image ,b
refuse ":2: id '../x': it names a folder" id,image ../x,b
refuse ":2: id '.x': it names a folder" id,image .x,b
refuse ":2: id 'failed.csv': a file of the cohort has this name" id,image failed.csv,b
refuse ":4: id 'a' is that of line 2, too: each" id,image a,b b,b a,b
refuse ":3: id 'A' is that of line 2, too \(but for large letters\)|:2: id 'a' is" id,image a,b A,b
refuse ":2: id 'a': no image" id,image,label a,,1
refuse ":3: --turns 'x': need a whole number" id,image,turns a,b,1 b,b,x
refuse ":2: --start-axis '0,0': need three numbers" id,image,start-axis 'a,b,"0,0"'
refuse ":2: column 'ras': 'maybe': need yes or no" id,image,ras a,b,maybe
refuse ":2: a model and --shape ellipsoid: need one of them" id,image,model a,b,m.sdm
refuse ":2: output 'x/y.stl': with --cases an output is a file name without a folder" id,image,output a,b,x/y.stl
refuse ":2: output 'fit.json': every case has this file already" id,image,output a,b,fit.json
refuse ":2: output 'no/a/y.txt': its name must end in" id,image,output a,b,y.txt
printf 'id,image\na,b\n' >good.csv
expect 3 'good.csv:2: no model: need MODEL or --shape NAME on the command line, or a column' sdmgen fit --cases good.csv -o no
expect 1 'none.csv: cannot open' sdmgen fit $fit --cases none.csv -o no
expect 2 'cases needs a folder for the results: -o DIR' sdmgen fit $fit --cases good.csv
expect 2 'with --cases the first -o is the folder' sdmgen fit $fit --cases good.csv -o fit.stl
expect 2 "part '0/5': need I/N" sdmgen fit $fit --cases good.csv -o no --part 0/5
expect 2 "part '6/5': need I/N" sdmgen fit $fit --cases good.csv -o no --part 6/5
expect 2 "part '3': need I/N" sdmgen fit $fit --cases good.csv -o no --part 3
expect 2 'part belongs to --cases' sdmgen fit $fit data/l1.nrrd --part 1/2
expect 2 'claim belongs to --cases' sdmgen fit $fit data/l1.nrrd --claim
expect 2 "with --cases the images stand in the table: unexpected argument 'b'" sdmgen fit a b --cases good.csv -o no
expect 1 'data/cohort.json: not there: need the folder' sdmgen collect data
expect 2 "output 'x.txt': its name must end in .csv or .html" sdmgen collect one -o x.txt
echo '{"ids": ["../x"]}' >data/cohort.json
expect 3 "data/cohort.json: id '../x': it names a folder" sdmgen collect data
absent no no.csv
finish
