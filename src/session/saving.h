// SPDX-License-Identifier: MIT
/*
 * The filter's state into the store and out of it: on a STATE, and where the options ask for it.
 * Each time it is answered with a TEXT for a human, and then with a REPORT of subject STATE:
 *
 *     PLR_OK           done
 *     PLR_E_MODE       there is no storage; or a restore in the midst of a drive
 *     PLR_E_NOT_READY  save: no data was taken yet; restore: no HEADER yet, or nothing was ever saved
 *     PLR_E_CONFIG     restore: settings or calibration make no filter
 *     PLR_E_FULL       the device is too small
 *     PLR_E_FOREIGN, _CORRUPT, _IO, _DIVERGED   as state_store.h says
 *     PLR_E_ARGUMENT, _NOT_FINITE, _RANGE       a restore's variances make no sense
 *
 * After a restore the drive goes on at the message's t_ns, and the body may have moved as it says. If
 * it has not moved, and t_ns follows on the saved time within max-gap, nothing lies between: the last
 * reading applies, and the bits are those of a drive that was never interrupted.
 *
 * A restore that is refused leaves the session as it was before: ready for CONFIG, START and data.
 */
#ifndef PLR_SESSION_SAVING_H
#define PLR_SESSION_SAVING_H

#include "pelorus/session.h"

/* STATE (save): saves the filter as it is, and answers. Twists that are held back are not part of
 * it. `t_ns` is that of the REPORT. */
void plr_saving_save(plr_session *s, plr_time_ns t_ns);

/* STATE (restore), which is s->in, where no drive is under way: restores, echoes it behind the
 * CONFIG in force, and answers. */
void plr_saving_restore(plr_session *s);

/* PLR_START_SAVED, before the first data of time t_ns, with an initialised filter: restores the
 * state, with a body that has not moved, and answers. */
void plr_saving_restore_at_start(plr_session *s, plr_time_ns t_ns);

/* Answers that a save or restore is refused. */
void plr_saving_refuse(plr_session *s, plr_state_action action, plr_time_ns t_ns,
                       plr_status status);

#endif
