// SPDX-License-Identifier: MIT
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include "campaign/pool.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { FRESH_PLEASE = 3 }; /* exit status of a worker whose batch is done */

typedef struct pool {
    unsigned n, batch;
    const char *what;
    pool_work work;
    void *context;
    volatile unsigned *next, *done; /* shared */
    time_t began;
} pool;

void *pool_shared(size_t bytes) {
    void *memory = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) {
        perror("campaign: no memory to share between processes");
        exit(2);
    }
    return memory;
}

unsigned pool_processors(void) {
    const long n = sysconf(_SC_NPROCESSORS_ONLN);
    return n > 0 ? (unsigned)n : 1;
}

static int work(const pool *p) {
    for (unsigned k = 0; p->batch == 0 || k < p->batch; k++) {
        const unsigned i = __atomic_fetch_add(p->next, 1, __ATOMIC_SEQ_CST);
        if (i >= p->n)
            return 0;
        p->work(p->context, i);
        __atomic_fetch_add(p->done, 1, __ATOMIC_SEQ_CST);
    }
    return FRESH_PLEASE;
}

static void start_worker(const pool *p) {
    const pid_t child = fork();
    if (child < 0) {
        perror("campaign: no process can be started");
        exit(2);
    }
    if (child == 0)
        _exit(work(p));
}

static void show_progress(const pool *p, bool last) {
    const unsigned done = *p->done;
    const double spent = difftime(time(NULL), p->began);
    const double left = done ? spent * (p->n - done) / done : 0;
    fprintf(stderr, "\r%u of %u %s, %.0f s, %.0f s to go  %s", done, p->n, p->what, spent, left,
            last ? "\n" : "");
    fflush(stderr);
}

/* A worker that was killed is replaced: the piece that it died of stays undone, for the caller to
 * see. */
static unsigned reap(const pool *p, unsigned running) {
    int status;
    while (running > 0 && waitpid(-1, &status, WNOHANG) > 0) {
        if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
            running--;
        else
            start_worker(p);
    }
    return running;
}

void pool_run(unsigned n, unsigned jobs, unsigned batch, const char *what, pool_work work_on,
              void *context) {
    volatile unsigned *counters = pool_shared(2 * sizeof *counters);
    const pool p = {n, batch, what, work_on, context, &counters[0], &counters[1], time(NULL)};
    unsigned running = 0, polls = 0;
    fflush(stdout);
    for (; running < jobs && running < n; running++)
        start_worker(&p);
    while (running > 0) {
        const struct timespec pause = {0, 20 * 1000 * 1000};
        (void)nanosleep(&pause, NULL);
        running = reap(&p, running);
        if (++polls % 50 == 0)
            show_progress(&p, false);
    }
    show_progress(&p, true);
    (void)munmap((void *)(uintptr_t)counters, 2 * sizeof *counters);
}
