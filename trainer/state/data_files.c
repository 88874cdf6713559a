/* Copies of the data files of the shape in the folder of the run. */
#include "data_files.h"

#include <stdio.h>
#include <string.h>

#include "progress.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

/* Path of the data file of an option; NULL: the option is no file, or names none. */
static const char *file_of(const trainer *t, uint32_t option)
{
    const sdm_option_value *values = sdm_instance_options(t->shape);
    return sdm_instance_shape(t->shape)->options[option].type == SDM_OPTION_FILE &&
                   values[option].text[0]
               ? values[option].text
               : NULL;
}

static uint32_t option_count(const trainer *t)
{
    const uint32_t n = sdm_instance_shape(t->shape)->n_options;
    return n < SDM_MAX_OPTIONS ? n : SDM_MAX_OPTIONS;
}

static void name_copy(const trainer *t, uint32_t option, char name[TRAINER_DATA_FILE_MAX])
{
    const char *path = file_of(t, option), *slash = strrchr(path, '/');
    const char *ending = strchr(slash ? slash + 1 : path, '.');
    if (ending && strlen(ending) > 32) ending = strrchr(ending, '.');
    snprintf(name, TRAINER_DATA_FILE_MAX, "shape.%s%.32s",
             sdm_instance_shape(t->shape)->options[option].name, ending ? ending : "");
}

void trainer_data_file_names(const trainer *t, char (*names)[TRAINER_DATA_FILE_MAX],
                             const char **file)
{
    for (uint32_t i = 0; i < option_count(t); i++) {
        file[i] = NULL;
        if (!file_of(t, i)) continue;
        name_copy(t, i, names[i]);
        file[i] = names[i];
    }
}

static sdm_status copy_file(const char *from, const char *to, uint64_t wanted, sdm_error *err)
{
    uint64_t there;
    uint8_t *bytes = NULL;
    size_t size = 0;
    if (!sdm_file_checksum(to, &there, NULL) && there == wanted) return SDM_OK;
    sdm_status s = sdm_file_read(from, UINT64_MAX, &bytes, &size, err);
    if (!s && sdm_content_checksum(bytes, size) != wanted)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: changed since the training began: start again", from);
    if (!s) s = sdm_file_write(to, bytes, size, err);
    sdm_free(bytes);
    return s;
}

sdm_status trainer_data_files_copy(const trainer *t, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (uint32_t i = 0; i < option_count(t) && !s; i++) {
        char name[TRAINER_DATA_FILE_MAX], path[SDM_PATH_TEXT_MAX + TRAINER_DATA_FILE_MAX];
        if (!file_of(t, i)) continue;
        name_copy(t, i, name);
        snprintf(path, sizeof path, "%s/%s", t->folder, name);
        if (t->file_sums[i])
            s = copy_file(file_of(t, i), path, t->file_sums[i], err);
        else
            trainer_message(t,
                            "%s is no regular file: to compare the model with its exact shape, put "
                            "a copy of it at %s",
                            file_of(t, i), path);
    }
    return s;
}
