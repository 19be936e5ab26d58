// SPDX-License-Identifier: MIT
/*
 * Option --map-in: the landmarks of an earlier result are used as known ones.
 *
 * A map is a .plr whose LANDMARK messages say where points are and how well that is known: the
 * flight log of --out (roles evicted and final), or, where it has none of those, known ones.
 * Positions are in that drive's world, so the drive that takes it must begin in the same one.
 */
#ifndef PELORUS_POSIX_MAP_IN_H
#define PELORUS_POSIX_MAP_IN_H

#include "pelorus/wire.h"
#include "posix/samples.h"
#include "posix/setting_list.h"

enum { MAP_IN_MOST = 1 << 16 };

typedef struct map_in {
    const char *path;  /* NULL: none is wanted */
    plr_header header; /* version_major 0: the file has none */
    samples landmarks; /* plr_landmark, ascending by id */
    unsigned
        left_out; /* whose place is not known: their variance is PLR_WIRE_UNKNOWN_VARIANCE or more */
} map_in;

/* Reads and checks the whole file; NULL: no map. On false, `problem` says what is wrong, of which
 * landmark, and what would be right. To be freed in any case. */
bool map_in_read(map_in *map, const char *path, char problem[PROBLEM_SIZE]);
void map_in_free(map_in *map);

/* May a recording with this HEADER use the map? On false, `problem` says why not. */
bool map_in_fits(const map_in *map, const plr_header *recording, char problem[PROBLEM_SIZE]);

/* True if the map was made with another camera: then the ids may well be another front end's. */
bool map_in_is_of_another_camera(const map_in *map, const plr_header *recording);

#endif
