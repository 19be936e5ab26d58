// SPDX-License-Identifier: MIT
/*
 * From two cameras and an IMU to the session: readings up to a pair's time, then the pair. The cameras' lenses and
 * where they stand come over the link (HEADER, RIG); before a HEADER nothing is handed over.
 */
#include <string.h>

#include "board.h"
#include "camera.h"
#include "clock.h"
#include "exposure.h"
#include "eyes.h"
#include "sensors.h"

/* Of each camera; a board's cmake line says PLR_VISION_PIXELS, which is no more than this. */
enum {
    WIDTH = 376,
    HEIGHT = 240,
    PIXELS = WIDTH * HEIGHT,
    STRIP_ROWS = 8,
    EXPOSURE_FIRST = 150, /* rows of 32 us: 4.8 ms */
    EXPOSURE_MOST = 315,  /* 10 ms */
    TRIES = 3,            /* at a start in step */
    PROBE = 16,           /* of each so many rows and columns one pixel tells the exposure */
    SETTLES = 2,          /* pictures that may still have the exposure before */
    REFUSALS = 5,         /* in a row, after which people are told of a camera */
    MISSES = 4, /* pairs that an exposure waits, as cameras do not rest when the loop asks */
    READINGS_AT_ONCE = READINGS
};

/* A pair is there so long after the middle of its exposure at the latest: half the longest exposure, and 20 ms to
 * read it out. Readings wait so long, for one that was given cannot be taken back before the pair. */
#define CAMERA_LATE_NS UINT64_C(30000000)
/* Within which some pattern must come: a picture does every 50 ms. */
#define PATTERN_NS UINT64_C(500000000)
/* After which a camera that did not take its exposure is told again: at first, and once people have been told. A bus
 * that hangs costs the pairs of an attempt. */
#define TELL_AGAIN_NS       UINT64_C(100000000)
#define TELL_AGAIN_LATER_NS UINT64_C(10000000000)

const uint32_t sensors_output = PLR_OUTPUT_ECHO;

static plr_eyes eyes __attribute__((section(".bss.eyes")));
static uint32_t first_pair[2][PIXELS / 4] __attribute__((section(".bss.pictures")));
static uint32_t second_pair[2][PIXELS / 4] __attribute__((section(".pictures2")));
static capture pairs;
static readings queue;
static bool started;

/* In rows. */
static struct {
    uint16_t rows[CAMERA_SIDES]; /* what each camera took last */
    uint16_t wanted;             /* of both, by the light */
    uint64_t since_ns;           /* pictures before it tell nothing of `rows` */
    unsigned settling;           /* pictures since then that may still have the exposure before */
    bool apart; /* one camera may be exposed otherwise than the other: the pair is left out */
    uint32_t left_out; /* such pairs, and those that a write needed; for a debugger */
    unsigned misses;   /* pairs in a row that were looked at while a write waited */
    uint32_t refusals; /* attempts in a row that a camera did not take */
    uint64_t again_ns; /* no attempt before it */
} exposure;

plr_eyes *firmware_eyes(void) {
    return plr_eyes_init(&eyes, NULL, NULL, 0) == PLR_OK ? &eyes : NULL;
}

static void clear_pairs(void) {
    memset(&pairs, 0, sizeof pairs);
    pairs.pairs[0].left = (uint8_t *)first_pair[0];
    pairs.pairs[0].right = (uint8_t *)first_pair[1];
    pairs.pairs[1].left = (uint8_t *)second_pair[0];
    pairs.pairs[1].right = (uint8_t *)second_pair[1];
    pairs.width = WIDTH;
    pairs.height = HEIGHT;
    pairs.rows = STRIP_ROWS;
}

static const capture_pair *next_pair_within(uint64_t ns) {
    const uint64_t start_ns = clock_ns();
    while (clock_ns() - start_ns < ns) {
        const capture_pair *pair = capture_take(&pairs);
        board_watchdog_feed();
        if (pair != NULL) {
            return pair;
        }
    }
    return NULL;
}

static bool is_even(const uint8_t *pixels) {
    return memcmp(pixels, pixels + 1, PIXELS - 1) == 0;
}

/* Both sensors send the same pattern: read out in step they give the same pixels. One clock out of step, and each
 * right picture would be shifted. */
static const char *check_in_step(void) {
    const char *trouble = NULL;
    for (unsigned i = 0; i < TRIES; ++i) {
        clear_pairs();
        trouble = camera_start(&pairs, true, EXPOSURE_FIRST);
        const capture_pair *pair = trouble == NULL ? next_pair_within(PATTERN_NS) : NULL;
        camera_stop();
        if (pair != NULL && !is_even(pair->left) && memcmp(pair->left, pair->right, PIXELS) == 0) {
            return NULL;
        }
        if (trouble == NULL && pair == NULL) {
            trouble = "no picture comes: look at trigger, clock and synchronisation pins";
        } else if (trouble == NULL) {
            trouble = is_even(pair->left) || is_even(pair->right)
                          ? "a camera's test pattern does not come: look at its data lines"
                          : "the two cameras are not read out in step: their test patterns differ";
        }
    }
    return trouble;
}

const char *sensors_start(void) {
    const char *trouble = moments_start();
    trouble = trouble != NULL ? trouble : check_in_step();
    if (trouble == NULL) {
        clear_pairs();
        trouble = imu_start(&queue);
    }
    if (trouble == NULL) {
        trouble = camera_start(&pairs, false, EXPOSURE_FIRST);
        memset(&exposure, 0, sizeof exposure);
        exposure.rows[CAMERA_LEFT] = exposure.rows[CAMERA_RIGHT] = EXPOSURE_FIRST;
        exposure.wanted = EXPOSURE_FIRST;
    }
    started = trouble == NULL;
    return trouble;
}

static void give_reading(plr_session *session, const reading *raw) {
    plr_imu imu;
    for (unsigned i = 0; i < 3; ++i) {
        imu.a_B_mps2[i] = raw->accel[i] * imu_accel_unit;
        imu.w_B_radps[i] = raw->gyro[i] * imu_gyro_unit;
    }
    (void)plr_session_inertial(session, (plr_time_ns)raw->t_ns, &imu);
}

static void give_readings(plr_session *session, uint64_t until_ns) {
    reading one;
    for (unsigned i = 0; i < READINGS_AT_ONCE && readings_take(&queue, until_ns, &one); ++i) {
        give_reading(session, &one);
    }
}

static plr_picture picture(const uint8_t *pixels, uint64_t t_ns) {
    return (plr_picture){.pixels = pixels,
                         .stride = WIDTH,
                         .width_px = WIDTH,
                         .height_px = HEIGHT,
                         .t_ns = (plr_time_ns)t_ns};
}

static uint32_t mean_grey(const uint8_t *pixels) {
    uint32_t sum = 0, count = 0;
    for (unsigned at = 0; at < PIXELS; at += PROBE * WIDTH) {
        for (unsigned x = 0; x < WIDTH; x += PROBE) {
            sum += pixels[at + x];
            ++count;
        }
    }
    return sum / count;
}

static bool alike(void) {
    return exposure.rows[CAMERA_LEFT] == exposure.rows[CAMERA_RIGHT];
}

/* What the light asks for; after a change not before pictures come that were exposed with it. */
static void follow_light(const capture_pair *pair) {
    if (!alike() || pair->t_ns < exposure.since_ns) {
        return;
    }
    if (exposure.settling > 0) {
        --exposure.settling;
        return;
    }
    exposure.apart = false;
    exposure.wanted =
        exposure_next(exposure.rows[CAMERA_LEFT], mean_grey(pair->left), EXPOSURE_MOST);
}

static bool takes(camera_side side, uint16_t rows) {
    const bool taken = camera_expose(side, rows);
    exposure.rows[side] = taken ? rows : exposure.rows[side];
    return taken;
}

/* What one camera does not take the other gives back, so that both go on with what that one has. Returns the camera
 * that did not take it, or CAMERA_SIDES. */
static camera_side tell_both(void) {
    camera_side deaf = CAMERA_SIDES;
    if (!takes(CAMERA_LEFT, exposure.wanted)) {
        deaf = CAMERA_LEFT;
    } else if (!takes(CAMERA_RIGHT, exposure.wanted)) {
        deaf = CAMERA_RIGHT;
    }
    if (deaf != CAMERA_SIDES) {
        exposure.wanted = exposure.rows[deaf];
        if (!alike()) {
            (void)takes(deaf == CAMERA_LEFT ? CAMERA_RIGHT : CAMERA_LEFT, exposure.wanted);
        }
    }
    return deaf;
}

/* Returns what people are told of it, once. */
static const char *count_refusals(camera_side deaf) {
    if (deaf == CAMERA_SIDES) {
        exposure.refusals = 0;
        return NULL;
    }
    ++exposure.refusals;
    exposure.again_ns =
        moments_now_ns() +
        (alike() && exposure.refusals >= REFUSALS ? TELL_AGAIN_LATER_NS : TELL_AGAIN_NS);
    if (exposure.refusals != REFUSALS) {
        return NULL;
    }
    return deaf == CAMERA_LEFT
               ? "the left camera takes no exposure: look at its two-wire bus; both keep the one "
                 "that they have, and pairs that are not exposed alike are left out"
               : "the right camera takes no exposure: look at its two-wire bus; both keep the one "
                 "that they have, and pairs that are not exposed alike are left out";
}

/* A camera that did not take the last one is told again even if the light asks for nothing: it may have taken what it
 * did not answer. */
static bool is_due(void) {
    return exposure.refusals > 0 ? moments_now_ns() >= exposure.again_ns
                                 : exposure.rows[CAMERA_LEFT] != exposure.wanted;
}

/* Between two pictures, so that both cameras have it from the same one on. */
static const char *expose(void) {
    if (!is_due() || !camera_rests()) {
        return NULL;
    }
    const uint32_t triggered = camera_triggered();
    const uint16_t left = exposure.rows[CAMERA_LEFT], right = exposure.rows[CAMERA_RIGHT];
    const camera_side deaf = tell_both();
    const bool between = camera_triggered() != triggered;
    exposure.apart = exposure.apart || between || !alike();
    if (between || exposure.rows[CAMERA_LEFT] != left || exposure.rows[CAMERA_RIGHT] != right) {
        exposure.since_ns = moments_now_ns();
        exposure.settling = SETTLES;
    }
    return count_refusals(deaf);
}

/* Looks that take two periods may leave the loop at the same moment of a picture each time, never in a rest. Whether
 * this pair is left out, so that the loop idles until the next one. */
static bool write_needs_time(void) {
    exposure.misses = is_due() ? exposure.misses + 1 : 0;
    if (exposure.misses <= MISSES) {
        return false;
    }
    exposure.misses = 0;
    return true;
}

static void look(plr_session *session, const capture_pair *there) {
    const plr_picture_pair pair = {picture(there->left, there->t_ns),
                                   picture(there->right, there->t_ns)};
    (void)plr_session_look(session, &pair);
}

const char *sensors_step(plr_session *session) {
    if (!started) {
        return NULL;
    }
    const uint64_t late_ns = moments_now_ns() - CAMERA_LATE_NS; /* before a pair is looked for */
    const capture_pair *there = capture_take(&pairs);
    give_readings(session, there != NULL ? there->t_ns : late_ns);
    if (there != NULL) {
        follow_light(there);
    }
    const bool apart = exposure.apart;
    const char *trouble = expose(); /* now, for a look takes long */
    if (there != NULL && (apart || write_needs_time())) {
        ++exposure.left_out;
    } else if (there != NULL) {
        look(session, there);
    }
    return trouble;
}
