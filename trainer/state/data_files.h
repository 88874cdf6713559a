/* The data files of the shape. The folder of the run keeps a copy of each, beside the model, which
   names the copies: a model never leads to a file elsewhere, and folder and model can be moved. */
#pragma once

#include "trainer.h"

/* Length of a name by trainer_data_file_name(), with its zero byte. */
#define TRAINER_DATA_FILE_MAX (2 * SDM_NAME_MAX + 16)

/* t->file_sums = checksums of the data files. One that cannot be read has the checksum 0 and is not
   copied, which is no error: an option of a plug-in may name a folder, for example. */
void trainer_data_files_sum(trainer *t);

/* name = that of the copy of option number `option`, which is the path of a file: "shape.OPTION"
   and the ending of the file, for example "shape.mean.ply". */
void trainer_data_file_name(const trainer *t, uint32_t option, char name[TRAINER_DATA_FILE_MAX]);

/* Writes the copies; one that is there already stays. SDM_E_IO, SDM_E_NOMEM; SDM_E_FORMAT: a file
   has changed since trainer_data_files_sum(). */
sdm_status trainer_data_files_copy(const trainer *t, sdm_error *err);
