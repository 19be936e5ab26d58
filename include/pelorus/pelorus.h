// SPDX-License-Identifier: MIT
/* Pelorus: a stereo visual-inertial SLAM filter. This is the whole of the filter's interface; the
 * frame format is in wire.h, the loop in session.h, the port in port.h. */
#ifndef PELORUS_PELORUS_H
#define PELORUS_PELORUS_H

#include "pelorus/config.h"
#include "pelorus/filter.h"
#include "pelorus/settings.h"
#include "pelorus/types.h"

#endif
