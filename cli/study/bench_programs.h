/* Peers: other programs that make the map, or distances at points, for a benchmark. They are found
 * in a folder, started, and answer with a line of JSON. For the protocol see bench/peers/peer.h. */
#pragma once

#include <limits.h>

#include "sdm/mesh.h"

enum { CLI_PEER_PATH = PATH_MAX };

/* The folder of the peers, a temporary folder, and the files in it: the mesh, the points, and the
 * values of the peer that ran last. */
typedef struct cli_peers {
    char folder[CLI_PEER_PATH], work[CLI_PEER_PATH / 2];
    char mesh_path[CLI_PEER_PATH], points_path[CLI_PEER_PATH], values_path[CLI_PEER_PATH];
    const char **names; /* [n] the peers of this project, then the others in the folder */
    size_t n;
} cli_peers;

/* The answer of a peer. */
typedef struct cli_peer_answer {
    bool done;                 /* it has figures; else note is the reason */
    char note[256];            /* version and method */
    double ms_prepare, ms_map; /* ms_map: for the computed share */
    double share;              /* fraction of the voxels computed */
    double peak_mb;            /* growth of the resident memory, MiB; NAN: unknown */
    bool band;                 /* a narrow band saved work */
} cli_peer_answer;

/* Finds the peers in a folder (NULL: the folder of this program or, after an installation, libexec)
 * and writes the mesh for them. Zero-initialise *p; cli_peers_close() removes the files and frees
 * it, also after an error. SDM_E_ARG: no such folder. SDM_E_IO. SDM_E_NOMEM. */
sdm_status cli_peers_open(const char *folder, const sdm_mesh *mesh, cli_peers *p, sdm_error *err);
void cli_peers_close(cli_peers *p);

/* Name of the i-th peer of this project; NULL after the last one. */
const char *cli_peers_known(size_t i);

/* Starts the peer `name` with the mesh, argument[n] and the file for its values. A program that is
 * missing or fails leaves a reason; that is no error. SDM_E_NOMEM. */
sdm_status cli_peers_run(const cli_peers *p, const char *name, char *const *argument, size_t n,
                         cli_peer_answer *answer, sdm_error *err);
