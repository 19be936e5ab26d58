// SPDX-License-Identifier: MIT
#include "encode.h"

/* Generated at build time from pymavlink's message definitions. */
#include <common/mavlink.h>

size_t plr_odometry_encode(const plr_odometry *o, uint8_t bytes[PLR_MAVLINK_FRAME_MAX]) {
    static mavlink_message_t message;
    (void)mavlink_msg_odometry_pack(PLR_MAVLINK_SYSTEM, PLR_MAVLINK_COMPONENT, &message, o->time_us,
                                    MAV_FRAME_LOCAL_FRD, MAV_FRAME_BODY_FRD, o->p[0], o->p[1],
                                    o->p[2], o->q, o->v[0], o->v[1], o->v[2], o->w[0], o->w[1],
                                    o->w[2], o->pose_covariance, o->velocity_covariance,
                                    o->reset_counter, MAV_ESTIMATOR_TYPE_VIO, o->quality);
    return mavlink_msg_to_send_buffer(bytes, &message);
}
