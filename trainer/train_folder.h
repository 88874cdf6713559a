/* The folder of a run: one training at a time writes into it. */
#pragma once

#include "sdm/status.h"

/* Takes the folder for this run and removes temporary files that killed runs left there. *lock = a
   number for trainer_folder_leave(); -1: the file system has no locks. The lock is the file
   run.lock, which holds process and host; it ends with the process, however that ends. SDM_E_ARG:
   another training, of this process or another, has the folder; SDM_E_IO. */
sdm_status trainer_folder_take(const char *folder, int *lock, sdm_error *err);

/* Gives the folder back; does nothing if lock is -1. */
void trainer_folder_leave(const char *folder, int lock);
