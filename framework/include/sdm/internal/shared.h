/* Visibility of functions that the libraries of sdmgen share with each other. They are exported but
 * not meant for users, and may change in every version. */
#pragma once

#include "sdm/export.h"

#define SDM_INTERNAL_API SDM_API
