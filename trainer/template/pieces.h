/* The pieces of a component that moves as several: sets of vertices that move alike, and the joints
   between them. */
#pragma once

#include "family.h"

enum { PIECES_MAX = 24 };

/* A piece is rigid, or it flexes: then it is a connected set of vertices that follow no rigid
   motion, and those around it. */
typedef struct pieces {
    size_t n;
    bool flexes[PIECES_MAX];
    uint32_t *vertices; /* of piece 0, then of piece 1, ...; ascending in each; owned */
    size_t first[PIECES_MAX + 1];
} pieces;

/* Divides component c of the family. Every triangle has all its corners in one piece at least.
   Vertices belong to the same rigid piece if one rigid motion fits them to `tolerance` (mm, each
   vertex) in all of two dozen random meshes, where they are connected: regions that grow from the
   vertices whose surroundings move most rigidly (as in Schaefer and Yuksel 2007). Pieces that flex
   overlap their neighbours by `overlap` (mm). out->n = 0: the component has no rigid piece of
   useful size, or more than PIECES_MAX pieces. Call trainer_pieces_dispose() also after an
   error. */
sdm_status trainer_pieces_find(const family *f, uint32_t c, double tolerance, double overlap,
                               pieces *out, sdm_error *err);
void trainer_pieces_dispose(pieces *p);
