/* Mean map and nested local bases of the `pod` network, by proper orthogonal decomposition in
   blocks of voxels. They are computed from the maps made before training by linear algebra, without
   an optimiser. */
#pragma once

#include "pod_state.h"

/* Sets mean, basis, matrix_at, arch.n_coefficients and the ranks in blocks; mean and basis are
   allocated. SDM_E_CANCELLED if the run is to stop. */
sdm_status trainer_bases_make(pod_state *pod, sdm_error *err);
