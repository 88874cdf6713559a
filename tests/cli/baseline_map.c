/* The program of examples/wasm, restricted to the kernels that every processor of this
 * architecture supports, for comparison with WebAssembly. */
#include "sdm/internal/processor.h"

// main() of examples/wasm/map.c, renamed by the build.
int map_main(int argc, char **argv);

int main(int argc, char **argv)
{
    (void)sdm_processor_select(0);
    return map_main(argc, argv);
}
