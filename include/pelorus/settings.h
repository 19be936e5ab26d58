// SPDX-License-Identifier: MIT
/*
 * The settings of a filter, and the one table that names them. The replay's options, its config
 * files and the CONFIG frame all go through the table, so a setting has the same name, number,
 * limits and default everywhere.
 */
#ifndef PELORUS_SETTINGS_H
#define PELORUS_SETTINGS_H

#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum plr_model_kind {
    PLR_MODEL_BODY = 0, /* landmarks in the camera, polar, invariant: consistent; the default */
    PLR_MODEL_WORLD = 1 /* landmarks in the world, the course report's; float64 only in earnest */
} plr_model_kind;

typedef enum plr_mode {
    PLR_MODE_SLAM = 0,          /* pose and landmarks are estimated together */
    PLR_MODE_MAPPING = 1,       /* every frame's pose is given, exactly */
    PLR_MODE_LOCALIZATION = 2,  /* landmarks come from a map source alone */
    PLR_MODE_DEAD_RECKONING = 3 /* twists alone */
} plr_mode;

typedef enum plr_twist_timing {
    PLR_TWIST_START = 0, /* the reading at t_j holds on [t_j, t_j+1) */
    PLR_TWIST_END = 1,   /* the reading at t_j holds on (t_j-1, t_j] */
    PLR_TWIST_MID = 2    /* the mean of two successive readings holds between them */
} plr_twist_timing;

typedef enum plr_noise_kind {
    PLR_NOISE_TWIST = 0, /* velocity_sigma and gyro_sigma are those of one reading */
    PLR_NOISE_STEP = 1   /* they are the displacement's, in m and rad, for every step (III.8's W) */
} plr_noise_kind;

typedef enum plr_landmark_prior {
    PLR_PRIOR_CORRELATED = 0, /* a new landmark's error is the pose's too: what is true */
    PLR_PRIOR_INDEPENDENT = 1 /* it is landmark_sigma_m alone, the report's Sigma_m; `world` only */
} plr_landmark_prior;

/* Defaults and limits stand in the table of src/filter/settings.c, which plr_setting_at shows.
 *
 * min_disparity_px = 0: in `body`, without max_depth_m, a new landmark may have any disparity that noise
 * leaves of a point at infinity, some pixels below zero too. Above 0 it is a hard limit, and chooses
 * far landmarks by their noise: speed and biases then lean to one side. */
typedef struct plr_config {
    uint8_t model;          /* plr_model_kind */
    uint8_t mode;           /* plr_mode */
    uint8_t twist_timing;   /* plr_twist_timing */
    uint8_t noise;          /* plr_noise_kind */
    uint8_t bias;           /* 1: twist biases are estimated */
    uint8_t known_map;      /* 1: slam asks the map source too when it meets an unknown id */
    uint8_t landmark_prior; /* plr_landmark_prior; independent needs `world` and landmark_sigma_m */
    uint16_t slots;         /* landmarks in use, 1 to PLR_MAX_LANDMARKS */

    double pixel_sigma_px;          /* one coordinate of one pixel */
    double velocity_sigma[3];       /* m/s of one reading (m with noise = step), body x, y, z */
    double gyro_sigma[3];           /* rad/s of one reading (rad with noise = step), x, y, z */
    double bias_velocity_sigma_mps; /* prior */
    double bias_gyro_sigma_radps;   /* prior */
    double bias_velocity_walk;      /* (m/s)^2/s, variance added per second */
    double bias_gyro_walk;          /* (rad/s)^2/s */

    double gate_d2;          /* largest squared Mahalanobis distance (4 d.o.f.); 0: gate off */
    double gate_residual_px; /* the course's gate instead: largest norm of the four residuals;
                                0: not used */
    double min_disparity_px; /* of a new landmark; 0: see above */
    double max_depth_m;      /* of a new landmark; 0: no limit */
    double max_row_gap_px;   /* |vL - vR| of a new landmark; 0: no limit */
    double min_depth_m;      /* predicted depth below which an observation is rejected */
    double start_sigma;      /* m and rad: initial pose, where no covariance is given */
    double landmark_sigma_m; /* of a new landmark's position per axis; 0: from the pixels */
    double max_range_m;      /* no landmark stands further, whatever its inverse range */
    double max_gap_s;        /* a longer pause in the data is refused with PLR_E_GAP */
    double twist_delay_s;    /* the session holds twists back so long for a late camera */
} plr_config;

/* How a setting's value is written. */
typedef enum plr_setting_kind {
    PLR_SETTING_NUMBER,
    PLR_SETTING_COUNT,  /* a whole number */
    PLR_SETTING_SWITCH, /* off, on */
    PLR_SETTING_CHOICE  /* one of .choices */
} plr_setting_kind;

/* One row of the table. */
typedef struct plr_setting {
    uint8_t id;        /* number in a CONFIG frame; never reused */
    const char *name;  /* as in options and config files: "pixel-sigma" */
    const char *unit;  /* "px"; "" where there is none */
    const char *about; /* one line for a help text */
    plr_setting_kind kind;
    const char *const *choices;        /* words, ended by NULL, for SWITCH and CHOICE; else NULL */
    double minimum, maximum, standard; /* limits, both included, and the default */
} plr_setting;

/* Number of settings. */
unsigned plr_setting_count(void);

/* Row index of the table, 0 to plr_setting_count() - 1; NULL beyond. */
const plr_setting *plr_setting_at(unsigned index);

/* The row of that id or name; NULL if there is none. */
const plr_setting *plr_setting_by_id(uint8_t id);
const plr_setting *plr_setting_by_name(const char *name);

/* A setting may have three numbers, for the axes x, y and z of the body: velocity-sigma, gyro-sigma.
 * Its own row sets all three, and gets x; y and z have rows behind it that set one alone. The row of an
 * axis, 0 to 2; NULL for a setting of one number. */
const plr_setting *plr_setting_axis(const plr_setting *setting, unsigned axis);

/* For the row of a y or z axis: the setting that sets it too. NULL for all others. */
const plr_setting *plr_setting_of_axis(const plr_setting *setting);

/* The value of a setting as a number (switches 0 or 1, choices their number). */
double plr_config_get(const plr_config *config, const plr_setting *setting);

/* Sets a value. PLR_E_CONFIG, and nothing changed, if it is outside the limits or not finite. */
plr_status plr_config_set(plr_config *config, const plr_setting *setting, double value);

/* Every setting at its default. */
void plr_config_default(plr_config *config);

/* The course report's hyperparameters (III-F): world model, bias off, start timing, landmark
 * variance 2 m^2, uncorrelated with the pose, pose variance 5e-4, pixel variance 5 px^2, motion
 * variance 1e-3 a step, and a gate on the norm of the four residuals. The report leaves out far
 * landmarks and large residuals without naming a limit; 30 m and 20 px are ours. */
void plr_config_course(plr_config *config);

/* PLR_OK, or PLR_E_CONFIG with the offending row in *culprit (which may be NULL). Also refuses
 * combinations that make no sense; the row is then the one to change. */
plr_status plr_config_check(const plr_config *config, const plr_setting **culprit);

#ifdef __cplusplus
}
#endif

#endif
