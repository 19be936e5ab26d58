// SPDX-License-Identifier: MIT
#include "posix/verdict.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "posix/replay.h"

int verdict_say(const char *path, int status, const char *words) {
    fprintf(stderr, PELORUS_NAME ": %s: %s\n", path, words);
    return status;
}

static int explain_no_start(const char *path, const outcome *run) {
    char words[400];
    if (run->init_status == PLR_E_CONFIG) {
        snprintf(words, sizeof words,
                 "the settings in force make no sense together: %s (--print-config shows them, "
                 "--help their limits)",
                 run->contradiction);
        return verdict_say(path, REPLAY_EXIT_USAGE, words);
    }
    snprintf(words, sizeof words, "HEADER: %.200s", plr_status_text(run->init_status));
    return verdict_say(path, REPLAY_EXIT_RECORDING, words);
}

int verdict_on_recording(const char *path, const plr_session *s, const outcome *run) {
    const plr_reader_counts *counts = &s->reader.counts;
    char words[256];
    if (run->read_problem != NULL)
        return verdict_say(path, REPLAY_EXIT_RECORDING, run->read_problem);
    if (run->future && !run->started) {
        snprintf(words, sizeof words,
                 "is written in version %u of the format, and this program reads version %u: take "
                 "a later one",
                 (unsigned)s->in.as.header.version_major, (unsigned)PLR_WIRE_VERSION_MAJOR);
        return verdict_say(path, REPLAY_EXIT_RECORDING, words);
    }
    if (counts->bytes == 0)
        return verdict_say(path, REPLAY_EXIT_RECORDING, "is empty");
    if (counts->frames == 0) {
        snprintf(words, sizeof words,
                 "is not a Pelorus recording: not one good frame in its first %" PRIu64
                 " bytes; pelorus convert makes one of other data",
                 counts->bytes);
        return verdict_say(path, REPLAY_EXIT_RECORDING, words);
    }
    if (run->init_status != PLR_OK)
        return explain_no_start(path, run);
    if (s->header.version_major == 0) {
        snprintf(words, sizeof words,
                 "has no HEADER among its %" PRIu32 " good frames, so the camera is not known",
                 counts->frames);
        return verdict_say(path, REPLAY_EXIT_RECORDING, words);
    }
    if (!run->started)
        return verdict_say(path, REPLAY_EXIT_RECORDING, "holds no data: neither TWIST nor STEREO");
    return REPLAY_EXIT_OK;
}

int verdict_on_frames(const char *path, const plr_session *s, const summary *summed) {
    const plr_session_totals *totals = &s->totals;
    char words[192];
    if (totals->other_process > 0 && totals->other_process == totals->twists + totals->imus) {
        snprintf(words, sizeof words,
                 "nothing moves the body: none of %" PRIu32
                 " messages is of the setting process; set the other one",
                 totals->other_process);
        return verdict_say(path, REPLAY_EXIT_RECORDING, words);
    }
    if (summed->frames > 0)
        return REPLAY_EXIT_OK;
    snprintf(words, sizeof words,
             "no frame could be used: %" PRIu32 " STEREO, %" PRIu64
             " refused; are all times on one "
             "clock, and in ns?",
             s->totals.stereos, summed->frames_refused);
    return verdict_say(path, REPLAY_EXIT_RECORDING, words);
}
