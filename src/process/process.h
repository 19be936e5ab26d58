// SPDX-License-Identifier: MIT
/*
 * A process moves the state between frames by readings of six numbers, linear ones first. It lays
 * out the blocks that it needs, carries pose (and velocity) along with each reading, and
 * accumulates in plr_motion what a frame will apply to P: a reading costs the same for any number of
 * landmarks.
 */
#ifndef PLR_PROCESS_PROCESS_H
#define PLR_PROCESS_PROCESS_H

#include "pelorus/assertions.h"
#include "pelorus/belief.h"
#include "pelorus/settings.h"
#include "pelorus/source.h"
#include "state/rows.h"

enum { PLR_READING_DIM = PLR_POSE_DIM };

/* A reading that is held for more of the usual intervals than this is no mean any more. */
#define PLR_LONG_INTERVALS PLR_R(2.5)

/* A reading that moves the state for `seconds`. `mean` is that of the readings over the step, `whole` that over the
 * interval which the step ends: another one only where a frame cut that. The reading stands for `interval`
 * seconds, so that the parts of it add up to the noise of the whole. */
typedef struct plr_process_step {
    plr_real mean[PLR_READING_DIM], whole[PLR_READING_DIM];
    plr_real seconds, interval;
} plr_process_step;

typedef struct plr_process {
    /* Lays out the state's blocks: plr_lay_out. */
    void (*lay_out)(plr_belief *belief, const plr_config *config);

    /* PLR_OK if the reading may be held for `seconds`, else PLR_E_RANGE: plr_step_is_possible. */
    plr_status (*check)(const plr_belief *belief, const plr_source *source,
                        const plr_real reading[PLR_READING_DIM], plr_real seconds);

    /* One step to t_ns. Sets the time. */
    void (*step)(plr_belief *belief, plr_motion *motion, plr_source *source, plr_time_ns t_ns,
                 const plr_process_step *step);

    /* Fills `mean` and `whole` of the step that ends with `reading`: plr_mean_reading. Its `interval` is known. */
    void (*mean)(const plr_belief *belief, const plr_source *source, plr_time_ns t_ns,
                 const plr_real reading[PLR_READING_DIM], plr_process_step *step);

    /* The last reading, `age` seconds after its time, or what is assumed in its place. */
    void (*hold)(const plr_belief *belief, const plr_source *source, plr_real age,
                 plr_real held[PLR_READING_DIM]);

    /* The variances of the displacement, m^2 and rad^2, that the last reading misses between h0 and
     * h1 seconds after its time, as the motion changes; `next` ends it, NULL while there is none.
     * False: it misses nothing. NULL: `step` knows by its `interval`. */
    bool (*missed)(const plr_source *source, plr_real h0, plr_real h1, const plr_real *next,
                   plr_real variance[PLR_POSE_DIM]);

    /* The reading of a body that keeps its velocity: assumed while there is none. */
    void (*rest)(const plr_belief *belief, const plr_source *source,
                 plr_real reading[PLR_READING_DIM]);

    /* Velocity and biases of a motion that is applied or dropped: what it adds to their covariance
     * besides plr_covariance_carry_core. NULL: nothing, the motion's noise holds the walk already. */
    void (*walk)(plr_belief *belief, const plr_source *source, plr_real seconds);

    /* The variance that bias k gains in a second. */
    plr_real (*bias_walk)(const plr_source *source, unsigned k);

    /* The body's present twist (v, w) with its covariance, 6x6, which may be NULL. */
    void (*now)(const plr_belief *belief, const plr_motion *motion, const plr_source *source,
                plr_real u[PLR_POSE_DIM], plr_real P_u[PLR_POSE_SQUARE]);

    /* By how much v of that twist changes in a second. NULL: that is not known. */
    void (*changes)(const plr_belief *belief, const plr_source *source,
                    const plr_real u[PLR_POSE_DIM], plr_real change[3]);

    /* The covariance of the biases at the time of the estimate; zeros if not estimated. */
    void (*bias_covariance)(const plr_belief *belief, const plr_motion *motion,
                            const plr_source *source, plr_real P_b[PLR_POSE_SQUARE]);

    /* Turns a measurement of the body's twist into one of the state, r = H x + N(0, R). NULL: it is
     * held, and weighed against the readings of this process (process/velocity.h). */
    void (*measure)(const plr_belief *belief, const plr_source *source, const plr_twist_rows *rows,
                    plr_rows *H, plr_real r[PLR_ROWS], plr_real R[PLR_ROWS]);
} plr_process;

/* Lays out the pose, a velocity and biases of these sizes; all rows from `driver` on are drivers. */
void plr_lay_out(plr_belief *belief, uint8_t velocity, uint8_t bias, uint8_t driver);

/* False if a step of these squares, m^2 and rad^2, is longer than 1 km or pi rad; and for NaN. */
bool plr_step_is_possible(plr_real way2, plr_real turn2);

/* The mean reading of the interval that ends at t_ns with `reading`, by the timing (plr_twist_timing):
 * between two samples of a smooth signal its mean is that of both. Where a frame cut the interval, its
 * first part was bridged by the older reading. If `makes_up`, the mean of the rest is such that the
 * integral of the whole is right: of a short rest it is no rate of the body any more. Else frames or
 * other sensors have corrected meanwhile what the older reading did. */
void plr_mean_reading(const plr_belief *belief, const plr_source *source, uint8_t timing,
                      bool makes_up, plr_time_ns t_ns, const plr_real reading[PLR_READING_DIM],
                      plr_process_step *step);

extern const plr_process plr_process_twist;
extern const plr_process plr_process_imu;

/* False until an IMU is aligned with gravity; until then the state rests, but for mapping. */
static inline bool plr_process_has_started(const plr_source *source) {
    return source->process != PLR_PROCESS_IMU || source->inertial.phase >= PLR_IMU_UNSETTLED ||
           source->poses_are_given;
}

static inline const plr_process *plr_process_of(const plr_source *source) {
    return source->process == PLR_PROCESS_IMU ? &plr_process_imu : &plr_process_twist;
}

/* What so many seconds of a motion add to the biases' covariance besides its own noise. */
static inline void plr_process_walk(plr_belief *belief, const plr_source *source,
                                    plr_real seconds) {
    const plr_process *process = plr_process_of(source);
    if (process->walk)
        process->walk(belief, source, seconds);
}

/* The variance of bias k about its prior's mean, had nothing been learnt of it: it has walked. */
static inline plr_real plr_bias_prior_variance(const plr_source *source, unsigned k) {
    PLR_ASSERT(k < PLR_BIAS_DIM);
    const plr_real sigma = source->bias_prior_sigma[k], seconds = (plr_real)source->bias_walked_s;
    return sigma * sigma + seconds * plr_process_of(source)->bias_walk(source, k);
}

#endif
