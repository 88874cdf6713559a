/* Common set-up and tear-down for tests of training: a capsule to learn and a folder for the
 * run. Include cmocka.h first. */
#ifndef SDM_TEST_TRAIN_TOOLS_H
#define SDM_TEST_TRAIN_TOOLS_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sdm/builtin_shapes.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/file.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

static sdm_registry *registry;
static sdm_instance *capsule;
static char folder[] = "training_XXXXXX";

/* Path of a file in the run's folder, in a buffer that the next call reuses. */
static inline const char *in_folder(const char *name)
{
    static char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static inline bool exists(const char *name) { return access(in_folder(name), F_OK) == 0; }

/* Checksum of a file in the run's folder. */
static inline uint64_t hash_of(const char *name)
{
    uint8_t *data;
    size_t size;
    assert_int_equal(sdm_file_read(in_folder(name), 1 << 30, &data, &size, NULL), SDM_OK);
    // The files end with their own checksum, and appending a CRC makes the CRC of the whole
    // constant: leave out the last 8 bytes.
    assert_true(size > 8);
    const uint64_t h = sdm_crc64(0, data, size - 8);
    sdm_free(data);
    return h;
}

/* The configuration of a YAML text with n overrides "key=value". */
static inline sdm_config parse_config(const char *text, const char *const *overrides, size_t n)
{
    sdm_config c;
    sdm_error e = {0};
    if (sdm_config_parse("test.yaml", text, strlen(text), overrides, n, &c, &e))
        fail_msg("%s", e.text);
    return c;
}

/* Removes all files that a run writes. */
static inline void run_files_remove(void)
{
    static const char *const names[] = {"model.sdm",       "model-pod.sdm", "model-template.sdm",
                                        "checkpoint.sdmc", "metrics.jsonl", "config.yaml",
                                        "loss.png"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) remove(in_folder(names[i]));
}

static inline int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder) || sdm_registry_create(&registry, NULL) ||
        sdm_builtin_shapes_add(registry, NULL))
        return 1;
    return sdm_instance_create(sdm_registry_find(registry, "capsule", NULL), NULL, 0, NULL,
                               &capsule, NULL) != SDM_OK;
}

static inline int tear_down(void **state)
{
    (void)state;
    run_files_remove();
    sdm_instance_free(capsule);
    sdm_registry_free(registry);
    return rmdir(folder); // fails if a run left any other file
}

#endif
