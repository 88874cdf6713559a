#!/usr/bin/env bash
# The installed package: builds examples/consume against it, by CMake and by pkg-config, and runs it with a trained model; builds
# make_labyrinth. Third argument: the build folder to install from.
build=$3
. "$(dirname "$0")/common.sh"
model=../files-of-trained/run/model.sdm

cmake --install "$build" --prefix "$PWD/prefix" >log 2>&1 || bad "install: $(tail -n 3 log)"
present prefix/bin/sdmgen prefix/share/man/man1/sdmgen.1 prefix/share/bash-completion/completions/sdmgen \
    prefix/share/zsh/site-functions/_sdmgen prefix/share/fish/vendor_completions.d/sdmgen.fish prefix/share/doc/sdmgen/sdmgen.spdx
for command in $("$program" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p'); do
    present "prefix/share/man/man1/sdmgen-$command.1"
done
expect 0 - prefix/bin/sdmgen shapes
expect 0 - prefix/bin/sdmgen info $model

cmake -S "$source_folder/examples/consume" -B by-cmake -DCMAKE_PREFIX_PATH="$PWD/prefix" >log 2>&1 || bad "configure: $(tail -n 5 log)"
cmake --build by-cmake >log 2>&1 || bad "build: $(tail -n 5 log)"
expect 0 - by-cmake/consume $model
has '^cochlea: -?[0-9.]+ mm in the middle voxel'
expect 1 '^consume: .*missing\.sdm' by-cmake/consume missing.sdm
# a fit to points from the start that the example chooses finds the values of the command line's fit
expect 0 - sdmgen phantom --shape cochlea -p a=4.2 -p b=0.13 -p alpha=0.6 -p phi=0.2 --spacing 0.5 --surface points.csv -o image.nii.gz -q
by-cmake/fit_points $model points.csv >fitted 2>err
status=$?
{ [ $status = 0 ] || [ $status = 4 ]; } || bad "fit_points ends with $status: $(cat err)"
near "$(sed -n 's/^a = \([^ ]*\) +- .* mm$/\1/p' fitted)" 4.2 0.3
grep -qE '^verdict: (passed|doubtful|FAILED)$' fitted || bad "no verdict: $(cat fitted)"
grep -qE '^rotation( [-0-9.e]+){3} \+-( [-0-9.e]+|nan){3} rad$' fitted || bad "no deviations of the pose: $(cat fitted)"
grep -qE '^translation( [-0-9.e]+){3} \+-( [-0-9.e]+|nan){3} mm$' fitted || bad "no deviations of the pose: $(cat fitted)"
# points of a part: what they do not determine is told
(head -n 1 points.csv; tail -n +2 points.csv | sort -t, -g -k3 | head -n 30) >part.csv
by-cmake/fit_points $model part.csv >fitted 2>err
grep -qE '^[a-z]+ = .*, (not determined|at an end of its range: \+- does not hold)' fitted || bad "a part determines all: $(cat fitted)"
expect 1 '^fit_points: missing\.csv: no such file' by-cmake/fit_points $model missing.csv
# a fit to labels without a network, on a grid that the example chooses
expect 0 - sdmgen phantom --shape torus -p major=2.1 -p minor=1.3 --spacing 0.4 -o torus.nii.gz --label label.nii.gz -q
expect 0 - by-cmake/fit_labels torus label.nii.gz 1
near "$(sed -n 's/^major = \([^ ]*\) +- .* mm$/\1/p' out)" 2.1 0.06
near "$(sed -n 's/^minor = \([^ ]*\) +- .* mm$/\1/p' out)" 1.3 0.06
has '^verdict: passed$'
expect 4 '^fit_labels: .* of the volume of the shape is empty' by-cmake/fit_labels capsule label.nii.gz 1
has '^verdict: FAILED$'
expect 1 '^fit_labels: no voxel has the label 7$' by-cmake/fit_labels torus label.nii.gz 7

# a training, with a key of the command line in place of that of the file
expect 0 'evaluate +100 %' by-cmake/train "$source_folder/tests/cli/tiny.yaml" trained train.steps=20
has '^trained/model\.sdm: (good|usable|poor), RMSE [0-9.]+ mm, [0-9]+ s$'
grep -q '^{"phase": "evaluate", "step": 20,' trained/metrics.jsonl || bad 'the training does not end after the steps of its command'
expect 0 - prefix/bin/sdmgen info trained/model.sdm
expect 1 'train: .*stepz' by-cmake/train "$source_folder/tests/cli/tiny.yaml" trained train.stepz=20

pc=$(dirname "$(find prefix -name sdmgen.pc)")
# shellcheck disable=SC2046 # flags are words
PKG_CONFIG_PATH=$pc cc -std=c11 -Wall -Wextra -Werror -o by-pkg-config "$source_folder/examples/consume/consume.c" \
    $(PKG_CONFIG_PATH=$pc pkg-config --cflags --libs sdmgen) "-Wl,-rpath,$(PKG_CONFIG_PATH=$pc pkg-config --variable=libdir sdmgen)" 2>log || bad "pkg-config: $(cat log)"
expect 0 - ./by-pkg-config $model

# The C program of README.md.
sed -n '/^```c$/,/^```$/{/^```/!p}' "$source_folder/README.md" >readme.c
# shellcheck disable=SC2046 # flags are words
PKG_CONFIG_PATH=$pc cc -std=c11 -Wall -Wextra -Werror -o readme readme.c \
    $(PKG_CONFIG_PATH=$pc pkg-config --cflags --libs sdmgen) "-Wl,-rpath,$(PKG_CONFIG_PATH=$pc pkg-config --variable=libdir sdmgen)" 2>log || bad "the program of README.md: $(cat log)"
mkdir -p runs/cochlea && cp "$model" runs/cochlea/model.sdm
./readme >out 2>err || bad "the program of README.md: $(cat err)" # it may warn of distances far from the surface
has '^-?[0-9.]+ mm$'

# The command that examples/statistical/README.md shows.
cp "$source_folder/examples/statistical/make_labyrinth.c" .
line=$(grep '^cc .*make_labyrinth' "$source_folder/examples/statistical/README.md")
(export PKG_CONFIG_PATH=$pc && eval "$line") >log 2>&1 || bad "make_labyrinth: $(cat log)"
present make_labyrinth
finish
