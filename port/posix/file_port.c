// SPDX-License-Identifier: MIT
#include "posix/file_port.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "posix/system.h"

/* Do these bytes begin a zstd file? Fewer than four do not. */
static bool is_compressed(const uint8_t *bytes, size_t n) {
    static const uint8_t magic[4] = {0x28, 0xB5, 0x2F, 0xFD};
    return n >= sizeof magic && memcmp(bytes, magic, sizeof magic) == 0;
}

static bool is_open(file_port *port) {
    struct stat about;
    if (port->input < 0)
        return false;
    if (fstat(port->input, &about) != 0)
        return true;
    if (S_ISDIR(about.st_mode)) {
        file_port_close(port);
        errno = EISDIR;
        return false;
    }
    uint8_t head[4];
    const bool packed = S_ISREG(about.st_mode) && system_read_at(port->input, head, 4, 0) == 4 &&
                        is_compressed(head, sizeof head);
    if (S_ISREG(about.st_mode) && !packed)
        port->size = (uint64_t)about.st_size;
    return true;
}

bool file_port_open(file_port *port, const char *path) {
    memset(port, 0, sizeof *port);
    port->input = strcmp(path, "-") == 0 ? STDIN_FILENO : system_open_to_read(path);
    return is_open(port);
}

void file_port_close(file_port *port) {
    if (port->input > STDIN_FILENO)
        close(port->input);
    port->input = -1;
    compressed_input_close(port->unpacker);
    port->unpacker = NULL;
}

const char *file_port_problem(const file_port *port) {
    return port->read_error != 0 ? strerror(port->read_error) : port->read_problem;
}

/* The next bytes of the file as it is. */
static long fetch_raw(void *context, uint8_t *bytes, size_t n) {
    file_port *port = context;
    if (port->head_at < port->head_count) { /* looked at, and not yet handed on */
        size_t count = port->head_count - port->head_at;
        count = count < n ? count : n;
        memcpy(bytes, port->head + port->head_at, count);
        port->head_at += count;
        return (long)count;
    }
    const long count = system_read(port->input, bytes, n);
    if (count < 0)
        port->read_error = errno;
    return count;
}

/* Looks at the first bytes: is it compressed? A pipe may give them one by one. */
static void begin(file_port *port) {
    long count = 1;
    port->begun = true;
    while (port->head_count < sizeof port->head && count > 0) {
        port->head_at = port->head_count; /* so that fetch_raw reads on */
        count =
            fetch_raw(port, port->head + port->head_count, sizeof port->head - port->head_count);
        port->head_count += count > 0 ? (size_t)count : 0;
    }
    port->head_at = 0;
    if (!is_compressed(port->head, port->head_count))
        return;
    port->unpacker = compressed_input_open(fetch_raw, port);
    if (port->unpacker == NULL)
        port->read_problem = compressed_is_built_in()
                                 ? "out of memory"
                                 : "is compressed by zstd, and this build has no libzstd: zstdcat "
                                   "FILE | " PELORUS_NAME " -";
}

/* The next piece of the recording; false at its end or when it cannot be read. */
static bool refill(file_port *port) {
    if (!port->begun)
        begin(port);
    if (file_port_problem(port) != NULL)
        return false;
    const long n = port->unpacker != NULL
                       ? compressed_input_read(port->unpacker, port->buffer, sizeof port->buffer)
                       : fetch_raw(port, port->buffer, sizeof port->buffer);
    if (n == COMPRESSED_DAMAGED)
        port->read_problem = "its compression is damaged: zstd -t FILE tells where";
    else if (n == COMPRESSED_CUT && port->count == 0)
        port->read_problem = "is compressed by zstd and cut off before its first bytes come out";
    else if (n == COMPRESSED_CUT)
        port->cut = true;
    port->at = 0;
    port->count = n > 0 ? (size_t)n : 0;
    return n > 0;
}

static int read_input(void *context, uint8_t *bytes, size_t n) {
    file_port *port = context;
    if (port->at == port->count && !refill(port))
        return file_port_problem(port) != NULL ? PLR_PORT_FAILED : PLR_PORT_CLOSED;
    if (n > port->count - port->at)
        n = port->count - port->at;
    memcpy(bytes, port->buffer + port->at, n);
    port->at += n;
    return (int)n;
}

static int write_output(void *context, const uint8_t *bytes, size_t n) {
    file_port *port = context;
    if (port->packer != NULL ? compressed_output_write(port->packer, bytes, n)
                             : fwrite(bytes, 1, n, port->output) == n)
        return 0;
    if (port->write_error == 0)
        port->write_error = errno != 0 ? errno : EIO;
    return -1;
}

uint64_t monotonic_ns(void) {
    struct timespec now;
    if (clock_gettime(CLOCK_MONOTONIC, &now) != 0)
        return 0;
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static uint64_t now_ns(void *context) {
    (void)context;
    return monotonic_ns();
}

plr_port file_port_functions(file_port *port) {
    return (plr_port){.context = port,
                      .read = read_input,
                      .write = port->output != NULL ? write_output : NULL,
                      .now_ns = now_ns};
}
