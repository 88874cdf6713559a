/* The hooks of a training that is watched on the terminal and stopped by an interrupt. */
#ifndef CLI_TRAIN_PROGRESS_H
#define CLI_TRAIN_PROGRESS_H

#include "progress.h"
#include "sdm/internal/train.h"

/* *progress, which the caller starts and clears, lives as long as the training. */
sdm_train_hooks cli_train_hooks(cli_progress *progress);

#endif
