# Required packages. If an optional one is missing, the message says how to install it or how to
# build without it.
set(SDM_LIBM m)
if(NOT CMAKE_SYSTEM_NAME STREQUAL Generic) # WebAssembly has no threads
  find_package(Threads)
endif()
if(SDM_CONFIG AND NOT Threads_FOUND)
  message(FATAL_ERROR "POSIX threads not found: the trainer needs them; configure with "
    "-DSDM_CONFIG=OFF (runtime only)")
endif()
if(Threads_FOUND)
  set(SDM_THREADS Threads::Threads)
endif()

if(SDM_OPENMP)
  find_package(OpenMP COMPONENTS C)
  if(NOT OpenMP_C_FOUND)
    message(FATAL_ERROR "OpenMP not found: install libgomp (gcc) or libomp-dev (clang), or "
      "configure with -DSDM_OPENMP=OFF")
  endif()
endif()

if(SDM_DNNL)
  # version 3 has an incompatible C interface
  find_package(dnnl 2.6 CONFIG QUIET)
  if(NOT dnnl_FOUND)
    message(FATAL_ERROR "oneDNN 2.x not found: install libdnnl-dev, or configure with "
      "-DSDM_DNNL=OFF (own convolutions only)")
  endif()
endif()

find_package(PkgConfig)
if(SDM_CONFIG AND NOT SDM_IMAGE)
  message(FATAL_ERROR "the trainer and the command line need images: configure with "
    "-DSDM_IMAGE=ON or -DSDM_CONFIG=OFF")
endif()
if(SDM_IMAGE)
  find_package(ZLIB)
  if(NOT ZLIB_FOUND)
    message(FATAL_ERROR "zlib not found: install zlib1g-dev, or configure with -DSDM_IMAGE=OFF "
      "-DSDM_CONFIG=OFF (runtime only)")
  endif()
endif()

if(SDM_PICTURE)
  if(PKG_CONFIG_FOUND)
    pkg_check_modules(CAIRO IMPORTED_TARGET cairo>=1.16)
  endif()
  if(NOT CAIRO_FOUND)
    message(FATAL_ERROR "cairo 1.16 not found: install libcairo2-dev and pkg-config, or configure with -DSDM_PICTURE=OFF (no pictures)")
  endif()
endif()

if(SDM_CONFIG)
  if(PKG_CONFIG_FOUND)
    pkg_check_modules(YAML IMPORTED_TARGET yaml-0.1)
  endif()
  if(NOT YAML_FOUND)
    message(FATAL_ERROR "libyaml not found: install libyaml-dev and pkg-config, or configure with "
      "-DSDM_CONFIG=OFF (runtime only)")
  endif()
endif()

set(OPENMPI_NAME "Open MPI")
set(OPENMPI_MODULE ompi-c)
set(MPICH_NAME "MPICH")
set(MPICH_MODULE mpich)
foreach(mpi OPENMPI MPICH)
  if(SDM_CONFIG AND SDM_${mpi})
    if(PKG_CONFIG_FOUND)
      pkg_check_modules(${mpi} IMPORTED_TARGET ${${mpi}_MODULE})
    endif()
    if(NOT ${mpi}_FOUND)
      string(TOLOWER lib${mpi}-dev package)
      message(FATAL_ERROR "${${mpi}_NAME} not found: install ${package}, or configure with -DSDM_${mpi}=OFF")
    endif()
  endif()
endforeach()

if(SDM_CONFIG AND SDM_HDF5)
  if(PKG_CONFIG_FOUND)
    pkg_search_module(HDF5 IMPORTED_TARGET hdf5-serial hdf5)
  endif()
  if(NOT HDF5_FOUND)
    message(FATAL_ERROR "HDF5 not found: install libhdf5-dev and pkg-config, or configure with "
      "-DSDM_HDF5=OFF (shape models from .h5.json files and meshes only)")
  endif()
endif()

if(SDM_VDB)
  # Debian installs FindOpenVDB.cmake in a separate folder
  list(APPEND CMAKE_MODULE_PATH "/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB")
  # QUIET does not silence what this file and the packages that it needs print, such as notes about
  # a library of Imath for Python, which is not used
  set(sdm_level ${CMAKE_MESSAGE_LOG_LEVEL})
  set(CMAKE_MESSAGE_LOG_LEVEL WARNING)
  find_package(OpenVDB QUIET COMPONENTS openvdb)
  set(CMAKE_MESSAGE_LOG_LEVEL ${sdm_level})
  if(NOT OpenVDB_FOUND)
    message(FATAL_ERROR "OpenVDB not found: install libopenvdb-dev and libboost-iostreams-dev, or "
      "configure with -DSDM_VDB=OFF (no .vdb files)")
  endif()
endif()

if(SDM_TESTS)
  if(SDM_CONFIG AND NOT SDM_PICTURE)
    message(FATAL_ERROR "the tests of the program make pictures: configure with -DSDM_PICTURE=ON or -DSDM_TESTS=OFF")
  endif()
  if(NOT SDM_PLUGINS)
    message(FATAL_ERROR "the tests load plug-ins: configure with -DSDM_PLUGINS=ON or "
      "-DSDM_TESTS=OFF")
  endif()
  if(PKG_CONFIG_FOUND)
    pkg_check_modules(CMOCKA IMPORTED_TARGET cmocka)
  endif()
  if(NOT CMOCKA_FOUND)
    message(FATAL_ERROR "cmocka not found: install libcmocka-dev, or configure with "
      "-DSDM_TESTS=OFF")
  endif()
endif()
