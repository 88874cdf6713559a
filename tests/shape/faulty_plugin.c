/* The faulty shape as a plug-in, for the tests of the command line. */
#include "faulty_shape.h"

const sdm_shape *sdm_plugin_shape(uint32_t index) { return index == 0 ? &FAULTY : NULL; }
