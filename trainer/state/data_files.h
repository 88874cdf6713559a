/* The data files of the shape. The folder of the run keeps a copy of each, beside the model, which
   names the copies: a model never leads to a file elsewhere, and folder and model can be moved. */
#pragma once

#include "trainer.h"

/* Length of the name of a copy, with its zero byte. */
#define TRAINER_DATA_FILE_MAX (2 * SDM_NAME_MAX + 16)

/* names[SDM_MAX_OPTIONS] = those of the copies, "shape.OPTION" and the ending of the file, for
   example "shape.mean.ply"; file[i] = names[i], NULL if option i is no file or names none. */
void trainer_data_file_names(const trainer *t, char (*names)[TRAINER_DATA_FILE_MAX],
                             const char **file);

/* Writes the copies of the files with a checksum in t->file_sums; one that is there already stays.
   One without a checksum is not copied, which is no error: an option of a plug-in may name a
   folder, for example. SDM_E_IO, SDM_E_NOMEM; SDM_E_FORMAT: a file does not have its checksum any
   more. */
sdm_status trainer_data_files_copy(const trainer *t, sdm_error *err);
