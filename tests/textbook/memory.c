// SPDX-License-Identifier: MIT
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "textbook/program.h"

static size_t least(size_t a, size_t b) {
    return a < b ? a : b;
}

/* The number behind `name` in a file of lines "name   number kB", in bytes; SIZE_MAX without it. */
static size_t kilobytes(const char *path, const char *name) {
    char line[256];
    size_t found = SIZE_MAX;
    FILE *file = fopen(path, "r");
    if (file == NULL)
        return found;
    while (found == SIZE_MAX && fgets(line, sizeof line, file) != NULL) {
        unsigned long long number;
        if (strncmp(line, name, strlen(name)) == 0 &&
            sscanf(line + strlen(name), "%llu", &number) == 1)
            found = (size_t)number * 1024;
    }
    fclose(file);
    return found;
}

/* The one number that a file holds; SIZE_MAX where it holds a word ("max") or is not there. */
static size_t number_in(const char *path) {
    unsigned long long number;
    FILE *file = fopen(path, "r");
    if (file == NULL)
        return SIZE_MAX;
    const int read = fscanf(file, "%llu", &number);
    fclose(file);
    return read == 1 ? (size_t)number : SIZE_MAX;
}

/* What a limit leaves of which so much is taken. */
static size_t left(size_t limit, size_t taken) {
    if (limit == SIZE_MAX || taken == SIZE_MAX)
        return limit;
    return limit > taken ? limit - taken : 0;
}

size_t textbook_program_memory(void) {
    struct rlimit limit;
    size_t bytes = kilobytes("/proc/meminfo", "MemAvailable:");
    if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
        bytes =
            least(bytes, left((size_t)limit.rlim_cur, kilobytes("/proc/self/status", "VmSize:")));
    return least(bytes, left(number_in("/sys/fs/cgroup/memory.max"),
                             number_in("/sys/fs/cgroup/memory.current")));
}
