// SPDX-License-Identifier: MIT
/*
 * Counts what the filter costs: replays a recording that is part of the image, and writes a line of
 * text for each size, and for each predict, reading of an IMU and update the core clocks that it took. Under QEMU's
 * `-icount shift=0` an instruction takes a nanosecond, so clocks are instructions divided by a known
 * number, and repeat to the clock: nothing comes in over the link, and no interrupt is on.
 */
#include "board.h"
#include "clock.h"
#include "core.h"
#include "pelorus/pelorus.h"
#include "pelorus/session.h"
#include "pelorus/wire.h"
#include "serial.h"
#include "startup.h"
#include "text.h"

/* From bench_recording.S. */
extern const uint8_t bench_recording[], bench_recording_end[];

static plr_filter filter;
static plr_reader reader;
static plr_message message;
static uint8_t body[PLR_WIRE_STEREO_BODY(PLR_MAX_OBSERVATIONS) + PLR_WIRE_MIN_BUFFER];
static plr_observation observations[PLR_MAX_OBSERVATIONS];
static plr_report report;
static text line;

static void begin(const plr_header *header) {
    plr_config config;
    plr_config_default(&config);
    config.bias = 1;
    config.slots = PLR_MAX_LANDMARKS;
    config.twist_timing = header->twist_timing;
    config.process = header->process;
    if (header->process == PLR_PROCESS_IMU) {
        config.gyro_noise = header->gyro_noise;
        config.accel_noise = header->accel_noise;
        config.gyro_walk = header->gyro_walk;
        config.accel_walk = header->accel_walk;
        config.gravity_mps2 = header->gravity_mps2;
    }
    config.calibrate = BENCH_CALIBRATE;
    config.camera_clock_sigma_s = (BENCH_CALIBRATE & PLR_CALIBRATE_CLOCK) != 0 ? 0.005 : 0.0;
    text_add_field(&line, "process", header->process);
    text_put_line(&line);
    if (plr_filter_init(&filter, &header->calibration, &config, NULL) != PLR_OK) {
        text_add(&line, "error: the filter refuses the recording's HEADER");
        text_put_line(&line);
    }
}

/* An IMU starts from the pose and the velocity that are given: no frame is lost to the alignment. */
static void start(const plr_start *given) {
    double P_xi[36];
    plr_status status = PLR_OK;
    if (plr_filter_config(&filter)->process != PLR_PROCESS_IMU) {
        return;
    }
    for (unsigned i = 0, k = 0; i < 6; i++) {
        for (unsigned j = 0; j <= i; j++, k++) {
            P_xi[6 * i + j] = P_xi[6 * j + i] = given->P_xi[k];
        }
    }
    status = plr_filter_set_pose(&filter, given->t_ns, &given->T_WB, P_xi);
    if (status == PLR_OK) {
        status = plr_filter_set_velocity(&filter, given->velocity, given->velocity_variance);
    }
    if (status != PLR_OK) {
        text_add(&line, "error: the filter refuses the recording's START");
        text_put_line(&line);
    }
}

/* The counter runs down, in 24 bits. */
static uint32_t clocks_since(uint32_t start) {
    return (start - SYST_CVR) & SYST_MAX;
}

static void time_predict(const plr_twist_message *twist) {
    const uint32_t start = SYST_CVR;
    const plr_status status = plr_filter_predict(&filter, twist->t_ns, &twist->twist);
    const uint32_t clocks = clocks_since(start);
    if (status == PLR_OK) {
        text_add_field(&line, "predict", clocks);
        text_put_line(&line);
    }
}

static void time_readings(const plr_imu_message *imu) {
    for (unsigned i = 0; i < imu->count; i++) {
        const plr_time_ns t_ns = imu->t_ns + (plr_time_ns)i * imu->period_ns;
        const uint32_t start = SYST_CVR;
        const plr_status status = plr_filter_inertial(&filter, t_ns, &imu->readings[i]);
        const uint32_t clocks = clocks_since(start);
        if (status == PLR_OK) {
            text_add_field(&line, "reading", clocks);
            text_put_line(&line);
        }
    }
}

static void time_update(const plr_frame *frame) {
    const uint32_t start = SYST_CVR;
    const plr_status status = plr_filter_update(&filter, frame, &report);
    const uint32_t clocks = clocks_since(start);
    if (status == PLR_OK) {
        text_add_field(&line, "update", clocks);
        text_add_field(&line, "observations", report.observations);
        text_add_field(&line, "matched", report.matched);
        text_add_field(&line, "used", report.used);
        text_add_field(&line, "created", report.created);
        text_add_field(&line, "evicted", report.evicted);
        text_add_field(&line, "active", report.active);
        text_put_line(&line);
    }
}

static void take(void) {
    switch (message.kind) {
    case PLR_KIND_HEADER:
        begin(&message.as.header);
        break;
    case PLR_KIND_START:
        start(&message.as.start);
        break;
    case PLR_KIND_TWIST:
        time_predict(&message.as.twist);
        break;
    case PLR_KIND_IMU:
        time_readings(&message.as.imu);
        break;
    case PLR_KIND_STEREO:
        time_update(&message.as.stereo);
        break;
    default:
        break; /* TRUTH, END: of no interest here */
    }
}

static void replay(void) {
    const uint8_t *at = bench_recording;
    (void)plr_reader_init(&reader, body, sizeof body, observations, PLR_MAX_OBSERVATIONS);
    while (at < bench_recording_end) {
        size_t taken = 0;
        const plr_read_event event =
            plr_reader_feed(&reader, at, (size_t)(bench_recording_end - at), &taken, &message);
        at += taken;
        board_watchdog_feed();
        if (event == PLR_READ_MESSAGE) {
            take();
        }
    }
}

static void put_sizes(void) {
    text_add_field(&line, "size filter", sizeof(plr_filter));
    text_add_field(&line, "session", sizeof(plr_session));
    text_add_field(&line, "hz", board_core_hz());
    text_put_line(&line);
}

int main(void) {
    board_init();
    SYST_RVR = SYST_MAX;
    SYST_CVR = 0;
    SYST_CSR = SYST_CSR_ENABLE | SYST_CSR_CORE_CLOCK; /* counts, and does not interrupt */
    put_sizes();
    replay();
    text_add_field(&line, "done stack", stack_used());
    text_put_line(&line);
    for (;;) {
        board_watchdog_feed();
    }
}
