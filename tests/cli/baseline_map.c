/* The program of examples/wasm with the kernels that every machine of this kind has, for a
 * comparison with WebAssembly. */
#include "sdm/internal/processor.h"

// its main(), renamed by the build
int map_main(int argc, char **argv);

int main(int argc, char **argv)
{
    (void)sdm_processor_select(0);
    return map_main(argc, argv);
}
