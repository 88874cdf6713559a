/* Visibility of functions that the libraries of sdmgen share among themselves: exported, but not
   for users. They may change with any version. */
#ifndef SDM_INTERNAL_SHARED_H
#define SDM_INTERNAL_SHARED_H

#include "sdm/export.h"

#define SDM_INTERNAL_API SDM_API

#endif
