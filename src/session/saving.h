// SPDX-License-Identifier: MIT
/*
 * Saves the filter's state to the store and restores it: when a STATE asks for it, and when the
 * session's options do. The answer is a TEXT and then a REPORT of subject STATE, with a status:
 *
 *     PLR_OK           done
 *     PLR_E_MODE       there is no store, or a restore was asked for during a drive
 * PLR_E_NOT_READY save: no data was used yet; restore: no HEADER yet, or nothing was ever saved
 *     PLR_E_CONFIG     restore: no filter can be initialised with these settings and calibration
 *     PLR_E_FULL       the device is too small
 *     PLR_E_FOREIGN, _CORRUPT, _IO, _DIVERGED   as state_store.h says
 *     PLR_E_ARGUMENT, _NOT_FINITE, _RANGE       a restore's variances make no sense
 *
 * After a restore the drive continues at the message's t_ns, with the covariance enlarged by how
 * far the body may have moved. If it has not, and t_ns is later than the saved time by at most
 * max-gap, the last twist still applies, and the results have the bits of a drive without the
 * interruption. A restore that is refused leaves the session as it was before: ready for CONFIG,
 * START and data.
 */
#ifndef PLR_SESSION_SAVING_H
#define PLR_SESSION_SAVING_H

#include "pelorus/session.h"

/* STATE (save): saves the filter without the delayed twists, and answers. t_ns: of the REPORT. */
void plr_saving_save(plr_session *s, plr_time_ns t_ns);

/* STATE (restore), in s->in, before the data: restores, sends CONFIG and the echo, and answers. */
void plr_saving_restore(plr_session *s);

/* Option PLR_START_SAVED, after the filter was initialised for the first data, whose time is t_ns:
 * restores the state, assuming that the body has not moved, and answers. */
void plr_saving_restore_at_start(plr_session *s, plr_time_ns t_ns);

/* Answers that a save or restore is refused. */
void plr_saving_refuse(plr_session *s, plr_state_action action, plr_time_ns t_ns,
                       plr_status status);

#endif
