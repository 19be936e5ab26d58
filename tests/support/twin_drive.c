// SPDX-License-Identifier: MIT
#include "support/twin_drive.h"

#include <math.h>

#include <unity.h>

#include "support/exact_camera.h"

twin_drive twins;

static int record_eviction(void *context, const plr_landmark *landmark) {
    (void)context;
    twins.evicted[twins.evictions++] = landmark->id;
    return 0;
}

void twin_drive_set_up(void) {
    plr_config_default(&twins.config);
    exact_camera(&twins.config);
    twins.config.slots = PLR_MAX_LANDMARKS < TWIN_MOST ? PLR_MAX_LANDMARKS : TWIN_MOST;
    twins.config.start_sigma = 0.01;
    twins.evictions = 0;
    scene_options_default(&twins.options);
}

void twin_drive_begin(bool (*source)(void *context, uint32_t id, plr_landmark *landmark)) {
    const plr_map map = {.sink = record_eviction, .source = source};
    scene_start(&twins.world, &twins.options);
    textbook_free(&twins.book);
    TEST_ASSERT_TRUE(textbook_init(&twins.book, &twins.world.calibration, &twins.config, TWIN_MOST,
                                   PLR_MAX_OBSERVATIONS));
    TEST_ASSERT_EQUAL_INT(
        PLR_OK, plr_filter_init(&twins.filter, &twins.world.calibration, &twins.config, &map));
}

void twin_drive_end(void) {
    textbook_free(&twins.book);
}

void twin_drive_step(plr_time_ns step_ns) {
    const plr_twist reading = scene_read(&twins.world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&twins.filter, twins.world.t_ns, &reading));
    scene_move(&twins.world, step_ns);
    textbook_hold(&twins.book, &reading, (double)step_ns * 1e-9, (double)step_ns * 1e-9);
}

void twin_drive_to_the_next_frame(void) {
    for (unsigned k = 0; k < TWIN_TWISTS; k++)
        twin_drive_step(TWIN_STEP_NS);
}

void twin_drive_evict(void) {
    for (unsigned i = 0; i < twins.evictions; i++)
        textbook_remove(&twins.book, textbook_find(&twins.book, twins.evicted[i]));
}

/* Of four parts of the image's width or height, which holds x. */
static unsigned quarter(double x, double centre) {
    const double part = ceil(2 * x / centre) - 1;
    return (unsigned)fmin(fmax(part, 0), 3);
}

unsigned twin_drive_create(const plr_frame *frame) {
    const plr_calibration *camera = &twins.world.calibration;
    const unsigned before = twins.book.count;
    double seen[16] = {0}, followed[16] = {0};
    unsigned cell[PLR_MAX_OBSERVATIONS];
    bool settled[PLR_MAX_OBSERVATIONS];
    for (unsigned i = 0; i < frame->count; i++) {
        const plr_observation *o = &frame->observations[i];
        const bool held = textbook_find(&twins.book, o->id) < before;
        cell[i] =
            4 * quarter((double)o->vL_px, camera->cy_px) + quarter((double)o->uL_px, camera->cx_px);
        settled[i] =
            held || !textbook_is_worth_a_landmark(&twins.book.config, &twins.book.camera, o);
        seen[cell[i]] += held || !settled[i];
        followed[cell[i]] += held;
    }
    while (twins.book.count < twins.config.slots) {
        unsigned next = frame->count;
        double largest = 0;
        for (unsigned i = 0; i < frame->count; i++) {
            const double quotient = seen[cell[i]] / (followed[cell[i]] + 1);
            if (settled[i] || quotient <= largest)
                continue;
            next = i;
            largest = quotient;
        }
        if (next == frame->count)
            break;
        settled[next] = true;
        followed[cell[next]]++;
        TEST_ASSERT_TRUE(textbook_create(&twins.book, twins.book.count, frame->t_ns,
                                         &frame->observations[next]));
    }
    return twins.book.count - before;
}
