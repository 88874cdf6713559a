#!/usr/bin/env bash
# The command line itself: help, unknown words, bad values, texts generated from the table of options.
# Tests: cmd_help.c command_line.c help.c help_completion.c help_man.c main.c option_table.c terminal.c
. "$(dirname "$0")/common.sh"

expect 0 - sdmgen --version
has '^sdmgen [0-9]+\.[0-9]+\.[0-9]+$'
expect 0 - sdmgen --help
for command in train generate exact mesh eval report shapes info verify config bench experiment phantom export fit collect help; do
    has "^  $command "
done
for command in train generate exact mesh eval report shapes info verify config bench experiment phantom export fit collect help; do
    expect 0 - sdmgen $command --help
    has "^usage: sdmgen $command"
    expect 0 - sdmgen help $command
    has "^usage: sdmgen $command"
    expect 2 "^sdmgen: error: $command: unknown option --nonsense; see sdmgen $command --help" sdmgen $command --nonsense
done

# Mistakes: exit code 2 and a suggestion.
expect 2 '^sdmgen: error: a command is needed' sdmgen
expect 2 "unknown command 'trian'; did you mean 'train'\?" sdmgen trian
expect 2 "unknown command 'xyzzy'; see sdmgen --help" sdmgen xyzzy
expect 2 "unknown command 'evla'; did you mean 'eval'\?" sdmgen help evla
expect 2 'unknown option --sampels; did you mean --samples\?' sdmgen eval model.sdm --sampels 3
expect 2 'unknown option -x' sdmgen exact -x
expect 2 'exact: unknown option --rotation; it belongs to the commands phantom, fit \(sdmgen exact --help lists those of exact\)$' sdmgen exact --shape torus --rotation 0,0,1 --json
expect 2 'fit: unknown option --certify; it belongs to the command exact ' sdmgen fit model.sdm x.nii --certify
# A blank in place of the equals sign, a parameter given as an option, and the other way round.
expect 2 "^sdmgen: error: -p 'minor': need name=value, without blanks: -p minor=1\.2$" sdmgen exact --shape torus -p minor 1.2 --json
expect 2 "^sdmgen: error: -p 'minor': need name=value, without blanks: -p minor=-1$" sdmgen exact --shape torus -p minor = -1 --json
expect 2 "^sdmgen: error: -p 'minor=': need name=value, without blanks: -p minor=2$" sdmgen exact --shape torus -p minor= 2 --json
expect 2 "^sdmgen: error: -O 'edge': need name=value, without blanks: -O edge=fine$" sdmgen exact --shape torus -O edge fine --json
expect 2 "^sdmgen: error: -p 'minor': need name=value$" sdmgen mesh --shape torus -o x.off -p minor
expect 2 "^sdmgen: error: -O 'edge': need name=value$" sdmgen exact --shape torus -O edge --json
expect 2 "^sdmgen: error: shape 'torus': minor is a parameter, no option: -p minor=1$" sdmgen exact --shape torus -O minor=1 --json
expect 2 "^sdmgen: error: shape 'torus': edge is an option, no parameter: -O edge=0\.2$" sdmgen exact --shape torus -p edge=0.2 --json
expect 5 "'phi' = 15 rad, allowed .* rad; was it given in degrees\? It needs rad: phi=0\.2618$" sdmgen exact --shape cochlea -p phi=15 --json
expect 2 'measure=volume: --measure takes no value, it prints all measures$' sdmgen exact --shape torus --measure=volume
expect 2 "random-pose '3\.5': need two numbers DEG,MM \(degrees and mm\), at least 0" sdmgen phantom --shape torus --random-pose 3.5 -o x.nii
expect 2 'experiment: unknown option -o; did you mean --out DIR\?' sdmgen experiment x.yaml -o folder
expect 2 'usage: sdmgen train CONFIG' sdmgen train
expect 2 "unexpected argument 'b'" sdmgen info a b
expect 2 'samples needs a value' sdmgen eval model.sdm --samples
expect 2 "samples '0': need a whole number in 1 \.\." sdmgen eval model.sdm --samples 0
expect 2 "samples '1.5': need a whole number" sdmgen eval model.sdm --samples=1.5
expect 2 "size '1,2': need three whole numbers" sdmgen exact --shape torus --size 1,2
expect 2 "size '1,2,x'" sdmgen exact --shape torus --size 1,2,x
expect 2 "spacing 'nan': need one number or three" sdmgen exact --shape torus --spacing nan
expect 2 "spacing '0'" sdmgen exact --shape torus --spacing 0
expect 2 "origin '1,2': need three numbers" sdmgen exact --shape torus --origin 1,2
expect 2 "sign 'guess': need one of auto\|crossings" sdmgen exact --shape torus --sign guess
expect 2 "sign 'auto\|crossings': need one of auto\|crossings" sdmgen exact --shape torus --sign 'auto|crossings'
expect 2 'quiet=1: --quiet takes no value' sdmgen shapes --quiet=1
expect 2 'threads: empty value' sdmgen shapes --threads=
expect 2 "exact: --spacing is given twice, with '1' and with '2': give it once" sdmgen exact --shape torus --spacing 1 --spacing 2 --json
expect 2 "option 'edge' is '0,5', need a number; a decimal number has a point: 0.5" sdmgen exact --shape torus -O edge=0,5 --json
expect 2 "parameter minor: '1,2' is not a number; a decimal number has a point: 1.2" sdmgen exact --shape torus -p minor=1,2 --json
expect 2 "grid.spacing: needs a finite number, got '0,9'; a decimal number has a point: 0.9" sdmgen config "$source_folder/tests/cli/tiny.yaml" grid.spacing=0,9

# Options that would do nothing.
expect 2 'keep-overlap does nothing with --method naive' sdmgen exact --shape torus --method naive --keep-overlap --json
expect 2 'exact: --plugin does nothing for a mesh file, which needs no shape' sdmgen exact --mesh x.ply --plugin x.so --json
expect 2 'mesh: --isolate does nothing for a mesh file, which needs no shape' sdmgen mesh --mesh x.ply --isolate --json
expect 2 'verify: --plugin does nothing for x.nii, which needs no shape' sdmgen verify x.nii --plugin x.so
expect 2 'export: --plugin does nothing for a MODEL, which needs no shape' sdmgen export model.sdm -o x.onnx --plugin x.so

# An error while writing to standard output gives exit code 1.
expect 1 'cannot write to standard output' bash -c '"$0" shapes >/dev/full' "$program"

# Progress and messages for programs: each line on stderr is a JSON object; 3D Slicer's elements are on stdout.
slow=(exact --shape torus --size 36,36,12 --spacing 0.6 --method naive --threads 1 --json)
sdmgen "${slow[@]}" --progress json >out 2>err || bad "exact --progress json: $(cat err)"
[ "$(tail -n 1 err)" = '{"progress": 1, "title": "done", "text": ""}' ] || bad "last line of the progress: $(tail -n 1 err)"
! grep -Evq '^\{"progress": [0-9.e-]+, "title": "[a-z]+", "text": "[^"]*"\}$' err || bad "other lines in: $(cat err)"
expect 2 '^\{"error": "exact: an output is needed.*"\}$' sdmgen exact --shape torus --progress json
expect 2 '^\{"error": "exact: unknown option --shap; did you mean --shape\?"\}$' sdmgen exact --progress json --shap
expect 0 - sdmgen "${slow[@]}" --progress slicer
has '^<filter-progress>0\.[0-9]+</filter-progress>$'
has '^<filter-progress>1\.000</filter-progress>$'
expect 0 - sdmgen "${slow[@]}" --progress slicer --quiet
! grep -q filter out || bad 'progress with --quiet'

# With closed stdout or stderr, files hold what belongs into them and nothing else.
expect 0 - sdmgen mesh --shape torus -O edge=1 -o open.ply
sdmgen mesh --shape torus -O edge=1 -o closed.ply >&- 2>&-
cmp -s open.ply closed.ply || bad 'stdout and stderr closed: another file'
sdmgen config "$source_folder/tests/cli/tiny.yaml" --dump >&- 2>&- && bad 'a result that cannot be printed counts as success'

# A file that is replaced keeps its permissions.
chmod 600 open.ply
expect 0 - sdmgen mesh --shape torus -O edge=1 -o open.ply
[ "$(stat -c %a open.ply)" = 600 ] || bad "permissions became $(stat -c %a open.ply)"

# Texts generated from the table of options.
expect 0 - sdmgen help --completion bash
cp out completion.bash
expect 0 - bash -n completion.bash
expect 0 - bash -c '. ./completion.bash; COMP_WORDS=(sdmgen eval --sam); COMP_CWORD=2; _sdmgen; echo "${COMPREPLY[@]}"'
has '^--samples$'
expect 0 - bash -c '. ./completion.bash; COMP_WORDS=(sdmgen exact --sign w); COMP_CWORD=3; _sdmgen; echo "${COMPREPLY[@]}"'
has '^winding$'
expect 0 - sdmgen help --completion fish
cp out sdmgen.fish
expect 0 - sdmgen help --completion zsh
cp out _sdmgen
has '^#compdef sdmgen$'
expect 2 "completion 'csh': need one of bash\|zsh\|fish" sdmgen help --completion csh
# in the shells themselves, where they are installed
if command -v fish >/dev/null; then
    expect 0 - env HOME="$PWD" fish --no-config -c 'source sdmgen.fish; complete -C "sdmgen exact --sign w"; complete -C "sdmgen exper"'
    has '^winding'
    has '^experiment'
fi
if command -v zsh >/dev/null; then expect 0 - zsh -n _sdmgen; fi
expect 0 - sdmgen help exact --man
has '^\.TH SDMGEN\\-EXACT 1'
has '^\.B "\\-\\-keep\\-overlap"$'
expect 0 - sdmgen help --man
has '^\.TH SDMGEN 1'
has '^\.BR sdmgen\\-exact \(1\)$'

# The reference in the documentation equals the generated text.
expect 0 - sdmgen help --markdown
cp out reference.md
sed -n '/^<!-- begin: sdmgen help --markdown -->$/,/^<!-- end -->$/p' "$source_folder/docs/command-line.md" | sed '1d;$d' >documented.md
cmp -s reference.md documented.md ||
    bad "docs/command-line.md is not up to date; put in the text of: sdmgen help --markdown"

finish
