/* The groups of features for AVX2; the same bits. */
#define KERNEL sdm_feature_groups_avx2
#include "feature_groups.inc"
