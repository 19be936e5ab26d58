// SPDX-License-Identifier: MIT
/* The session's port on a board: the link's serial port, the clock and the watchdog. */
#ifndef PELORUS_CORTEX_M_PORT_SERIAL_H
#define PELORUS_CORTEX_M_PORT_SERIAL_H

#include "pelorus/port.h"

/* There is one link, so the port needs no context. serial_start and clock_start come first. */
plr_port port_serial(void);

#endif
