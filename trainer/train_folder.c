/* Whether a folder is free for a run. */
#include <stdio.h>
#include <unistd.h>

#include "sdm/internal/train.h"

sdm_status sdm_train_check_folder(const char *folder, bool resume, bool force, sdm_error *err)
{
    static const struct {
        const char *name, *content;
    } files[] = {{"model.sdm", "a trained model"},
                 {"checkpoint.sdmc", "the checkpoint of a training"}};
    if (resume && force)
        return sdm_fail(err, SDM_E_ARG, "train: --resume and --force exclude each other");
    bool there[2];
    for (size_t i = 0; i < 2; i++) {
        char path[SDM_PATH_TEXT_MAX + 32];
        snprintf(path, sizeof path, "%s/%s", folder, files[i].name);
        there[i] = !access(path, F_OK);
    }
    if (force || (!there[0] && !there[1])) return SDM_OK;
    if (!there[1])
        return sdm_fail(err, SDM_E_ARG,
                        "%s holds %s and no checkpoint to continue from: start again with --force, "
                        "or choose --out DIR",
                        folder, files[0].content);
    if (resume) return SDM_OK;
    return sdm_fail(
        err, SDM_E_ARG,
        "%s holds %s: continue with --resume, start again with --force, or choose --out DIR",
        folder, files[there[0] ? 0 : 1].content);
}
