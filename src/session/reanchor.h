// SPDX-License-Identifier: MIT
/*
 * Following a clock that jumped.
 *
 * The filter refuses a step of more than max-gap, and everything older than its estimate. So one
 * damaged time stamp cannot throw the estimate away; but after a true jump (a clock that was set, a
 * sender that started anew) everything would be refused for ever. The rule:
 *
 * - A message is out of reach if its time is further than max-gap from the estimate's, ahead or
 *   behind, and the filter refused it for that. Of a batch of readings only the first counts.
 * - Two successive ones agree if the second is later than the first by at most max-gap. Equal times
 *   are one message received twice: they count once.
 * - After PLR_SESSION_AGREEING that agree, with none accepted in between, the new time is believed.
 *   The session hands the landmarks to the map, sets the pose at the new time to the last one, and
 *   widens its covariance: by ((v + sigma_v) gap)^2 in each variance of rho, v the sum of the last
 *   velocity's absolute components, at most (1 km)^2; by ((w + sigma_w) gap)^2 in each of theta, at
 *   most pi^2 / 3, an angle of which nothing is known. The gap is the whole jump: how much of it is
 *   the clock's alone nobody knows. In mapping, where every pose comes as a TRUTH, the filter just
 *   begins anew. With an IMU it starts anew (setting imu-start), with the last pose and biases;
 *   sigma_v is start-velocity-sigma then, and sigma_w 1 rad/s.
 *
 * That message is then used. The jump is counted, and a TEXT reports it.
 */
#ifndef PLR_SESSION_REANCHOR_H
#define PLR_SESSION_REANCHOR_H

#include "pelorus/session.h"

/* Notes what the filter, whose estimate is at filter_ns, answered to a message of t_ns. True if the
 * new time is to be believed now. */
bool plr_clock_watch_note(plr_clock_watch *watch, plr_time_ns t_ns, plr_status status,
                          plr_time_ns filter_ns, plr_time_ns max_gap_ns);

/* The setting max-gap: a time farther off is no pause, but another clock. */
plr_time_ns plr_clock_max_gap_ns(const plr_session *s);

/* True if t_ns lies further behind newest_ns than that: the sender's clock was set back. */
bool plr_clock_was_set_back(const plr_session *s, plr_time_ns newest_ns, plr_time_ns t_ns);

/* After the filter answered data of t_ns with that status: carries the estimate there, if the new
 * time is to be believed now. True if it did: the filter will accept the same data. */
bool plr_reanchor_follow(plr_session *s, plr_time_ns t_ns, plr_status status);

/* Adds to a line about a jump from one time to another whether a counter of 32 bits makes such a one when it starts
 * again. */
void plr_reanchor_tell_counter(plr_text *line, plr_time_ns from_ns, plr_time_ns to_ns);

#endif
