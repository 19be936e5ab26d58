// SPDX-License-Identifier: MIT
/* The fuzz harness of the whole loop without libFuzzer: over tests/fuzz/corpus_session, and over
 * seeded changes to all of it. The harness aborts where something does not hold. */
#include <dirent.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "fuzz/fuzz_session.c"
#include "support/random.h"

#define CORPUS PELORUS_SOURCE_DIR "/tests/fuzz/corpus_session"

enum { INPUT_SIZE = 8192, CHANGES = 100 };

typedef struct input {
    uint8_t bytes[INPUT_SIZE];
    size_t size;
} input;

static rng dice;

static void read_input(const char *name, input *in) {
    char path[1024];
    const int n = snprintf(path, sizeof path, "%s/%s", CORPUS, name);
    TEST_ASSERT_TRUE(n > 0 && (size_t)n < sizeof path);
    FILE *file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    in->size = fread(in->bytes, 1, INPUT_SIZE, file);
    TEST_ASSERT_TRUE_MESSAGE(feof(file) || fgetc(file) == EOF, path); /* it fits */
    fclose(file);
}

/* From exactly as much memory as there are bytes. */
static void run(const input *in) {
    uint8_t *bytes = malloc(in->size ? in->size : 1);
    TEST_ASSERT_NOT_NULL(bytes);
    memcpy(bytes, in->bytes, in->size);
    TEST_ASSERT_EQUAL_INT(0, LLVMFuzzerTestOneInput(bytes, in->size));
    free(bytes);
}

/* A bit, a byte, or eight bytes that make some double or other; sizes and order stay. */
static void change(input *in) {
    const size_t at = rng_below(&dice, (unsigned)in->size);
    const size_t room = in->size - at;
    double number = rng_normal(&dice) * (rng_below(&dice, 2) ? 1e3 : 1e30);
    switch (rng_below(&dice, 4)) {
    case 0:
        in->bytes[at] = (uint8_t)(in->bytes[at] ^ 1U << rng_below(&dice, 8));
        break;
    case 1:
        in->bytes[at] = (uint8_t)rng_bits(&dice);
        break;
    case 2:
        number = (double)NAN;
        /* fall through */
    default:
        memcpy(in->bytes + at, &number, room < sizeof number ? room : sizeof number);
    }
}

static void test_the_corpus_holds_under_any_change(void) {
    static input seed, changed;
    unsigned files = 0;
    DIR *folder = opendir(CORPUS);
    TEST_ASSERT_NOT_NULL_MESSAGE(folder, CORPUS);
    for (struct dirent *entry; (entry = readdir(folder)) != NULL;) {
        if (entry->d_name[0] == '.')
            continue;
        read_input(entry->d_name, &seed);
        TEST_ASSERT_TRUE_MESSAGE(seed.size >= 2, entry->d_name);
        run(&seed);
        dice = rng_seeded(seed.size); /* whatever the order of the folder */
        for (unsigned i = 0; i < CHANGES; i++) {
            changed = seed;
            for (unsigned k = 1 + rng_below(&dice, 8); k > 0; k--)
                change(&changed);
            run(&changed);
        }
        files++;
    }
    closedir(folder);
    TEST_ASSERT_GREATER_THAN_UINT(9, files);
}

/* Were the seeds refused at their first frame, the test above would test nothing. */
static void test_the_first_seed_reaches_the_filter(void) {
    static input seed;
    static byte_stream in;
    static machine m;
    static plr_session session;
    plr_session_options options;
    const plr_port port = {.context = &m, .read = read_bytes};
    read_input("seed-slam", &seed);
    in.length = 0;
    append_records(&in, seed.bytes + 2, seed.size - 2);
    m.bytes = in.bytes;
    m.left = in.length;
    m.piece = 256;
    plr_session_options_default(&options);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&session, &port, &options));
    while (plr_session_step(&session) != PLR_STEP_CLOSED)
        continue;
    TEST_ASSERT_EQUAL_UINT32(7, session.totals.stereos);
    TEST_ASSERT_TRUE(session.last.used > 2);
}
