// SPDX-License-Identifier: MIT
/* The drive of session_drive.h moved by an IMU: frames at 10 Hz, readings at 100 Hz, sent to the session
 * on the desk in several manners, and what came of it. */
#ifndef PELORUS_TEST_SESSION_INERTIAL_H
#define PELORUS_TEST_SESSION_INERTIAL_H

#include "support/session_desk.h"

enum { INERTIAL_FRAMES = 25, INERTIAL_PER_FRAME = 10 };

#define INERTIAL_FRAME_S   0.1
#define INERTIAL_READING_S 0.01

typedef struct inertial_manner {
    unsigned batch;        /* readings in an IMU message */
    double frames_late_s;  /* frames come so much later than readings of their time */
    double camera_ahead_s; /* the camera's clock is ahead of the IMU's by that much */
    bool twists;           /* TWISTs come too */
    bool without_header;   /* the HEADER says twist */
} inertial_manner;

/* Readings one by one, everything in time. */
extern const inertial_manner inertial_plain;

plr_message inertial_header(void);

void inertial_send_frame(const inertial_manner *how, int k);

/* Readings from number `from` to before `end`; frame k is of the time of reading 10 k. */
void inertial_send_readings(const inertial_manner *how, int from, int end);

/* HEADER, START, and INERTIAL_FRAMES frames. */
void inertial_send_drive(const inertial_manner *how);

/* A session that is given the drive. */
void inertial_run(const inertial_manner *how);

/* The last POSE, and how many there are. */
typedef struct inertial_result {
    plr_pose_message pose;
    unsigned poses;
} inertial_result;

/* Reads all answers; the next one is the first again. */
inertial_result inertial_read(void);

/* What an empty port and default options make of the drive. */
inertial_result inertial_result_of(const inertial_manner *how);

/* Unity assertion: the same bits. */
void inertial_assert_same(const inertial_result *expected, const inertial_result *found);

#endif
