/* Groups of features, compiled for any processor. */
#define KERNEL sdm_feature_groups_generic
#include "feature_groups.inc"
