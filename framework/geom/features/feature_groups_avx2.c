/* Groups of features, compiled for AVX2; same bits as the generic version. */
#define KERNEL sdm_feature_groups_avx2
#include "feature_groups.inc"
