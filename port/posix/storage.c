// SPDX-License-Identifier: MIT
#include "posix/storage.h"

#include <stdio.h>
#include <string.h>

#include "posix/replay.h"
#include "posix/verdict.h"

static int refuse(int status, const char *problem) {
    fprintf(stderr, PELORUS_NAME ": %s\n", problem);
    return status;
}

int storage_open(storage *s, const replay_options *wanted) {
    char problem[PROBLEM_SIZE];
    memset(s, 0, sizeof *s);
    state_file_none(&s->load);
    state_file_none(&s->save);
    if (wanted->print_config)
        return REPLAY_EXIT_OK; /* nothing is computed */
    if (wanted->load_state != NULL &&
        !state_file_open_to_load(&s->load, wanted->load_state, problem))
        return refuse(REPLAY_EXIT_USAGE, problem);
    /* no state is longer than the filter that it comes from */
    if (wanted->save_state != NULL &&
        !state_file_open_to_save(&s->save, wanted->save_state, sizeof(plr_filter), problem))
        return refuse(REPLAY_EXIT_OUTPUT, problem);
    return REPLAY_EXIT_OK;
}

void storage_close(storage *s) {
    state_file_close(&s->load);
    state_file_close(&s->save);
}

void storage_lend(storage *s, const replay_options *wanted, plr_session_options *options) {
    if (wanted->print_config || (wanted->load_state == NULL && wanted->save_state == NULL) ||
        plr_state_store_init(&s->store, &s->load.device) != PLR_OK)
        return;
    options->store = &s->store;
    if (wanted->load_state != NULL)
        options->start = PLR_START_SAVED;
    if (wanted->save_state != NULL)
        options->output |= PLR_OUTPUT_STATE;
}

void storage_begin(storage *s) {
    if (s->begun)
        return;
    s->begun = true;
    (void)plr_state_store_init(&s->store, &s->save.device);
}

/* `not_ready`: what that status means here. */
static int verdict(const char *path, int exit_status, const char *what, plr_status status,
                   const char *not_ready, const state_file *file) {
    char words[256];
    const char *why = plr_status_text(status);
    if (status == PLR_OK)
        return REPLAY_EXIT_OK;
    if (status == PLR_E_NOT_READY)
        why = not_ready;
    if (file->error != 0)
        why = strerror(file->error);
    snprintf(words, sizeof words, "%s: %.160s", what, why);
    return verdict_say(path, exit_status, words);
}

int storage_verdict_on_load(const storage *s, const replay_options *wanted) {
    return verdict(wanted->load_state, REPLAY_EXIT_USAGE, "no state to go on from", s->load_status,
                   "nothing was saved in it", &s->load);
}

int storage_verdict_on_save(const storage *s, const replay_options *wanted) {
    return verdict(wanted->save_state, REPLAY_EXIT_OUTPUT, "the state was not saved",
                   s->save_status, "no data was taken", &s->save);
}
