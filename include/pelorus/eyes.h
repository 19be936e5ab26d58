// SPDX-License-Identifier: MIT
/*
 * Eyes for a session: pictures in, a pose out. A program that wants them reserves a plr_eyes and names it in
 * the session's options; who does not, carries none of their code.
 *
 *     static uint8_t pixels[2][160 * 120];              // of the pictures that come as messages
 *     static plr_eyes eyes;
 *     plr_eyes_init(&eyes, pixels[0], pixels[1], sizeof pixels[0]);
 *     options.eyes = &eyes;
 *     plr_session_init(&session, &port, &options);
 *
 * Pictures come as IMAGE messages, or from the program's own camera: plr_session_look. The cameras are those
 * of a RIG message, or of plr_eyes_set_rig; without either the pictures are rectified, as HEADER says. HEADER's
 * camera is in any case the one in which observations are told.
 *
 * What becomes of a pair: plr_vision follows the points, with the motion that the filter expects; the frame
 * goes the way of a STEREO message, and the session's log has it as one, so that it replays without pictures.
 */
#ifndef PELORUS_EYES_H
#define PELORUS_EYES_H

#include "pelorus/vision.h"
#include "pelorus/wire.h"

#ifdef __cplusplus
extern "C" {
#endif

/* So well an IMU's velocity must be known to say where points will be, m/s: in a pair's time a body changes
 * its own by as much, and then a track's last drift tells it as well. */
#define PLR_EYES_SPEED_SIGMA 0.1

/* The motion of the body since the last pair, by what the filter says of its velocity. */
typedef struct plr_eyes_motion {
    bool known;          /* the filter has moved since HEADER */
    plr_time_ns t_ns;    /* until when it is known */
    plr_real R[9], p[3]; /* x_then = R x_now + p, in the body's axes */
    plr_real v[3], w[3]; /* at the last step */
} plr_eyes_motion;

/* A picture that comes in bands. */
typedef struct plr_eyes_half {
    uint8_t *pixels;
    plr_time_ns t_ns;
    uint32_t there; /* pixels so far */
    bool broken;    /* a band was missing: what is left of this picture is ignored */
} plr_eyes_half;

/* Counts since HEADER. */
typedef struct plr_eyes_totals {
    uint32_t pairs;    /* that were looked at */
    uint32_t refused;  /* pairs that plr_vision_track refused */
    uint32_t broken;   /* pictures with bands missing, out of order or of another size */
    uint32_t unpaired; /* pictures without the other side */
    uint32_t faults;   /* pairs with a plr_picture_fault */
} plr_eyes_totals;

typedef struct plr_eyes plr_eyes;

/* What the session asks of them: by pointers, so that the library's session does not need vision. */
typedef struct plr_eyes_calls {
    void (*clear)(plr_eyes *e);
    bool (*same_rig)(const plr_eyes *e, const plr_rig *rig);
    void (*begin)(plr_eyes *e, const plr_header *header, double camera_offset_s);
    void (*moved)(plr_eyes *e, plr_time_ns t_ns, const plr_twist *velocity);
    plr_status (*take)(plr_eyes *e, const plr_image_message *band, plr_picture_pair *pair);
    plr_status (*look)(plr_eyes *e, const plr_picture_pair *pair, bool place_known,
                       plr_frame *frame);
} plr_eyes_calls;

/* A caller may read `vision`, `totals` and `expected` (the motion that the last pair was looked at with); the
 * rest is the library's own. */
struct plr_eyes {
    plr_vision vision;
    plr_eyes_totals totals;
    plr_expected expected;
    const plr_eyes_calls *calls;
    plr_status status; /* of the cameras: PLR_E_NOT_READY before the first data */
    plr_rig own, rig;
    bool has_own, has_rig;
    plr_pose T_CB;
    double camera_offset_s;
    plr_eyes_motion motion;
    plr_eyes_half halves[2];
    uint32_t capacity; /* bytes of each half's pixels */
    uint32_t told;     /* what the session has said of pictures in this drive */
};

/* plr_eyes_init for a caller whose compiled-in sizes are given; use plr_eyes_init. */
plr_status plr_eyes_init_sized(plr_eyes *e, uint8_t *left, uint8_t *right, uint32_t capacity,
                               const plr_vision_sizes *caller);

/* Prepares eyes. `left` and `right` are memory for the pictures that come as messages, `capacity` bytes each;
 * they must outlive the session, and may be NULL with capacity 0 where the pictures are the program's own.
 * PLR_E_ARGUMENT a null pointer; PLR_E_SIZE the caller was compiled with other sizes. */
static inline plr_status plr_eyes_init(plr_eyes *e, uint8_t *left, uint8_t *right,
                                       uint32_t capacity) {
    const plr_vision_sizes here = plr_vision_sizes_here((uint32_t)sizeof(plr_eyes));
    return plr_eyes_init_sized(e, left, right, capacity, &here);
}

/* The cameras of drives without a RIG message. They are checked at the first data, when HEADER is known.
 * PLR_E_ARGUMENT a null pointer. */
plr_status plr_eyes_set_rig(plr_eyes *e, const plr_rig *rig);

#ifdef __cplusplus
}
#endif

#endif
