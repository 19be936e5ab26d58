// SPDX-License-Identifier: MIT
/*
 * The filter: twists and stereo observations in, pose and landmarks with covariance out.
 *
 *     static plr_filter filter;                      // all of its memory; no heap anywhere
 *     plr_config config;
 *     plr_config_default(&config);
 *     plr_filter_init(&filter, &calibration, &config, NULL);
 *     plr_filter_predict(&filter, t_ns, &twist);     // at every twist
 *     plr_filter_update(&filter, &frame, &report);   // at every stereo pair
 *     plr_filter_pose(&filter, &pose);
 *
 * Time is an argument: the filter has no clock. Every call runs a bounded number of steps, whatever
 * its data; the bounds are in docs/SIZES.md. Two filters can live side by side; one filter is not
 * thread-safe: calls on it must not overlap. A call that is refused (status < 0) changes nothing but
 * the counts of what was refused, and a question changes nothing at all: asked or not, the bits to
 * come are the same.
 * Every call first looks whether the filter's memory is as the last one left it; if not, it returns
 * PLR_E_DAMAGED, and so do all that follow, until an init.
 *
 * Errors are on the right: T = T^ Exp(xi), xi = (rho, theta) in the body frame, rho in m, theta in
 * rad; b = b^ + db. Covariances are of these. Source of the equations: docs/MATH.md.
 */
#ifndef PELORUS_FILTER_H
#define PELORUS_FILTER_H

#include "pelorus/settings.h"
#include "pelorus/state.h"
#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* --- life --- */

/* What plr_filter_init calls, with the sizes of whoever calls it. */
plr_status plr_filter_init_sized(plr_filter *f, const plr_calibration *calibration,
                                 const plr_config *config, const plr_map *map,
                                 const plr_sizes *caller);

/* Prepares a filter: pose identity with covariance start_sigma^2 I, bias 0 with its prior, no
 * landmarks, clock not started (the first twist or frame starts it). `map` may be NULL: no sink, no
 * source. All three are copied, so they need not outlive the call.
 * PLR_E_ARGUMENT null pointer; PLR_E_CONFIG, see plr_config_check; PLR_E_CALIBRATION focal length
 * or baseline not positive, or T_CB not a rigid motion, or a number of them beyond 1e6;
 * PLR_E_MODE localization without a source; PLR_E_CPU the processor flushes subnormals to zero;
 * PLR_E_SIZE the caller was compiled with other sizes than the library: nothing is written.
 * After any other error the filter refuses every call with PLR_E_NOT_READY. */
static inline plr_status plr_filter_init(plr_filter *f, const plr_calibration *calibration,
                                         const plr_config *config, const plr_map *map) {
    const plr_sizes here = plr_sizes_here(sizeof(plr_filter));
    return plr_filter_init_sized(f, calibration, config, map, &here);
}

/* Back to the state after plr_filter_init, with all counters at zero. */
plr_status plr_filter_reset(plr_filter *f);

/* Sets the pose from outside (start, or re-localise): P_xi[36] is the covariance of (rho, theta),
 * NULL for start_sigma^2 I. Landmarks are dropped without going to the sink: what they were tied to
 * is gone. Bias and its covariance stay. Starts the clock, or sets it: t_ns may be anything.
 * Counted in plr_filter_totals().resets, once the clock has been started.
 * PLR_E_NOT_FINITE; PLR_E_ARGUMENT if R is not a rotation or P_xi not symmetric and positive;
 * PLR_E_RANGE beyond 1e9 m or a variance of 1e12; PLR_E_MODE in mapping. */
plr_status plr_filter_set_pose(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB,
                               const double *P_xi);

/* Sets mean and variances of the bias prior, 6 each: (b_v, b_w). Only before the first twist and the
 * first frame. PLR_E_MODE if bias is off, in mapping, or after those; PLR_E_NOT_FINITE;
 * PLR_E_ARGUMENT a negative variance; PLR_E_RANGE a bias beyond 1e4 or a variance beyond 1e12. */
plr_status plr_filter_set_bias(plr_filter *f, const double *mean, const double *variance);

/* --- measurements --- */

/* A twist reading at t_ns; what interval it stands for is the setting twist_timing. Costs the same
 * for any number of landmarks. In mapping it is checked, and otherwise ignored.
 * PLR_E_TIME not later than the last reading, or older than the last frame; PLR_E_GAP further ahead
 * than max_gap; PLR_E_NOT_FINITE; PLR_E_RANGE more than pi rad or 1 km in one step, be it this one
 * or, by this reading, one as long as the last. */
plr_status plr_filter_predict(plr_filter *f, plr_time_ns t_ns, const plr_twist *twist);

/* mapping only: the body's pose at t_ns, taken as exact. The landmarks are carried along. The first
 * one starts the map. PLR_E_MODE, PLR_E_TIME, PLR_E_NOT_FINITE, PLR_E_ARGUMENT (not a rotation),
 * PLR_E_RANGE (beyond 1e9 m). */
plr_status plr_filter_move_to(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB);

/* A stereo frame: predict up to its time, match, find the motion, gate, update, retract, evict,
 * initialise, judge health. The order of the observations changes no bit. Single observations that are malformed are left out and
 * counted. `report` (may be NULL) is filled in any case.
 * PLR_E_LATE older than the last predict; PLR_E_GAP; PLR_E_RANGE the last reading cannot be held so
 * long; PLR_E_ARGUMENT more than PLR_MAX_OBSERVATIONS; PLR_E_MODE in mapping, when
 * plr_filter_move_to has not been called for this time.
 * Should a variance cease to be positive, the filter keeps the pose, drops the landmarks, widens the
 * covariance and goes on with this frame's: PLR_OK, and reasons NOT_POSITIVE and RECOVERED. */
plr_status plr_filter_update(plr_filter *f, const plr_frame *frame, plr_report *report);

/* --- estimate; valid at plr_filter_time() --- */

/* Time of the estimate: that of the last twist or frame. */
plr_time_ns plr_filter_time(const plr_filter *f);

/* T_WB. */
plr_status plr_filter_pose(const plr_filter *f, plr_pose *T_WB);

/* Covariance of (rho, theta), 6x6, m and rad. While vision contradicts the twists it reaches from one
 * story to the other (docs/MATH.md 17). */
plr_status plr_filter_pose_covariance(const plr_filter *f, double *P_xi);

/* u - b: the last reading without its estimated bias. */
plr_status plr_filter_velocity(const plr_filter *f, plr_twist *velocity);

/* Its covariance, 6x6: that of the reading plus that of the bias. */
plr_status plr_filter_velocity_covariance(const plr_filter *f, double *P_u);

/* (b_v, b_w), 6, and its covariance, 6x6. Zeros while bias is off. `P_b` may be NULL. */
plr_status plr_filter_bias(const plr_filter *f, double *b, double *P_b);

/* Trace of the whole covariance (mixed units: a trend, not a quantity); 0 where it cannot be told. */
double plr_filter_trace(const plr_filter *f);

/* --- landmarks --- */

/* How many the state holds. */
unsigned plr_filter_landmark_count(const plr_filter *f);

/* Landmark in slot 0 to count - 1, in the world, with covariance. The covariance is what is left of pose and landmark: where those are uncertain by metres
 * and it by centimetres, float32 may leave a variance below zero by rounding; the map sink's is the
 * same. PLR_E_ARGUMENT beyond the last slot. */
plr_status plr_filter_landmark(plr_filter *f, unsigned slot, plr_landmark *landmark);

/* Puts a landmark of known world position and covariance into the state. Its
 * error is taken as independent of the state's: a landmark that was evicted and is inserted again
 * is counted twice (docs/MATH.md). PLR_E_EXISTS; PLR_E_FULL; PLR_E_ARGUMENT covariance not positive;
 * PLR_E_NOT_FINITE; PLR_E_RANGE beyond 1e9 m or a variance of 1e12, or (`body`) it lies on the
 * camera or beyond max_range. */
plr_status plr_filter_insert_known(plr_filter *f, const plr_landmark *landmark);

/* Hands every landmark to the map sink and drops it; those that the sink refuses stay.
 * PLR_E_MODE without a sink; PLR_E_IO if any was refused. */
plr_status plr_filter_flush_map(plr_filter *f);

/* --- saved state --- */

/* Most bytes that a state is handed over in at once. */
enum { PLR_STATE_CHUNK = 64 };

/* Takes the next n bytes, 1 to PLR_STATE_CHUNK. 0 = taken; anything else: a failure. */
typedef int (*plr_state_sink)(void *context, const uint8_t *bytes, uint32_t n);

/* Copies n bytes, 1 to PLR_STATE_CHUNK, from `offset` bytes after the state's beginning. 0 = done;
 * anything else: a failure. It is asked in order, from the beginning to the end, and all of it
 * twice. */
typedef int (*plr_state_source)(void *context, uint32_t offset, uint8_t *bytes, uint32_t n);

/* Hands the whole state to a sink, in little-endian bytes that depend on no compiler:
 * docs/STATE-FORMAT.md. Restored, it goes on with the same bits as if nothing had been. The filter
 * is not changed. The bytes carry no checksum: that is for whoever keeps them, as
 * plr_state_store_save does. `sink` NULL: only tells whether the state can be saved.
 * PLR_E_DIVERGED and PLR_E_NOT_FINITE: such a state is worth nothing; PLR_E_IO the sink failed.
 * After an error what the sink has got is no state. */
plr_status plr_filter_save(const plr_filter *f, plr_state_sink sink, void *context);

/* Bytes of a saved state that holds so many landmarks; with plr_filter_config(f)->slots, the most it
 * can come to. 0 if there can be no such state. */
uint32_t plr_filter_saved_size(const plr_filter *f, unsigned landmarks);

/* Brings back a state of `length` bytes. The filter must have been initialised with the calibration
 * and the settings that the state was saved under; map sink and source are those given then. The
 * state is read twice: first it is looked at, then taken.
 * PLR_E_FOREIGN another build, other settings or another camera; PLR_E_CORRUPT no state, too short
 * or too long, or numbers that no filter holds; PLR_E_IO the source failed. A refusal changes
 * nothing, unless the source gave other bytes, or failed, at the second reading: then the filter is
 * as after plr_filter_reset. */
plr_status plr_filter_restore(plr_filter *f, uint32_t length, plr_state_source source,
                              void *context);

/* Goes on at t_ns of whatever clock there is now, after an interruption in which no twist was heard:
 * the body stands where it stood, but for an unknown motion of mean 0 and covariance P_moved[36], of
 * (rho, theta); NULL: it has not moved at all. Landmarks stay, and their correlation with the pose.
 * PLR_E_MODE P_moved in mapping, or nothing has begun yet; PLR_E_NOT_FINITE; PLR_E_RANGE;
 * PLR_E_ARGUMENT P_moved not symmetric and positive. */
plr_status plr_filter_resume(plr_filter *f, plr_time_ns t_ns, const double *P_moved);

/* --- what happened --- */

/* How it stands at t_ns, with or without a frame: ask it as often as the pose is used. To the reasons
 * of the last frame it adds what no report can tell: NO_FRAMES and NO_OBSERVATIONS after a second,
 * NO_TWISTS where readings were refused or the last one is older than three of their intervals and
 * 50 ms. t_ns before the filter's own time counts as that. Changes nothing. PLR_E_DAMAGED,
 * PLR_E_NOT_READY: `health` says DIVERGED. */
plr_status plr_filter_health(const plr_filter *f, plr_time_ns t_ns, plr_health_state *health);

/* Counts since init or reset. */
plr_status plr_filter_totals(const plr_filter *f, plr_totals *totals);

/* The setting table's values in force. */
const plr_config *plr_filter_config(const plr_filter *f);

/* A sentence for a status: what went wrong and what would be right. Never NULL. */
const char *plr_status_text(plr_status status);

/* A phrase for a single bit of plr_report.reasons; one for a health. Never NULL. */
const char *plr_reason_text(plr_reason reason);
const char *plr_health_text(plr_health health);

/* "1.0.0" and a number that differs between builds whose bits may differ: version, arithmetic
 * (PLR_ARITHMETIC), precision, capacity, block size. */
const char *plr_version(void);
uint32_t plr_build_fingerprint(void);

#ifdef __cplusplus
}
#endif

#endif
