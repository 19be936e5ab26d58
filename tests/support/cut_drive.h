// SPDX-License-Identifier: MIT
/*
 * A drive whose power fails: one session up to the cut, another after the restart, each with a port
 * of its own, and the flash that both keep their state in.
 */
#ifndef PELORUS_TEST_CUT_DRIVE_H
#define PELORUS_TEST_CUT_DRIVE_H

#include "pelorus/session.h"
#include "pelorus/state_store.h"
#include "support/faulty_flash.h"
#include "support/faulty_port.h"
#include "support/pose_of.h"
#include "support/session_drive.h"

/* Landmark slots; frames up to the cut, and up to the end. */
enum { SLOTS = 8, CUT = 12, LAST = 24 };

extern plr_session before_cut, after_restart;
extern plr_session_options cut_options; /* of the next session; with the store */
extern faulty_port first_port, second_port;
extern faulty_flash cut_flash;
extern plr_state_store cut_store;
extern bool cut_by_imu; /* readings of an IMU come, and the HEADER says so; else twists */

/* Empty ports, a new flash, default options: for setUp. */
void cut_clear(void);

/* Initialises a session, and sends its HEADER and CONFIG. */
void cut_begin(plr_session *s, faulty_port *port);

void cut_send(faulty_port *port, plr_message message);

/* A STATE, of a body that stood still. */
plr_message cut_ask(plr_state_action action, plr_time_ns t_ns);

plr_time_ns cut_frame_time(unsigned i);

/* From frame to frame, ten a second, four twists, or readings, before each. */
void cut_drive(faulty_port *port, unsigned from, unsigned to);

/* Steps until the port has nothing more. */
void cut_run(plr_session *s);

/* The drive up to the cut, saved there. */
void cut_drive_and_save(void);

/* The next answer to a STATE, and the TEXT before it. */
plr_status cut_answer(faulty_port *port, plr_time_ns *t_ns, char *words);

/* The next answer to a STATE has this status, and the TEXT before it these words. */
void cut_assert_answered(faulty_port *port, plr_status status, const char *words);

/* Every POSE from frame CUT on: the payloads must be equal, reset_count included. */
void cut_assert_same_poses(void);

/* Where the session after the restart is. */
void cut_assert_pose_x(double expected_m, double tolerance_m);

#endif
