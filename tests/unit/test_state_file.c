// SPDX-License-Identifier: MIT
/* When a file of saved states asks for what was written to be on the disk, and what it makes of a
 * disk that fails. The rest of it: tests/python/test_replay_state.py. */
#include <errno.h>
#include <stdlib.h>
#include <unistd.h>
#include <unity.h>

static int model_fsync(int fd);

#define fsync model_fsync
#include "../../port/posix/system_posix.c" /* first: it calls fsync */

#include "../../port/posix/state_file.c"
#include "posix/state_file.h"

static char path[] = "/tmp/pelorus-state-XXXXXX";
static state_file file;
static plr_block_device *device;
static unsigned fsyncs, folder_fsyncs;
static int fsync_fails_with; /* errno; 0: it does not */

static int model_fsync(int fd) {
    struct stat about;
    TEST_ASSERT_EQUAL_INT(0, fstat(fd, &about));
    if (S_ISDIR(about.st_mode)) {
        folder_fsyncs++;
    } else {
        TEST_ASSERT_EQUAL_INT(file.fd, fd);
        fsyncs++;
    }
    errno = fsync_fails_with;
    return fsync_fails_with == 0 ? 0 : -1;
}

void setUp(void) {
    char problem[PROBLEM_SIZE];
    strcpy(path + sizeof path - 7, "XXXXXX");
    const int fd = mkstemp(path);
    TEST_ASSERT_NOT_EQUAL_INT(-1, fd);
    close(fd);
    fsyncs = folder_fsyncs = 0;
    fsync_fails_with = 0;
    TEST_ASSERT_TRUE(state_file_open_to_save(&file, path, BLOCK, problem));
    device = &file.device;
}

void tearDown(void) {
    state_file_close(&file);
    unlink(path);
}

static void test_the_name_of_a_new_file_is_on_the_disk_too(void) {
    char problem[PROBLEM_SIZE];
    TEST_ASSERT_EQUAL_UINT(1, folder_fsyncs);
    state_file_close(&file);
    TEST_ASSERT_TRUE(state_file_open_to_save(&file, path, BLOCK, problem)); /* it is not new */
    TEST_ASSERT_EQUAL_UINT(1, folder_fsyncs);
    state_file_close(&file);
    TEST_ASSERT_EQUAL_INT(0, truncate(path, 0));
    fsync_fails_with = EINVAL; /* no folder of this file system can be asked */
    TEST_ASSERT_TRUE(state_file_open_to_save(&file, path, BLOCK, problem));
    state_file_close(&file);
    TEST_ASSERT_EQUAL_INT(0, truncate(path, 0));
    fsync_fails_with = EIO;
    TEST_ASSERT_FALSE(state_file_open_to_save(&file, path, BLOCK, problem));
    TEST_ASSERT_NOT_NULL(strstr(problem, "give a path that can be written"));
}

static int writes(uint32_t offset) {
    return device->program(device->context, offset, (const uint8_t *)"abcd", 4);
}

static int reads(uint32_t offset) {
    uint8_t bytes[4];
    return device->read(device->context, offset, bytes, sizeof bytes);
}

static void test_what_was_written_or_erased_is_on_the_disk_before_it_is_read_back(void) {
    TEST_ASSERT_EQUAL_INT(0, reads(0));
    TEST_ASSERT_EQUAL_UINT(0, fsyncs);
    TEST_ASSERT_EQUAL_INT(0, writes(8));
    TEST_ASSERT_EQUAL_INT(0, writes(16));
    TEST_ASSERT_EQUAL_UINT(0, fsyncs);
    TEST_ASSERT_EQUAL_INT(0, reads(8));
    TEST_ASSERT_EQUAL_INT(0, reads(16));
    TEST_ASSERT_EQUAL_UINT(1, fsyncs);
    TEST_ASSERT_EQUAL_INT(0, device->erase(device->context, BLOCK, BLOCK));
    TEST_ASSERT_EQUAL_INT(0, reads(0));
    TEST_ASSERT_EQUAL_UINT(2, fsyncs);
}

static void test_a_disk_that_has_failed_once_is_not_believed_the_second_time(void) {
    TEST_ASSERT_EQUAL_INT(0, writes(0));
    fsync_fails_with = ENOSPC;
    TEST_ASSERT_EQUAL_INT(-1, reads(0));
    fsync_fails_with = 0; /* as a system says that has thrown away what it could not write */
    TEST_ASSERT_EQUAL_INT(-1, reads(0));
    TEST_ASSERT_EQUAL_INT(0, writes(0));
    TEST_ASSERT_EQUAL_INT(-1, reads(0));
    TEST_ASSERT_EQUAL_UINT(1, fsyncs);
    TEST_ASSERT_EQUAL_INT(0, close(file.fd));
    TEST_ASSERT_EQUAL_INT(-1, writes(0));
    TEST_ASSERT_EQUAL_INT(ENOSPC, file.error); /* the first failure is the one to tell */
    file.fd = -1;
}

static void test_a_slot_has_room_for_what_was_asked_in_whole_blocks(void) {
    char problem[PROBLEM_SIZE];
    TEST_ASSERT_EQUAL_UINT32(2 * BLOCK, device->size);
    state_file_close(&file);
    TEST_ASSERT_EQUAL_INT(0, truncate(path, 0));
    TEST_ASSERT_TRUE(state_file_open_to_save(&file, path, BLOCK + 1, problem));
    TEST_ASSERT_EQUAL_UINT32(4 * BLOCK, device->size);
}

static void test_no_file_reads_as_blank_and_takes_nothing(void) {
    uint8_t bytes[4] = {1, 2, 3, 4};
    state_file_close(&file);
    state_file_none(&file);
    TEST_ASSERT_EQUAL_INT(0, device->read(device->context, 0, bytes, 4));
    TEST_ASSERT_EACH_EQUAL_UINT8(0, bytes, 4);
    TEST_ASSERT_EQUAL_INT(-1, writes(0));
    TEST_ASSERT_EQUAL_INT(EBADF, file.error);
}
