/* Fuzz target of checkpoints, with right checksums: a training goes on from the checkpoint for a
 * few steps, or refuses it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fuzz_reader.h"
#include "sdm/builtin_shapes.h"
#include "sdm/internal/train.h"

/* the configuration of the checkpoints of the corpus */
static const char text[] =
    "shape: {name: capsule}\n"
    "grid: {size: [8, 8, 8], spacing: 2}\n"
    "network: {kind: pod, depth: 1, width: 8, rank: 2, levels: 1, block: 4, modes: 8, degree: 1,\n"
    "  input_degree: 1}\n"
    "data: {static: 0, start: 8, online: 4, holdout: 2, sampling: error, workers: 1}\n"
    "train: {steps: 2000, batch: 2, refine_batch: 2, checkpoint_seconds: 1000}\n"
    "threads: 1\n";

static sdm_config config;
static sdm_registry *registry;
static sdm_instance *shape;
static int calls;

static bool stop_soon(void *user)
{
    (void)user;
    return ++calls > 20;
}

static void set_up(void)
{
    sdm_error err = {0};
    fuzz_require(!sdm_registry_create(&registry, NULL) && !sdm_builtin_shapes_add(registry, NULL));
    fuzz_require(!sdm_config_parse("fuzz.yaml", text, strlen(text), NULL, 0, &config, &err));
    fuzz_require(!sdm_instance_create(sdm_registry_find(registry, "capsule", NULL), NULL, 0, NULL,
                                      &shape, &err));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const made[] = {"model.sdm", "metrics.jsonl", "config.yaml", "loss.png"};
    const sdm_train_hooks hooks = {.cancelled = stop_soon};
    sdm_error err = {0};
    if (!shape) set_up();
    uint8_t *bytes = fuzz_copy(data, size);
    fuzz_repair_container(bytes, size);
    fuzz_file("checkpoint.sdmc", bytes, size);
    free(bytes);
    calls = 0;
    fuzz_check_status(sdm_train(&config, shape, fuzz_folder(), true, &hooks, NULL, &err), &err);
    for (size_t i = 0; i < sizeof made / sizeof *made; i++) {
        char path[512];
        snprintf(path, sizeof path, "%s/%s", fuzz_folder(), made[i]);
        unlink(path);
    }
    return 0;
}
