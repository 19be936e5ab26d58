// SPDX-License-Identifier: MIT
/* ODOMETRY as the bytes of a MAVLink 2 frame. */
#ifndef PELORUS_MAVLINK_ENCODE_H
#define PELORUS_MAVLINK_ENCODE_H

#include <stddef.h>

#include "odometry.h"

enum {
    PLR_MAVLINK_FRAME_MAX = 280, /* bytes */
    PLR_MAVLINK_SYSTEM = 1,      /* the vehicle's, as autopilots are delivered */
    PLR_MAVLINK_COMPONENT = 197  /* MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY */
};

/* Writes a frame, and returns its length. The frame's sequence number counts the calls. */
size_t plr_odometry_encode(const plr_odometry *o, uint8_t bytes[PLR_MAVLINK_FRAME_MAX]);

#endif
