// SPDX-License-Identifier: MIT
#include "posix/progress.h"

#include <inttypes.h>
#include <stdio.h>
#include <unistd.h>

#include "posix/file_port.h"

enum { BAR = 30 };

void progress_begin(progress *p, bool wanted, uint64_t total_bytes) {
    p->shown = wanted && isatty(STDERR_FILENO);
    p->total_bytes = total_bytes;
    p->start_ns = p->drawn_ns = monotonic_ns();
}

static void draw(const progress *p, uint64_t bytes, uint64_t frames, double seconds) {
    const double share = p->total_bytes > 0 ? (double)bytes / (double)p->total_bytes : 0;
    fprintf(stderr, "\r\033[K");
    if (p->total_bytes > 0) {
        fputc('[', stderr);
        for (int i = 0; i < BAR; i++)
            fputc(i < (int)(share * BAR) ? '#' : '.', stderr);
        fprintf(stderr, "] %3.0f %%, ", 100 * share);
    }
    fprintf(stderr, "%" PRIu64 " frames, %.0f a second", frames, (double)frames / seconds);
    if (share > 0.02)
        fprintf(stderr, ", %.0f s left", seconds * (1 - share) / share);
    fflush(stderr);
}

void progress_show(progress *p, uint64_t bytes, uint64_t frames) {
    if (!p->shown)
        return;
    const uint64_t now = monotonic_ns();
    if (now - p->drawn_ns < 100000000u)
        return;
    p->drawn_ns = now;
    draw(p, bytes, frames, (double)(now - p->start_ns) * 1e-9);
}

void progress_clear(const progress *p) {
    if (p->shown)
        fprintf(stderr, "\r\033[K");
}
