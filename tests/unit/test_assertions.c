// SPDX-License-Identifier: MIT
/* The tests run a library that checks its own assumptions: each of these breaks one. */
#include <string.h>
#include <unity.h>

#include "math/dense.h"
#include "math/small.h"
#include "record/bytes.h"
#include "record/cobs.h"
#include "sensor/stereo.h"
#include "support/assertions.h"

enum { N = PLR_TILE_COLUMNS };

static plr_real numbers[4 * N + PLR_KERNEL_MARGIN];
static plr_real *const rows[4] = {numbers, numbers + N, numbers + 2 * N, numbers + 3 * N};

void setUp(void) {
    memset(numbers, 0, sizeof numbers);
}

static void subtract(unsigned n, unsigned depth) {
    static const plr_real A[8], V[2 * N];
    plr_subtract_four_rows(n, depth, A, 4, V, N, rows);
}

static void subtract_as_agreed(void) {
    subtract(N, 2);
}

static void subtract_a_single_row(void) {
    subtract(N, 1);
}

static void subtract_part_of_a_tile(void) {
    subtract(N + 1, 2);
}

static void multiply_in_place(void) {
    plr_real A[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    plr_mat3_mul(A, A, A);
}

static void project_a_point_beside_the_camera(void) {
    const plr_camera camera = {.fx = 1, .fy = 1, .baseline = 1};
    const plr_real q[3] = {1, 1, 0};
    plr_real z[3];
    plr_stereo_project(z, &camera, q);
}

static void read_nine_bytes(void) {
    static const uint8_t bytes[9];
    (void)plr_bytes_get(bytes, sizeof bytes);
}

static void encode_behind_a_full_block(void) {
    plr_cobs_encoder encoder = {.fill = 255};
    (void)plr_cobs_encode(&encoder, 1);
}

static void test_a_call_as_agreed_passes(void) {
    TEST_ASSERT_FALSE(assertion_fails_in(subtract_as_agreed));
}

static void test_a_broken_assumption_is_found(void) {
    TEST_ASSERT_TRUE(assertion_fails_in(subtract_a_single_row));
    TEST_ASSERT_TRUE(assertion_fails_in(subtract_part_of_a_tile));
    TEST_ASSERT_TRUE(assertion_fails_in(multiply_in_place));
    TEST_ASSERT_TRUE(assertion_fails_in(project_a_point_beside_the_camera));
    TEST_ASSERT_TRUE(assertion_fails_in(read_nine_bytes));
    TEST_ASSERT_TRUE(assertion_fails_in(encode_behind_a_full_block));
}
