/* Keeps the model of the kind that network.kind: auto has trained and not chosen. */
#include "other_model.h"

#include <stdio.h>

#include "sdm/internal/container.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"
#include "state/export_model.h"
#include "state/progress.h"
#include "state/turns.h"

/* Writes the bytes of model.sdm under another name. */
static sdm_status copy_model(const trainer *t, const char *path, sdm_error *err)
{
    char model[SDM_PATH_TEXT_MAX];
    uint8_t *bytes = NULL;
    size_t size = 0;
    trainer_export_path(t, model);
    sdm_status s = sdm_file_read(model, UINT64_C(1) << 36, &bytes, &size, err);
    if (!s) s = sdm_container_write(path, bytes, size, err);
    sdm_free(bytes);
    return s;
}

void trainer_other_model_keep(const trainer *t, bool won, sdm_train_report *report)
{
    sdm_error why = {0};
    char path[SDM_PATH_TEXT_MAX];
    const sdm_network_kind kind = t->turns->kind[won ? 0 : 1];
    snprintf(path, sizeof path, "%.*s/%s", SDM_PATH_TEXT_MAX - 24, t->folder,
             trainer_turn_file(kind));
    if (won ? copy_model(t, path, &why) : trainer_export_to(t, path, &why))
        trainer_message(t, "auto: the model of kind %s is lost: %s", trainer_turn_name(kind),
                        why.text);
    else
        snprintf(report->other_path, sizeof report->other_path, "%s", path);
}
