/* Callbacks that show a training on the terminal and stop it after an interrupt. */
#pragma once

#include "progress_bar.h"
#include "sdm/internal/train.h"

/* *progress must live as long as the training; the caller starts and clears it. */
sdm_train_hooks cli_train_hooks(cli_progress *progress);
