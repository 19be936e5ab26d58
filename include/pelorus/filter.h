// SPDX-License-Identifier: MIT
/*
 * The filter: twists or readings of an IMU, and stereo observations in; pose and landmarks with
 * covariance out.
 *
 *     static plr_filter filter;                      // all of its memory; no heap anywhere
 *     plr_config config;
 *     plr_config_default(&config);
 *     plr_filter_init(&filter, &calibration, &config, NULL);
 *     plr_filter_predict(&filter, t_ns, &twist);     // at every twist
 *     plr_filter_update(&filter, &frame, &report);   // at every stereo pair
 *     plr_filter_pose(&filter, &pose);
 *
 * With an IMU in place of twists (where it is on the body: settings imu_turn and imu_arm):
 *
 *     config.process = PLR_PROCESS_IMU;              // and its noises: gyro_noise, accel_noise ...
 *     plr_filter_inertial(&filter, t_ns, &reading);  // at every reading, in place of predict
 *
 * The body stands still for the first second, or see the setting imu_start. Below, "reading" means
 * a twist or a reading of the IMU; readings of small sensors are named as such.
 *
 * Time is an argument: the filter has no clock. Every call runs a bounded number of steps,
 * whatever its data; the bounds are in docs/SIZES.md. A program may have several filters. One
 * filter is not thread-safe: calls on it must not overlap.
 *
 * A refused call (status < 0) changes only the counts of refused calls. Of refused IMU readings the
 * filter also remembers what was wrong, and how many came in succession (plr_filter_inertial). A
 * function that takes a const filter changes nothing: later results have the same bits whether you
 * call it or not. Every call first checks that configuration, pose and the small rest of the
 * filter's memory are as the previous call left them; an update checks landmarks and covariance as
 * well. If not, it returns PLR_E_DAMAGED, and so does every later call until plr_filter_init.
 *
 * The error of a pose is defined on its right side: with T the true pose and T^ the estimate, T =
 * T^ Exp(xi), xi = (rho, theta) in the body frame, rho in m, theta in rad. The error of a bias is
 * db = b - b^, that of a velocity dv = v - v^. Covariances are those of xi, db and dv. Source of
 * the equations: docs/MATH.md.
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

/* plr_filter_init for a caller whose compiled-in sizes are given; use plr_filter_init. */
plr_status plr_filter_init_sized(plr_filter *f, const plr_calibration *calibration,
                                 const plr_config *config, const plr_map *map,
                                 const plr_sizes *caller);

/* Prepares a filter: pose identity with covariance start_sigma^2 I, bias 0 with its prior, no
 * landmarks, time not set (the first reading or frame sets it). With an IMU the filter has not
 * started: see plr_filter_inertial. `map` may be NULL: no sink, no source. All three are copied, so
 * they need not outlive the call.
 * PLR_E_ARGUMENT null pointer; PLR_E_CONFIG, see plr_config_check; PLR_E_CALIBRATION focal length
 * or baseline not positive, or T_CB not a rigid motion, or one of these numbers beyond 1e6;
 * PLR_E_MODE localization without a source; PLR_E_CPU the processor flushes subnormals to zero;
 * PLR_E_SIZE the caller was compiled with other sizes than the library: nothing is written. After
 * any other error the filter refuses every call with PLR_E_NOT_READY. */
static inline plr_status plr_filter_init(plr_filter *f, const plr_calibration *calibration,
                                         const plr_config *config, const plr_map *map) {
    const plr_sizes here = plr_sizes_here(sizeof(plr_filter));
    return plr_filter_init_sized(f, calibration, config, map, &here);
}

/* Returns the filter to its state after plr_filter_init, with all counts at zero. */
plr_status plr_filter_reset(plr_filter *f);

/* Sets the pose and the time, at the start or later. P_xi[36] is the covariance of (rho, theta),
 * 6x6; NULL: start_sigma^2 I. All landmarks are dropped and not handed to the sink, because their
 * positions belong to the old pose. Biases and velocity and their covariance stay. With an IMU
 * that has not started, position and heading are kept, and tilt is measured (not with imu_start =
 * given). t_ns may be earlier or later than the filter's time. Counted in
 * plr_filter_totals().resets, except where it is the first to set the time.
 * PLR_E_NOT_FINITE; PLR_E_ARGUMENT if R is not a rotation or P_xi not symmetric and positive;
 * PLR_E_RANGE beyond 1e9 m or a variance of 1e12; PLR_E_MODE in mapping. */
plr_status plr_filter_set_pose(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB,
                               const double *P_xi);

/* Sets mean and variances of the bias prior, 6 each: (b_v, b_w), m/s and rad/s; with an IMU
 * (b_a, b_g), m/s^2 and rad/s. Only before the first reading and the first frame.
 * PLR_E_MODE if bias is off, in mapping, or after those; PLR_E_NOT_FINITE; PLR_E_ARGUMENT a
 * negative variance; PLR_E_RANGE a bias beyond 1e4 or a variance beyond 1e12. */
plr_status plr_filter_set_bias(plr_filter *f, const double *mean, const double *variance);

/* --- measurements --- */

/* A twist reading taken at t_ns; the setting twist_timing says for which interval it is valid.
 * Moves the pose to t_ns. Takes the same time for any number of landmarks. In mapping the reading
 * is checked but not used.
 * PLR_E_TIME not later than the last reading, or earlier than the last frame; PLR_E_GAP more than
 * max_gap_s ahead; PLR_E_NOT_FINITE; PLR_E_RANGE the step to t_ns, or a next step of the same
 * length with this reading, would be more than pi rad or 1 km; PLR_E_MODE the process is another.
 * If readings are refused for longer than max_gap_s (at their usual rate) and no frame is taken either, as after
 * a clock that started again, the pose's covariance grows by the way that the body may have gone since: follow the
 * clock with plr_filter_resume. Of readings that share a stamp (a FIFO that is read at once) the first is
 * taken and the others are PLR_E_TIME: give each its own time. */
plr_status plr_filter_predict(plr_filter *f, plr_time_ns t_ns, const plr_twist *twist);

/* With the setting process = imu, in place of plr_filter_predict: a reading of accelerometer and
 * gyro taken at t_ns. Until tilt and velocity are known (setting imu-start) readings are averaged,
 * the pose stays, and health says NOT_STARTED. Takes the same time for any number of landmarks.
 * Refused readings count in plr_filter_totals().twists_refused; where the sensor is to blame,
 * plr_filter_imu_fault says how, and health says IMU_FAULT. A reading is compared with those before
 * it, whether they were refused or not. Of successive spikes two are refused and the third is used,
 * because it shows a true step or shock. Numbers that stay the same are used ten times, and then
 * refused until they change.
 * Statuses: those of plr_filter_predict, and PLR_E_RANGE at the limit of gyro_range or accel_range,
 * or a spike; PLR_E_ARGUMENT numbers that have stayed the same. */
plr_status plr_filter_inertial(plr_filter *f, plr_time_ns t_ns, const plr_imu *reading);

/* With an IMU: sets its velocity (with the setting imu-arm not that of the body's origin), in the
 * body's axes, m/s, and variances. It starts the filter with the pose that plr_filter_set_pose set.
 * PLR_E_MODE another process, no pose was set, or there are landmarks or readings since;
 * PLR_E_NOT_FINITE; PLR_E_RANGE beyond 1e4 m/s or variance 1e12; PLR_E_ARGUMENT one below 0. */
plr_status plr_filter_set_velocity(plr_filter *f, const double v_B_mps[3],
                                   const double variance[3]);

/* What is wrong with the IMU, if anything. */
plr_imu_fault plr_filter_imu_fault(const plr_filter *f);

/* mapping only: sets the body's pose at t_ns, which is taken as exact; the landmarks keep their
 * place in the world. The first call sets the time.
 * PLR_E_MODE, _TIME, _NOT_FINITE; PLR_E_ARGUMENT no rotation; PLR_E_RANGE above 1e9 m. */
plr_status plr_filter_move_to(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB);

/* A stereo frame: predicts the pose at its time with the last reading, matches observations to
 * landmarks by id, gates them, corrects the state, and makes landmarks of new ids, evicting others
 * where no slot is free. Before an IMU has started a frame only shows whether the body stands. The
 * order of the observations does not change the result. Malformed observations are left out and
 * counted. `report` (may be NULL) is filled in any case.
 * PLR_E_LATE earlier than the filter's time; PLR_E_GAP more than max_gap_s ahead; PLR_E_RANGE the
 * prediction would be more than pi rad or 1 km; PLR_E_ARGUMENT more than PLR_MAX_OBSERVATIONS;
 * PLR_E_MODE in mapping, when plr_filter_move_to has not been called for this time.
 * If a variance is no longer positive, the filter keeps the pose, enlarges its covariance, drops
 * the landmarks and starts again with those of this frame: PLR_OK, reasons NOT_POSITIVE and
 * RECOVERED. With a known map, a pose that is lost is found again from four known landmarks, and
 * the others are dropped: RELOCATED. */
plr_status plr_filter_update(plr_filter *f, const plr_frame *frame, plr_report *report);

/* A reading of a small sensor (plr_sensor) at reading->t_ns. It predicts the pose to that time
 * with the last twist or IMU reading. A position corrects the whole state at once, and with an IMU
 * a velocity (wheel, standstill) does too: there velocity is estimated, and the rate is that of
 * the gyro less its bias. With twists a velocity holds from its sensor's second reading until the
 * next one, at most for two intervals, and not at all where readings are more than half a second
 * apart: in each step of the motion it is weighed against the twist, and their difference corrects
 * the twists' biases with the next frame.
 * Of a twist, or IMU reading, and a reading of the same time give the former first; of a frame and
 * a position the frame.
 * A reading beyond the setting gate-d2, and a position more than 900 m off, is rejected: PLR_OK,
 * and result->used is false. `result` may be NULL.
 * PLR_E_ARGUMENT no such sensor, axes that it cannot measure, a sigma that is not positive, or a
 * standstill whose value is not 0;
 * PLR_E_NOT_FINITE; PLR_E_RANGE a velocity beyond 1e4, a position beyond 1e9, an arm beyond 1 km,
 * a sigma beyond 1e6, or a prediction of more than pi rad or 1 km; PLR_E_TIME before the first
 * twist or IMU reading, or the same position of the same time once more; PLR_E_NOT_READY before an
 * IMU has started; PLR_E_LATE earlier than the filter's time; PLR_E_GAP more than max_gap_s ahead;
 * PLR_E_MODE in mapping. */
plr_status plr_filter_measure(plr_filter *f, const plr_reading *reading,
                              plr_reading_result *result);

/* --- estimate at the time plr_filter_time() --- */

/* Time of the estimate: that of the last accepted twist, IMU reading, frame or reading. */
plr_time_ns plr_filter_time(const plr_filter *f);

/* The pose of the body in the world, T_WB. */
plr_status plr_filter_pose(const plr_filter *f, plr_pose *T_WB);

/* The covariances below are symmetric to the bit, and positive as plr_filter_set_pose asks for it.
 * Where float32 rounding has left a covariance that is not, its variances are enlarged until it is.
 * PLR_E_DIVERGED: a variance is negative, or (velocity and landmark, too) a number not finite. */

/* Covariance of the pose's error (rho, theta), 6x6, m and rad. While vision contradicts the twists,
 * or the IMU, it is enlarged so that it covers the pose by vision and theirs (docs/MATH.md 17). */
plr_status plr_filter_pose_covariance(const plr_filter *f, double *P_xi);

/* Velocity of the body in its own axes: the last twist minus the estimated bias. With an IMU the
 * estimated velocity, zero before the start, and the last rate of the gyro minus its bias. */
plr_status plr_filter_velocity(const plr_filter *f, plr_twist *velocity);

/* Covariance of that velocity, 6x6, in the order (v, w): the reading's plus the bias's; with an IMU
 * that of the estimated velocity, and for the rate the gyro's plus its bias's. */
plr_status plr_filter_velocity_covariance(const plr_filter *f, double *P_u);

/* The bias, 6 numbers, and its covariance, 6x6: (b_v, b_w) of the twists, m/s and rad/s, or (b_a,
 * b_g) of the IMU, m/s^2 and rad/s. Zeros while the setting bias is off. `P_b` may be NULL. */
plr_status plr_filter_bias(const plr_filter *f, double *b, double *P_b);

/* Trace of the covariance of the whole state. It adds different units, so only its trend means
 * anything. 0 if the filter is not initialised, damaged or diverged, or if it is not finite. */
double plr_filter_trace(const plr_filter *f);

/* --- landmarks --- */

/* Landmarks in the state. */
unsigned plr_filter_landmark_count(const plr_filter *f);

/* The landmark in a slot, 0 to count - 1: position in the world, m, with covariance. That
 * covariance is a small difference of larger ones: where pose and landmark are uncertain by metres
 * and it is a matter of centimetres, rounding in float32 may leave a negative variance. The map
 * sink gets the same numbers, but none that are not finite: such a landmark is dropped.
 * PLR_E_ARGUMENT beyond the last slot; PLR_E_DIVERGED. */
plr_status plr_filter_landmark(plr_filter *f, unsigned slot, plr_landmark *landmark);

/* Puts a landmark of known world position and covariance into the state. Its error is assumed to be
 * independent of the state's. That is wrong for a landmark which this filter has evicted before:
 * its information is then counted twice (docs/MATH.md).
 * PLR_E_NOT_READY before an IMU has started, whose start turns the pose; PLR_E_EXISTS; PLR_E_FULL;
 * PLR_E_ARGUMENT covariance not positive; PLR_E_NOT_FINITE; PLR_E_RANGE beyond 1e9 m or a variance
 * of 1e12, or (`body`) it lies on the camera or beyond max_range. */
plr_status plr_filter_insert_known(plr_filter *f, const plr_landmark *landmark);

/* Hands every landmark to the map sink and drops it; those that the sink refuses stay.
 * PLR_E_MODE without a sink; PLR_E_IO if any was refused. */
plr_status plr_filter_flush_map(plr_filter *f);

/* --- saved state --- */

/* Most bytes of a saved state in one call of a sink or source. */
enum { PLR_STATE_CHUNK = 64 };

/* Stores the next n bytes of a state, 1 to PLR_STATE_CHUNK. Returns 0, or anything else for a
 * failure. */
typedef int (*plr_state_sink)(void *context, const uint8_t *bytes, uint32_t n);

/* Copies n bytes, 1 to PLR_STATE_CHUNK, from `offset` in a saved state. Returns 0; anything else is
 * a failure. A restore reads the state from beginning to end, twice. */
typedef int (*plr_state_source)(void *context, uint32_t offset, uint8_t *bytes, uint32_t n);

/* Writes the whole state to a sink, as little-endian bytes that do not depend on the compiler:
 * docs/STATE-FORMAT.md. A filter that is restored from them computes the same bits as one that was
 * never interrupted, with two exceptions. With an IMU that has not started yet the average begins
 * anew. Readings of small sensors are not saved: with twists a velocity holds again from its
 * sensor's second reading. The bytes contain no checksum; plr_state_store_save adds one. `sink`
 * NULL: only checks whether the state can be saved.
 * PLR_E_DIVERGED, PLR_E_NOT_FINITE the state is not usable; PLR_E_IO the sink failed. After an
 * error discard what the sink has received. */
plr_status plr_filter_save(const plr_filter *f, plr_state_sink sink, void *context);

/* Bytes of a saved state with this number of landmarks; plr_filter_config(f)->slots gives the
 * largest size. 0 if the filter is not initialised or cannot hold so many. */
uint32_t plr_filter_saved_size(const plr_filter *f, unsigned landmarks);

/* Restores a state of `length` bytes. The filter must have been initialised with the calibration
 * and settings that it had when the state was saved; map sink and source are those of that
 * initialisation. The state is read twice: first it is checked, then it replaces the filter's.
 * PLR_E_FOREIGN saved by another build, with other settings or another camera; PLR_E_CORRUPT not a
 * state, too short or too long, or with numbers that no filter can have; PLR_E_IO the source
 * failed. After an error the filter is unchanged, unless the source failed or gave other bytes in
 * the second reading: then it is as after plr_filter_reset. */
plr_status plr_filter_restore(plr_filter *f, uint32_t length, plr_state_source source,
                              void *context);

/* Continues after an interruption without readings, for example after a restore. The filter's time
 * becomes t_ns, of any clock. The pose stays where it is, and its covariance grows by P_moved[36],
 * 6x6, of (rho, theta), m^2 and rad^2: how far the body may have moved meanwhile. NULL: it has not
 * moved. Landmarks stay, with their correlation with the pose. With an IMU velocity is then zero,
 * and known to start_velocity_sigma.
 * PLR_E_MODE P_moved in mapping, or no reading, frame or pose was ever accepted; PLR_E_NOT_FINITE;
 * PLR_E_RANGE; PLR_E_ARGUMENT P_moved not symmetric and positive. */
plr_status plr_filter_resume(plr_filter *f, plr_time_ns t_ns, const double *P_moved);

/* --- what happened --- */

/* The filter's health at t_ns, which need not be the time of a frame: call it whenever you use the
 * pose. To the reasons of the last frame it adds NO_FRAMES and NO_OBSERVATIONS when there was none
 * for a second, and NO_TWISTS when twists or IMU readings were refused or the last one is older
 * than three intervals between them plus 50 ms. A t_ns before plr_filter_time() counts as that
 * time.
 * PLR_E_DAMAGED, PLR_E_NOT_READY: `health` is filled too and says DIVERGED. */
plr_status plr_filter_health(const plr_filter *f, plr_time_ns t_ns, plr_health_state *health);

/* The calibration as it is estimated (setting calibrate), with sigmas; what is not estimated as init was
 * told. */
plr_status plr_filter_calibration(const plr_filter *f, plr_calibration_result *result);

/* What the supervisor saw in the last frame and decided on it, for a log or for a supervisor of the caller's
 * own. Call it before the next frame. PLR_E_NOT_READY before the first one. */
plr_status plr_filter_supervision(const plr_filter *f, plr_supervision *supervision);

/* For measurements: leaves out rules of the supervisor, bits 1 << plr_limit_id, until the next init. */
plr_status plr_filter_leave_out(plr_filter *f, uint64_t limits);

/* Copies the counts since init or reset. */
plr_status plr_filter_totals(const plr_filter *f, plr_totals *totals);

/* The settings that the filter was initialised with. */
const plr_config *plr_filter_config(const plr_filter *f);

/* A sentence about a status: what is wrong and how to correct it. Never NULL. */
const char *plr_status_text(plr_status status);

/* A phrase for one bit of plr_report.reasons, a health, or a fault of an IMU. Never NULL. */
const char *plr_reason_text(plr_reason reason);
const char *plr_health_text(plr_health health);
const char *plr_imu_fault_text(plr_imu_fault fault);

/* The version as text, "0.1.0", and a number that differs between builds whose bits may differ: it
 * contains version, arithmetic (PLR_ARITHMETIC), precision, capacity and block size. */
const char *plr_version(void);
uint32_t plr_build_fingerprint(void);

#ifdef __cplusplus
}
#endif

#endif
