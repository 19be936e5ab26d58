// SPDX-License-Identifier: MIT
/* From a HEADER to a running filter with a start pose. */
#ifndef PLR_SESSION_START_H
#define PLR_SESSION_START_H

#include "pelorus/session.h"

/* Forgets everything that came before: counts, settings, START, known landmarks, held twists. */
void plr_start_clear(plr_session *s);

/* s->in is a HEADER or CONFIG. True if it says what is in force already. */
bool plr_start_in_force(const plr_session *s);

/* s->in is a HEADER: begins a drive. */
void plr_start_begin(plr_session *s);

/* s->in is a CONFIG, before the data. A value that no setting allows is refused, the others count. */
void plr_start_change_settings(plr_session *s);

/* s->in is a START: keeps it until its time comes, if the options ask for one. */
void plr_start_keep(plr_session *s);

/* s->in is a LANDMARK (known). */
void plr_start_add_landmark(plr_session *s);

/* In PLR_PHASE_READY: composes the settings and initialises the filter. On an error what is wrong
 * has been refused, and the phase is PLR_PHASE_REJECTED. */
plr_status plr_start_filter(plr_session *s);

/* Before the first data reaches the filter: sends the CONFIG in force and the map, and warns. */
void plr_start_announce(plr_session *s);

/* The bias that a START gave, whatever the pose starts from. */
void plr_start_set_bias(plr_session *s);

/* Sets the pose. If none was set before, it is the start. P_xi as in plr_filter_set_pose. A refusal
 * is sent with that subject. */
void plr_start_set_pose(plr_session *s, plr_kind subject, plr_time_ns t_ns, const plr_pose *T_WB,
                        const double *P_xi);

/* Sets the pose to that of s->start. */
void plr_start_apply(plr_session *s);

/* Before data of time t_ns: applies a START whose time has come. */
void plr_start_apply_until(plr_session *s, plr_time_ns t_ns);

/* Before a frame of time t_ns: the same, and without a START the pose starts where the options say.
 * The phase stays PLR_PHASE_STARTING if they ask for a START or TRUTH that has not come. */
void plr_start_choose(plr_session *s, plr_time_ns t_ns);

#endif
