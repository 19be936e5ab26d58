// SPDX-License-Identifier: MIT
/* Pelorus: a stereo visual-inertial SLAM filter. Includes the complete interface of the filter.
 * Separate headers: the frame format of recordings and links in wire.h, a main loop over such a
 * link in session.h, what that loop needs of the machine in port.h, saved states in
 * state_store.h. */
#ifndef PELORUS_PELORUS_H
#define PELORUS_PELORUS_H

#include "pelorus/config.h"
#include "pelorus/filter.h"
#include "pelorus/settings.h"
#include "pelorus/types.h"

#endif
