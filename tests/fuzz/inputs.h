// SPDX-License-Identifier: MIT
/* Inputs of a fuzz harness in a test: run as libFuzzer would, read from a corpus, and changed. The test
 * includes its harness before this. */
#ifndef PELORUS_TEST_FUZZ_INPUTS_H
#define PELORUS_TEST_FUZZ_INPUTS_H

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/random.h"

enum { INPUT_SIZE = 8192 };

typedef struct input {
    uint8_t bytes[INPUT_SIZE];
    size_t size;
} input;

static rng dice;

/* From exactly as much memory as there are bytes. */
static void run(const input *in) {
    uint8_t *bytes = malloc(in->size ? in->size : 1);
    TEST_ASSERT_NOT_NULL(bytes);
    memcpy(bytes, in->bytes, in->size);
    TEST_ASSERT_EQUAL_INT(0, LLVMFuzzerTestOneInput(bytes, in->size));
    free(bytes);
}

/* The input as it is, and so often changed in one to `most` places. */
static void run_with_changes(const input *seed, unsigned times, unsigned most,
                             void (*change)(input *)) {
    static input changed;
    run(seed);
    for (unsigned i = 0; i < times; i++) {
        changed = *seed;
        for (unsigned k = 1 + rng_below(&dice, most); k > 0; k--)
            change(&changed);
        run(&changed);
    }
}

static void read_input(const char *folder, const char *name, input *in) {
    char path[1024];
    const int n = snprintf(path, sizeof path, "%s/%s", folder, name);
    TEST_ASSERT_TRUE(n > 0 && (size_t)n < sizeof path);
    FILE *file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    in->size = fread(in->bytes, 1, INPUT_SIZE, file);
    TEST_ASSERT_TRUE_MESSAGE(feof(file) || fgetc(file) == EOF, path); /* it fits */
    fclose(file);
}

/* All of a folder, with its dice thrown anew for each; returns how many. */
static unsigned run_corpus(const char *folder, void (*check)(const input *)) {
    static input in;
    unsigned files = 0;
    DIR *entries = opendir(folder);
    TEST_ASSERT_NOT_NULL_MESSAGE(entries, folder);
    for (struct dirent *entry; (entry = readdir(entries)) != NULL;) {
        if (entry->d_name[0] == '.')
            continue;
        read_input(folder, entry->d_name, &in);
        dice = rng_seeded(in.size); /* whatever the order of the folder */
        check(&in);
        files++;
    }
    closedir(entries);
    return files;
}

#endif
