// SPDX-License-Identifier: MIT
/* The table of scenarios. Limits are those that the project holds itself to: docs/TESTING.md. */
#include "campaign/scenario.h"

#include <string.h>

enum { MINUTE = 60 * FRAME_HZ, HALF_MINUTE = 30 * FRAME_HZ };

/* What most scenarios have in common; a later initialiser overrides an earlier one. */
#define CAMERA .near_m = 3, .far_m = 25, .baseline_m = 0.2, .landmarks = 20
/* More points in sight than slots to hold them, some of them far away. */
#define CROWD .near_m = 3, .far_m = 60, .baseline_m = 0.2, .landmarks = 60, .slots = 20
#define ROOM                                                                                       \
    .room = true, .turn = 1, .near_m = 3, .baseline_m = 0.2, .twists_per_frame = 1,                \
    .before = 2 * MINUTE
#define STARRY                                                                                     \
    .speed_mps = 0.3, .near_m = 2, .far_m = 4, .pixel_px = 1, .velocity_mps = 0.043,               \
    .gyro_radps = 0.26
#define LOW     .pixel_px = 0.5, .velocity_mps = 0.02, .gyro_radps = 0.002
#define DEFAULT .pixel_px = 2, .velocity_mps = 0.1, .gyro_radps = 0.01 /* plr_config's own */
#define HIGH    .pixel_px = 3, .velocity_mps = 0.3, .gyro_radps = 0.05
#define DRIVE   .speed_mps = 1, .turn = 1, .twists_per_frame = 5, .before = MINUTE
#define PARKED  .twists_per_frame = 5, .before = MINUTE, .is_long = true

#define NOMINAL(nees_limit) .bars = {.nees = (nees_limit), .good = 0.995, .no_divergence = true}

/* What wrong matches look like in a few frames is what a scene that moves looks like. */
#define MATCHING(nees_limit, good_limit)                                                           \
    .bias = true, .bars = {.nees = (nees_limit), .good = (good_limit), .no_divergence = true}

/* Where at times fewer than three points are in sight, GOOD is not to be had; where that is so in a
 * third of the frames (20 points around), NEES is printed and not judged. */
#define ROOM_BARS(nees_limit) .bars = {.nees = (nees_limit), .no_divergence = true}

/* Half a minute in which something is wrong, between two half minutes in which all is as it should be. */
#define MISHAP(title, text, kind, how, speed)                                                      \
    .name = title, .about = text, DEFAULT, .speed_mps = speed, .turn = 1, .twists_per_frame = 5,   \
    .bias = true, .before = HALF_MINUTE, .during = HALF_MINUTE, .after = HALF_MINUTE,              \
    .mishap = kind, .strength = how
#define MISHAP_BARS .silent = 0.01, .event_nees = 2, .good = 0.995, .no_divergence = true

#define EVENT(title, text, kind, how, speed, told, error)                                          \
    {                                                                                              \
        MISHAP(title, text, kind, how, speed), CAMERA, .bars = {                                   \
            MISHAP_BARS,                                                                           \
            .told_frames = told,                                                                   \
            .error_m = error,                                                                      \
            .again_s = 10                                                                          \
        }                                                                                          \
    }

/* What stays wrong after the event: GOOD is not to be had again while it shows. */
#define LASTING(title, text, kind, how, speed, told)                                               \
    {                                                                                              \
        MISHAP(title, text, kind, how, speed), CAMERA, .bars = {                                   \
            MISHAP_BARS,                                                                           \
            .told_frames = told                                                                    \
        }                                                                                          \
    }

/* Among distant points, which say little about the way: pose errors are larger, and are to be told. */
#define FAR_EVENT(title, text, kind, how, speed)                                                   \
    {                                                                                              \
        MISHAP(title, text, kind, how, speed), .near_m = 30, .far_m = 100, .baseline_m = 0.2,      \
                                               .landmarks = 20, .bars = {                          \
                                                   MISHAP_BARS                                     \
                                               }                                                   \
    }

/* Five points in sight: often fewer than three are used, so neither GOOD frames nor a small error are
 * demanded. */
#define FEW_EVENT(title, text, kind, how, speed)                                                   \
    {                                                                                              \
        MISHAP(title, text, kind, how, speed), .near_m = 3, .far_m = 25, .baseline_m = 0.2,        \
                                               .landmarks = 5, .bars = {                           \
                                                   .silent = 0.01,                                 \
                                                   .event_nees = 2,                                \
                                                   .no_divergence = true                           \
                                               }                                                   \
    }

/* What no filter can follow, and good data after it. */
#define WAYOUT(title, text, kind, how, frames)                                                     \
    {                                                                                              \
        .name = title, .about = text, CAMERA, DEFAULT, .speed_mps = 1, .turn = 1,                  \
        .twists_per_frame = 5, .bias = true, .before = HALF_MINUTE, .during = frames,              \
        .after = HALF_MINUTE, .mishap = kind, .strength = how, .bars = {                           \
            .silent = 0.01,                                                                        \
            .told_frames = 5,                                                                      \
            .later_sigmas = 5,                                                                     \
            .later_width = 3,                                                                      \
            .again_s = 10,                                                                         \
            .good = 0.995,                                                                         \
            .no_divergence = true                                                                  \
        }                                                                                          \
    }

/* Wrong from the first frame on; what is told in the first second, when nothing is matched yet, does
 * not count. */
#define MISFIT(title, text, kind, how, most)                                                       \
    {                                                                                              \
        .name = title, .about = text, CAMERA, DEFAULT, .speed_mps = 1, .turn = 1,                  \
        .twists_per_frame = 5, .bias = true, .before = FRAME_HZ, .during = 3 * HALF_MINUTE,        \
        .mishap = kind, .strength = how, .bars = {                                                 \
            .silent = most,                                                                        \
            .no_divergence = true                                                                  \
        }                                                                                          \
    }

/* GCC and clang warn of the overriding that the macros above rest on; it is what C99 says. */
#pragma GCC diagnostic ignored "-Woverride-init"

/* clang-format off */
const scenario scenarios[] = {
    {"mc-low", "0.5 px, 0.02 m/s, 0.002 rad/s", CROWD, LOW, DRIVE, NOMINAL(1.05)},
    {"mc-high", "3 px, 0.3 m/s, 0.05 rad/s", CROWD, HIGH, DRIVE, NOMINAL(1.15)},
    {"mc-default", "2 px, 0.1 m/s, 0.01 rad/s", CROWD, DEFAULT, DRIVE, NOMINAL(1.15)},
    {"mc-default-bias", "mc-default with biases", CROWD, DEFAULT, DRIVE, .bias = true, NOMINAL(1.15)},
    {"mc-high-bias", "mc-high with biases", CROWD, HIGH, DRIVE, .bias = true, NOMINAL(1.25)},
    {"plain-low", "mc-low with 20 points and a slot for each", CAMERA, LOW, DRIVE, NOMINAL(1.05)},
    {"plain-high", "mc-high with the same", CAMERA, HIGH, DRIVE, NOMINAL(1.15)},
    {"plain-default-bias", "mc-default-bias with the same", CAMERA, DEFAULT, DRIVE, .bias = true, NOMINAL(1.15)},
    {"plain-high-bias", "mc-high-bias with the same", CAMERA, HIGH, DRIVE, .bias = true, NOMINAL(1.25)},
    {"isotropic", "turning on the spot, gyro 0.5 rad/s beside 0.3 px, 100 points around", ROOM, .far_m = 25, .landmarks = 100,
     .pixel_px = 0.3, .velocity_mps = 0.1, .gyro_radps = 0.5, ROOM_BARS(1.2)},
    {"isotropic-20", "the same, 20 points around", ROOM, .far_m = 25, .landmarks = 20,
     .pixel_px = 0.3, .velocity_mps = 0.1, .gyro_radps = 0.5, ROOM_BARS(0)},
    {"isotropic-5", "the same, gyro 0.1 rad/s, 5 points around", ROOM, .far_m = 25, .landmarks = 5,
     .pixel_px = 0.3, .velocity_mps = 0.05, .gyro_radps = 0.1, ROOM_BARS(1.5)},
    {"creeping", "gyro 0.5 rad/s beside 0.3 px, hardly moving, 20 points ahead", CAMERA, DRIVE, .speed_mps = 0.05, .turn = 0.2,
     .twists_per_frame = 1, .pixel_px = 0.3, .velocity_mps = 0.1, .gyro_radps = 0.5, ROOM_BARS(1.2)},
    {"starry-20", "circling in a room, 0.26 rad/s, 0.043 m/s, 1 px, 20 points around", ROOM, STARRY, .landmarks = 20, ROOM_BARS(0)},
    {"starry-40", "the same, 40 points around", ROOM, STARRY, .landmarks = 40, ROOM_BARS(1.5)},
    {"starry-100", "the same, 100 points around", ROOM, STARRY, .landmarks = 100, ROOM_BARS(1.5)},
    {"fast", "15 m/s with biases", CROWD, DEFAULT, DRIVE, .speed_mps = 15, .bias = true,
     .bars = {.nees = 1.25, .forward_bias = 1, .good = 0.995, .no_divergence = true}},
    {"short-baseline", "5 cm baseline with biases", CROWD, DEFAULT, DRIVE, .baseline_m = 0.05, .bias = true,
     .bars = {.nees = 1.5, .forward_bias = 1, .good = 0.995, .no_divergence = true}},
    {"far", "points at 50 to 400 m with biases", CROWD, DEFAULT, DRIVE, .near_m = 50, .far_m = 400, .bias = true,
     .bars = {.sigmas = 5, .forward_bias = 1, .good = 0.995, .no_divergence = true}},
    {"far-all", "the same, 20 points and a slot for each", CAMERA, DEFAULT, DRIVE, .near_m = 50, .far_m = 400, .bias = true,
     .bars = {.sigmas = 5, .forward_bias = 1, .good = 0.995, .no_divergence = true}},
    {"wrong-10", "10 % of the matches are wrong, each for a frame", CAMERA, DEFAULT, DRIVE, .wrong_matches = 0.1, MATCHING(1.25, 0.99)},
    {"wrong-20", "20 % of them", CAMERA, DEFAULT, DRIVE, .wrong_matches = 0.2, MATCHING(1.25, 0.99)},
    {"wrong-30", "30 % of them", CAMERA, DEFAULT, DRIVE, .wrong_matches = 0.3, MATCHING(1.5, 0.97)},
    {"lost-0.3", "of the tracks 0.3 % go over to another point in each frame, and stay there", CAMERA, DEFAULT, DRIVE,
     .lost_tracks = 0.003, MATCHING(1.25, 0.99)},
    {"lost-1", "the same, 1 %", CAMERA, DEFAULT, DRIVE, .lost_tracks = 0.01, MATCHING(1.25, 0.99)},
    {"drift-1", "tracks wander by 1 px in a second, and the filter is told of it", CAMERA, DEFAULT, DRIVE, .track_drift = 1, .told_drift = 1,
     MATCHING(1.15, 0.995)},
    {"drift-1-half-told", "the same, and it is told of half of that", CAMERA, DEFAULT, DRIVE, .track_drift = 1, .told_drift = 0.5,
     MATCHING(1.5, 0.99)},
    {"parked", "standing still", CAMERA, DEFAULT, PARKED, .bars = {.sigmas = 6, .no_divergence = true}},
    {"parked-bias", "standing still with biases", CAMERA, DEFAULT, PARKED, .bias = true,
     .bars = {.sigmas = 6, .no_divergence = true}},
    {"alternate", "0, 1, 2 matches in turn; gyro 0.26 rad/s, 0.3 m/s, 1 px", CAMERA, DRIVE, .few = true,
     .twists_per_frame = 1, .pixel_px = 1, .velocity_mps = 0.3, .gyro_radps = 0.26,
     .bars = {.nees = 1.5, .no_divergence = true}},

    EVENT("slip-0.25", "readings x 0.25", SLIP, 0.25, 0.8, 5, 0.5),
    EVENT("slip-0.5", "readings x 0.5", SLIP, 0.5, 0.8, 5, 0.5),
    EVENT("slip-0.75", "readings x 0.75", SLIP, 0.75, 0.8, 0, 0.5),
    EVENT("slip-2", "readings x 2", SLIP, 2, 0.8, 5, 0.5),
    FAR_EVENT("slip-0.5-far", "readings x 0.5 among points at 30 to 100 m", SLIP, 0.5, 0.8),
    FAR_EVENT("slip-0.75-far", "readings x 0.75 among the same", SLIP, 0.75, 0.8),
    FAR_EVENT("slip-1.5-far", "readings x 1.5 among the same", SLIP, 1.5, 0.8),
    FAR_EVENT("dead-wheels-far", "the velocity reads 0 among the same, 1 m/s", DEAD_WHEELS, 0, 1),
    EVENT("slip-1.05-3mps", "readings x 1.05, 3 m/s", SLIP, 1.05, 3, 0, 0),
    FAR_EVENT("slip-1.05-3mps-far", "the same among points at 30 to 100 m", SLIP, 1.05, 3),
    EVENT("dead-wheels", "the velocity reads 0, 2 m/s", DEAD_WHEELS, 0, 2, 5, 1),
    EVENT("dead-wheels-slow", "the velocity reads 0, 1 m/s", DEAD_WHEELS, 0, 1, 5, 1),
    EVENT("dead-wheels-fast", "the velocity reads 0, 4 m/s", DEAD_WHEELS, 0, 4, 5, 2),
    EVENT("dead-twists", "all readings are 0, 2 m/s", DEAD_TWISTS, 0, 2, 5, 1),
    EVENT("dead-twists-slow", "all readings are 0, 1 m/s", DEAD_TWISTS, 0, 1, 5, 1),
    EVENT("dead-twists-fast", "all readings are 0, 4 m/s", DEAD_TWISTS, 0, 4, 5, 2),
    EVENT("dead-gyro", "the rate reads 0, 1 m/s", DEAD_GYRO, 0, 1, 0, 0),
    EVENT("gyro-0.5", "the rate is half of the true one", GYRO_SCALE, 0.5, 1, 0, 0),
    EVENT("gyro-2", "the rate is twice the true one", GYRO_SCALE, 2, 1, 0, 0),
    FEW_EVENT("slip-0.5-few", "readings x 0.5, five points in sight", SLIP, 0.5, 0.8),
    FEW_EVENT("slip-2-few", "readings x 2, five points in sight", SLIP, 2, 0.8),
    FEW_EVENT("dead-wheels-few", "the velocity reads 0, 1 m/s, five points in sight", DEAD_WHEELS, 0, 1),
    FEW_EVENT("dead-gyro-few", "the rate reads 0, 1 m/s, five points in sight", DEAD_GYRO, 0, 1),
    FEW_EVENT("gyro-2-few", "the rate is twice the true one, five points in sight", GYRO_SCALE, 2, 1),
    EVENT("frozen-0.1", "the same picture again and again, at 0.1 m/s", FROZEN, 1, 0.1, 5, 0),
    EVENT("frozen-0.2", "the same, at 0.2 m/s", FROZEN, 1, 0.2, 5, 0),
    EVENT("frozen-0.4", "the same, at 0.4 m/s", FROZEN, 1, 0.4, 5, 0),
    EVENT("jump-body-0.5", "the body is set aside by 0.5 m", JUMP_BODY, 0.5, 1, 5, 0),
    EVENT("jump-body-1", "the body is set aside by 1 m", JUMP_BODY, 1, 1, 5, 0),
    EVENT("jump-body-2", "the body is set aside by 2 m", JUMP_BODY, 2, 1, 5, 0),
    {MISHAP("jump-body-1-lost", "set aside by 1 m, and of the tracks 1 % go over to another point in each frame", JUMP_BODY, 1, 1), CAMERA,
     .lost_tracks = 0.01, .bars = {MISHAP_BARS, .good = 0.98, .told_frames = 5, .again_s = 10}},
    {MISHAP("jump-body-2-wrong", "set aside by 2 m, and 20 % of the matches are wrong", JUMP_BODY, 2, 1), CAMERA,
     .wrong_matches = 0.2, .bars = {MISHAP_BARS, .good = 0.98, .told_frames = 5, .again_s = 10}},
    EVENT("camera-back-0.5", "the camera is knocked aside by 0.5 m, and put back", CAMERA_BACK, 0.5, 1, 5, 0),
    EVENT("camera-back-1", "the camera is knocked aside by 1 m, and put back", CAMERA_BACK, 1, 1, 5, 0),
    EVENT("camera-back-2", "the camera is knocked aside by 2 m, and put back", CAMERA_BACK, 2, 1, 5, 0),
    EVENT("camera-turn-0.05", "the camera is turned by 0.05 rad, and put back", TURN_CAMERA, 0.05, 1, 5, 0),
    EVENT("camera-turn-0.2", "the camera is turned by 0.2 rad, and put back", TURN_CAMERA, 0.2, 1, 5, 0),
    LASTING("jump-camera-0.5", "the camera is knocked aside by 0.5 m, for good", JUMP_CAMERA, 0.5, 1, 5),
    LASTING("jump-camera-1", "the camera is knocked aside by 1 m, for good", JUMP_CAMERA, 1, 1, 5),
    LASTING("jump-camera-2", "the camera is knocked aside by 2 m, for good", JUMP_CAMERA, 2, 1, 5),
    EVENT("scene-0.15", "all points move sideways at 0.15 m/s", SCENE_MOVES, 0.15, 1, 0, 0),
    EVENT("scene-0.3", "all points move sideways at 0.3 m/s", SCENE_MOVES, 0.3, 1, 5, 0),
    EVENT("scene-0.6", "all points move sideways at 0.6 m/s", SCENE_MOVES, 0.6, 1, 5, 0),
    EVENT("convoy-15", "15 % of the points move along at 0.8 of the speed", CONVOY, 0.15, 1, 0, 0),
    EVENT("convoy-30", "30 % of the points move along at 0.8 of the speed", CONVOY, 0.3, 1, 0, 0),
    EVENT("convoy-60", "60 % of the points move along at 0.8 of the speed", CONVOY, 0.6, 1, 5, 0),
    EVENT("late-2.5ms", "readings come after the frame, stamped 2.5 ms back", LATE_TWISTS, 0.0025, 1, 0, 0),
    {.name = "late-5ms-10Hz", .about = "the same with 10 readings a second: none comes in time", CAMERA, DEFAULT, .speed_mps = 3,
     .turn = 1, .twists_per_frame = 1, .bias = true, .before = HALF_MINUTE, .during = HALF_MINUTE, .after = HALF_MINUTE,
     .mishap = LATE_TWISTS, .strength = 0.005, .bars = {.silent = 0.01, .told_frames = 5, .again_s = 10, .no_divergence = true}},
    EVENT("late-5ms", "readings come after the frame, stamped 5 ms back", LATE_TWISTS, 0.005, 1, 0, 0),
    EVENT("late-10ms", "readings come after the frame, stamped 10 ms back", LATE_TWISTS, 0.01, 1, 0, 0),
    MISFIT("baseline-1", "the baseline is 1 % longer than the filter thinks", BASELINE, 0.01, 0.01),
    MISFIT("baseline-2", "the baseline is 2 % longer than the filter thinks", BASELINE, 0.02, 0.01),
    MISFIT("baseline-4", "the baseline is 4 % longer than the filter thinks", BASELINE, 0.04, 0.01),
    MISFIT("focal-0.5", "the focal length is 0.5 % longer than the filter thinks", FOCAL, 0.005, 0.01),
    MISFIT("focal-1", "the focal length is 1 % longer than the filter thinks", FOCAL, 0.01, 0.01),
    MISFIT("focal-2", "the focal length is 2 % longer than the filter thinks", FOCAL, 0.02, 0.01),
    MISFIT("askew-0.2", "the camera is turned by 0.2 degrees beside its T_CB", ASKEW, 0.2, 0.01),
    MISFIT("askew-0.5", "the camera is turned by 0.5 degrees", ASKEW, 0.5, 0.01),
    MISFIT("askew-1", "the camera is turned by 1 degree", ASKEW, 1, 0),
    WAYOUT("wayout-swapped", "every id stands for another point from one frame to the next", SWAPPED, 1, 1),
    WAYOUT("wayout-thrown-half", "the body is thrown by 2.5 m and 0.5 rad", THROWN, 0.5, 1),
    WAYOUT("wayout-thrown", "the body is thrown by 5 m and 1 rad", THROWN, 1, 1),
    WAYOUT("wayout-blind-half", "no points and garbage readings for 2.5 s", BLIND, 1, 25),
    WAYOUT("wayout-blind", "no points and garbage readings for 5 s", BLIND, 1, 50),
    WAYOUT("wayout-blind-double", "no points and garbage readings for 10 s", BLIND, 1, 100),
};
/* clang-format on */
const unsigned scenario_count = sizeof scenarios / sizeof scenarios[0];
