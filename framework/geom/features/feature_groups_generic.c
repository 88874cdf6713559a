/* The groups of features for any processor. */
#define KERNEL sdm_feature_groups_generic
#include "feature_groups.inc"
