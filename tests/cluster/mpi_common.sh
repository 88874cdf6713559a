# shellcheck shell=bash
# Shared by the tests with MPI (sourced after common.sh): the MPIs whose back-end is built, and a training by any of them.
export OMP_WAIT_POLICY=passive OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
coarse_grids=yes
mpis=()
for mpi in openmpi mpich; do
    [ -e "$(dirname "$program")/sdmgen_$mpi.so" ] && command -v mpirun.$mpi >/dev/null && mpis+=($mpi)
done
[ ${#mpis[@]} -gt 0 ] || { echo 'skipped: no back-end of MPI (Debian: libopenmpi-dev, libmpich-dev; -DSDM_OPENMPI=ON, -DSDM_MPICH=ON)'; exit 77; }

# started HOW RANKS ARGUMENT...: a training by fork, openmpi or mpich
started() {
    local how=$1 n=$2
    shift 2
    case $how in
    fork) sdmgen train "$@" --ranks "$n" -q ;;
    openmpi) mpirun.openmpi --oversubscribe -n "$n" "$program" train "$@" -q ;;
    mpich) mpirun.mpich -n "$n" "$program" train "$@" -q ;;
    esac
}

# ranks_of FOLDER: the processes of the training with --out FOLDER
ranks_of() { pgrep -f "^$program train .* --out $1 "; }
