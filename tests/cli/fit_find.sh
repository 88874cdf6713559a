#!/usr/bin/env bash
# sdmgen fit --find: a shape far from the middle of the image is found without a start; an image of
# another shape is refused; options that contradict the search.
# Tests: fit_candidates.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive

expect 0 - sdmgen phantom --shape torus -O edge=0.5 --rotation 0.4,0.3,0 --spacing 0.5 --size 56,48,40 --origin=-19,-7,-13 -o torus.nii --quiet
find='sdmgen fit --shape torus -O edge=0.5 --spacing 0.5 --eps 1e-3 --quiet'
expect 0 - $find torus.nii --find --candidates 2 --json
has '"candidates": *\[\{"place_mm": *\[-?0[.0-9e-]*, *-?0[.0-9e-]*, *-?0[.0-9e-]*\], *"score": *0\.[6-9]'
has '"trusted": *true'

# Nothing like the shape.
expect 0 - sdmgen phantom --shape ellipsoid -O edge=0.5 --spacing 0.5 -o ellipsoid.nii --quiet
expect 4 'candidate' $find ellipsoid.nii --find --candidates 1 -o no.stl
[ -e no.stl ] && bad 'a file of a fit that is not accepted'

expect 2 '--find searches for the start: leave --rotation out' $find torus.nii --find --rotation 0,0,0
expect 2 '--candidates belongs to --find' $find torus.nii --candidates 2
printf '0,0,0\n1,0,0\n0,1,0\n' >points.csv
expect 2 '--find does nothing in a fit to points' $find points.csv --find
finish
