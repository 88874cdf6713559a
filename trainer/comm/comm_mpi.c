/* Finds out whether mpirun has started this process, and loads the back-end for its MPI: a shared
   object, so that the program itself needs no MPI. */
#define _DEFAULT_SOURCE // readlink()
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "comm_types.h"
#include "sdm/internal/picture_child.h"
#include "sdm/internal/processor.h"
#include "sdm/memory.h"

/* An MPI: the variable in which its mpirun tells the number of processes, the file of the back-end,
 * the CMake option that builds it, and the package that this needs. */
typedef struct mpi {
    const char *name, *variable, *file, *option, *package;
} mpi;

static const mpi KNOWN[] = {
    {"Open MPI", "OMPI_COMM_WORLD_SIZE", "sdmgen_openmpi.so", "SDM_OPENMPI", "libopenmpi-dev"},
    {"MPICH", "PMI_SIZE", "sdmgen_mpich.so", "SDM_MPICH", "libmpich-dev"}};

/* The MPI whose mpirun has started several processes; NULL: none. */
static const mpi *find_mpi(int *size)
{
    for (size_t i = 0; i < sizeof KNOWN / sizeof *KNOWN; i++) {
        const char *text = getenv(KNOWN[i].variable);
        *size = text ? atoi(text) : 0;
        if (*size > 1) return &KNOWN[i];
    }
    return NULL;
}

/* path = the file of the back-end: beside the program, or where it is installed. */
static void find_file(const mpi *m, char *path, size_t size)
{
    static const char *const FOLDERS[] = {"", SDM_MPI_FOLDER "/"};
    char program[2048] = "";
    const ssize_t n = readlink("/proc/self/exe", program, sizeof program - 1);
    program[n > 0 ? n : 0] = '\0';
    char *end = strrchr(program, '/');
    if (end) end[1] = '\0';
    for (size_t i = 0; i < sizeof FOLDERS / sizeof *FOLDERS; i++) {
        snprintf(path, size, "%s%s%s", program, FOLDERS[i], m->file);
        if (!access(path, F_OK)) return;
    }
}

/* Lets all ranks use the instruction set that each of them has: sums of floats differ between
 * instruction sets. */
static sdm_status level_processors(sdm_comm *c, sdm_error *err)
{
    size_t level = (size_t)sdm_processor_level();
    const sdm_status s = sdm_comm_least(c, &level, err);
    sdm_processor_select((int)level);
    return s;
}

sdm_status sdm_comm_mpi(sdm_comm **out, sdm_error *err)
{
    char path[4096];
    int started;
    *out = NULL;
    const mpi *m = find_mpi(&started);
    if (!m) return SDM_OK;
    find_file(m, path, sizeof path);
    // its own plug-ins need the symbols of Open MPI
    void *object = dlopen(path, RTLD_NOW | RTLD_GLOBAL);
    // dlsym() returns a pointer to data, which ISO C does not convert to one to a function
    union {
        void *address;
        comm_module_entry *call;
    } entry = {object ? dlsym(object, COMM_MODULE_SYMBOL) : NULL};
    if (!entry.address)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s started %d processes, but its back-end cannot be loaded (%s): install "
                        "%s and build with -D%s=ON, or train on one machine with --ranks %d",
                        m->name, started, dlerror(), m->package, m->option, started);
    const sdm_status s = SDM_ALLOC(out, 1, "ranks", err);
    if (s) return s;
    // the drivers of some networks do not survive a fork
    sdm_picture_in_child(false);
    (*out)->backend = entry.call(&(*out)->state, &(*out)->rank, &(*out)->size);
    return level_processors(*out, err);
}
