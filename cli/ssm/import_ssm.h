/* Readers of the sources of `sdmgen import ssm`. */
#pragma once

#include "args/options.h"
#include "sdm/internal/ssm.h"

/* Reads a model of Statismo or Scalismo (.h5, .h5.json): versions 0.8, 0.9 and 1.x. --model selects
 * one of a catalog, --surface gives the triangles. Modes without variance are left out. *out must
 * be empty; after an error it has to be disposed of. SDM_E_FORMAT, SDM_E_ARG, SDM_E_UNSUPPORTED,
 * SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_ssm_statismo(const cli_args *args, const char *path, sdm_ssm *out, sdm_error *err);

/* The same for a file of HDF5 (.h5), in a child process (cli_read_in_child()): libhdf5 crashes or
 * does not end when some files are damaged. */
sdm_status cli_ssm_hdf5(const cli_args *args, const char *path, sdm_ssm *out, sdm_error *err);

/* Makes a model of the mesh files of a folder, which have the same triangles: sdm_ssm_align(),
 * sdm_ssm_components(). Errors as above. */
sdm_status cli_ssm_meshes(const cli_args *args, const char *folder, sdm_ssm *out, sdm_error *err);

/* True when the folder has files .particles. */
bool cli_ssm_has_particles(const char *folder);

/* Makes a model of the particles of ShapeWorks in a folder: the mesh of --surface, warped onto the
 * particles of all shapes (sdm_ssm_warp()), then as above. --particles names those of the mesh;
 * without it they are found by the name of the mesh, or are its vertices. Errors as above. */
sdm_status cli_ssm_particles(const cli_args *args, const char *folder, sdm_ssm *out,
                             sdm_error *err);
