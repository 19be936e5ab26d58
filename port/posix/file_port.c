// SPDX-License-Identifier: MIT
#include "posix/file_port.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

bool file_port_open(file_port *port, const char *path) {
    struct stat about;
    port->at = port->count = 0;
    port->size = 0;
    port->read_error = port->write_error = 0;
    port->output = NULL;
    port->input = strcmp(path, "-") == 0 ? STDIN_FILENO : open(path, O_RDONLY);
    if (port->input < 0)
        return false;
    if (fstat(port->input, &about) == 0) {
        if (S_ISDIR(about.st_mode)) {
            file_port_close(port);
            errno = EISDIR;
            return false;
        }
        if (S_ISREG(about.st_mode))
            port->size = (uint64_t)about.st_size;
    }
    return true;
}

void file_port_close(file_port *port) {
    if (port->input > STDIN_FILENO)
        close(port->input);
    port->input = -1;
}

/* The next piece of the file; false at its end or when it cannot be read. */
static bool refill(file_port *port) {
    ssize_t n;
    do
        n = read(port->input, port->buffer, sizeof port->buffer);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        port->read_error = errno;
    port->at = 0;
    port->count = n > 0 ? (size_t)n : 0;
    return n > 0;
}

static int read_input(void *context, uint8_t *bytes, size_t n) {
    file_port *port = context;
    if (port->at == port->count && !refill(port))
        return port->read_error != 0 ? PLR_PORT_FAILED : PLR_PORT_CLOSED;
    if (n > port->count - port->at)
        n = port->count - port->at;
    memcpy(bytes, port->buffer + port->at, n);
    port->at += n;
    return (int)n;
}

static int write_output(void *context, const uint8_t *bytes, size_t n) {
    file_port *port = context;
    if (fwrite(bytes, 1, n, port->output) == n)
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
