#!/usr/bin/env bash
# sdmgen train: a small network, which the tests of models share.
. "$(dirname "$0")/common.sh"
expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" --out run --quiet
present run/config.yaml run/metrics.jsonl run/model.sdm
finish
