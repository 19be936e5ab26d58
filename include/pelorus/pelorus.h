// SPDX-License-Identifier: MIT
/* Pelorus: a stereo visual-inertial SLAM filter; includes its complete interface. In headers of
 * their own: the frame format of recordings and links (wire.h), a main loop over such a link
 * (session.h), what it needs of the machine (port.h), saved states (state_store.h). */
#ifndef PELORUS_PELORUS_H
#define PELORUS_PELORUS_H

#include "pelorus/config.h"
#include "pelorus/filter.h"
#include "pelorus/settings.h"
#include "pelorus/types.h"

#endif
