/* A training of capsules in a second, for tests of its verdict (included). Include cmocka.h first.
 */
#pragma once

#include "train_tools.h"

static const char base[] =
    "shape: {name: capsule}\n"
    "grid: {size: [28, 24, 22], spacing: 0.5}\n"
    "network: {kind: pod, depth: 2, width: 32, rank: 8, modes: 64, degree: 2, input_degree: 3}\n"
    "data: {static: 0, start: 200, online: 0, holdout: 16, memory_gb: 0.5}\n"
    "train: {steps: 1000, batch: 64, refine: 0, learning_rate: 0.01, average: 0.99}\n";

static sdm_config config_of(const char *const *overrides, size_t n)
{
    return parse_config(base, overrides, n);
}

static sdm_train_report train(const char *const *overrides, size_t n)
{
    const sdm_config c = config_of(overrides, n);
    sdm_train_report r;
    sdm_error e = {0};
    run_files_remove();
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    return r;
}
