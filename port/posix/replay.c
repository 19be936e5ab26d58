// SPDX-License-Identifier: MIT
#include "posix/replay.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "posix/complaints.h"
#include "posix/config_file.h"
#include "posix/file_port.h"
#include "posix/help.h"
#include "posix/map_in.h"
#include "posix/options.h"
#include "posix/pictures.h"
#include "posix/progress.h"
#include "posix/result_file.h"
#include "posix/storage.h"
#include "posix/summary.h"
#include "posix/trajectory.h"
#include "posix/verdict.h"

enum {
    KNOWN_LANDMARKS = MAP_IN_MOST,
    FOREIGN_BYTES = 1 << 20 /* without one good frame: no recording */
};

/* Everything that one run needs; too large for a stack. */
typedef struct replay {
    replay_options options;
    plr_session session;
    plr_landmark known[KNOWN_LANDMARKS];
    file_port port;
    result_file trajectory, out;
    storage storage;
    map_in map_in;
    bool finishing; /* the end is the replay's own doing, not a message's */
    summary summary;
    complaints complaints;
    progress progress;
    outcome outcome;
} replay;

/* --- what the session shows --- */

static void on_started(void *context) {
    replay *run = context;
    const plr_config *config = plr_filter_config(&run->session.filter);
    run->outcome.started = true;
    run->outcome.foreign_map =
        !map_in_fits(&run->map_in, &run->session.header, run->outcome.map_problem);
    if (run->map_in.path == NULL)
        return;
    if (config->mode != PLR_MODE_LOCALIZATION && config->known_map == 0)
        complaints_say(&run->complaints, "the map of --map-in is not asked for: give --mode "
                                         "localization, or --known-map on");
    if (run->map_in.left_out > 0)
        complaints_say(&run->complaints,
                       "landmarks of --map-in whose place is not known (a sigma of "
                       "1000 km or more) are left out");
    if (map_in_is_of_another_camera(&run->map_in, &run->session.header))
        complaints_say(&run->complaints, "the map of --map-in was made with another camera: its "
                                         "ids must be those of this recording's front end");
}

static void on_frame(void *context, const plr_frame_result *result) {
    replay *run = context;
    summary_add_frame(&run->summary, result);
    if (result->pose != NULL)
        trajectory_put(run->trajectory.file, result->pose);
    complaints_observations(&run->complaints, run->session.totals.stereos, result->report);
}

static bool was_rejected(const replay *run) {
    return run->session.phase == PLR_PHASE_REJECTED && run->outcome.init_status == PLR_OK;
}

static void on_text(void *context, const plr_text *text) {
    replay *run = context;
    if (was_rejected(run)) { /* told at the end */
        snprintf(run->outcome.contradiction, sizeof run->outcome.contradiction, "%s", text->text);
        return;
    }
    if (text->severity != PLR_SEVERITY_INFO)
        run->summary.warnings++;
    progress_clear(&run->progress);
    complaints_say(&run->complaints, text->text);
}

static uint32_t number_of(const plr_session_totals *totals, plr_kind kind) {
    switch (kind) {
    case PLR_KIND_TWIST:
        return totals->twists;
    case PLR_KIND_STEREO:
        return totals->stereos;
    case PLR_KIND_TRUTH:
        return totals->truths;
    case PLR_KIND_LANDMARK:
        return totals->landmarks;
    case PLR_KIND_READING:
        return totals->readings;
    case PLR_KIND_IMU:
        return totals->imus;
    case PLR_KIND_IMAGE:
        return totals->images;
    default:
        return 0;
    }
}

/* A state was not brought back or kept: for the options, or for a STATE of the recording? */
static void on_refused_state(replay *run, plr_time_ns t_ns, plr_status status) {
    const plr_message *in = &run->session.in;
    if (run->finishing || in->kind == PLR_KIND_END) {
        run->storage.save_status = status; /* told at the end */
    } else if (in->kind != PLR_KIND_STATE) {
        run->storage.load_status = status; /* likewise: the first data asked for it */
    } else if (in->as.state.action == PLR_STATE_RESTORE) {
        /* a save that fails changes nothing of the drive: its TEXT will do */
        complaints_refused(&run->complaints, PLR_KIND_STATE, 0, t_ns, status, NULL);
    }
}

static void on_refused(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                       const plr_setting *culprit) {
    replay *run = context;
    if (was_rejected(run)) {
        run->outcome.init_status = status; /* told at the end */
        return;
    }
    if (run->session.phase == PLR_PHASE_REJECTED && status == PLR_E_NOT_READY)
        return; /* comes of that */
    progress_clear(&run->progress);
    if (subject == PLR_KIND_STATE) {
        on_refused_state(run, t_ns, status);
        return;
    }
    complaints_refused(&run->complaints, subject, number_of(&run->session.totals, subject), t_ns,
                       status, culprit);
}

/* --- the run --- */

/* A flight log NAME.zst is compressed while it is written. */
static bool open_log(replay *run) {
    const replay_options *o = &run->options;
    const size_t length = o->out != NULL ? strlen(o->out) : 0;
    const bool packed = length > 4 && strcmp(o->out + length - 4, ".zst") == 0;
    if (packed && !compressed_is_built_in()) {
        fprintf(stderr,
                PELORUS_NAME ": %s: this build has no libzstd: give --out OUT.plr, and zstd it "
                             "then\n",
                o->out);
        return false;
    }
    if (!result_file_open(&run->out, o->out, o->input, o->force))
        return false;
    run->port.output = run->out.file;
    if (packed)
        run->port.packer = compressed_output_open(run->out.file);
    if (packed && run->port.packer == NULL)
        fprintf(stderr, PELORUS_NAME ": %s: out of memory\n", o->out);
    return !packed || run->port.packer != NULL;
}

static bool open_outputs(replay *run) {
    const replay_options *o = &run->options;
    if (o->print_config)
        return true; /* nothing is computed */
    return result_file_open(&run->trajectory, o->trajectory, o->input, o->force) && open_log(run);
}

static bool close_outputs(replay *run) {
    bool good = compressed_output_close(run->port.packer); /* told with the file, below */
    run->port.packer = NULL;
    good = result_file_close(&run->trajectory) && good;
    good = result_file_close(&run->out) && good;
    return good;
}

/* Where the run came to nothing: what stood there before stays. After close_outputs it does nothing. */
static void discard_outputs(replay *run) {
    (void)compressed_output_close(run->port.packer);
    run->port.packer = NULL;
    result_file_discard(&run->trajectory);
    result_file_discard(&run->out);
}

static plr_status start_session(replay *run) {
    const plr_port port = file_port_functions(&run->port);
    plr_session_options options;
    plr_session_options_default(&options);
    options.overrides = run->options.overrides;
    options.override_count = run->options.override_count;
    options.start = run->options.start;
    options.deadline_us = run->options.deadline_us;
    if (run->options.answers)
        options.output = PLR_OUTPUT_POSE | PLR_OUTPUT_REPORT;
    else
        options.output |= PLR_OUTPUT_ECHO | PLR_OUTPUT_EVIDENCE;
    options.left_out = run->options.left_out;
    options.eyes = pictures_eyes();
    options.known = run->known;
    options.known_capacity = KNOWN_LANDMARKS;
    options.map = run->map_in.landmarks.items;
    options.map_count = (unsigned)run->map_in.landmarks.count;
    storage_lend(&run->storage, &run->options, &options);
    options.observer = (plr_session_observer){.context = run,
                                              .started = on_started,
                                              .frame = on_frame,
                                              .text = on_text,
                                              .refused = on_refused};
    return plr_session_init(&run->session, &port, &options);
}

/* True as long as there is a reason to go on. */
static bool take_step(replay *run) {
    const plr_reader_counts *counts = &run->session.reader.counts;
    switch (plr_session_step(&run->session)) {
    case PLR_STEP_CLOSED:
        return false;
    case PLR_STEP_FAILED:
        run->outcome.read_problem = file_port_problem(&run->port);
        return false;
    case PLR_STEP_FUTURE:
        run->outcome.future = true;
        return run->outcome.started; /* in the midst of a recording it is just refused */
    case PLR_STEP_ENDED:
        run->summary.ended = true;
        return false;
    case PLR_STEP_SKIPPED:
        progress_clear(&run->progress);
        complaints_skipped(&run->complaints, &run->session.reader);
        break;
    case PLR_STEP_IDLE:
    case PLR_STEP_BYTES:
    case PLR_STEP_MESSAGE:
        break;
    }
    /* restored: a STATE may ask for it once more */
    if (run->outcome.started && run->session.phase != PLR_PHASE_RESTORED)
        storage_begin(&run->storage);
    const bool foreign = counts->frames == 0 && counts->bytes > FOREIGN_BYTES;
    progress_show(&run->progress, counts->bytes, run->summary.frames);
    return !foreign && !run->outcome.foreign_map && run->outcome.init_status == PLR_OK &&
           run->storage.load_status == PLR_OK &&
           !(run->outcome.started && run->options.print_config);
}

static void tell_ending(replay *run) {
    const plr_session *s = &run->session;
    char words[128];
    if (run->summary.cut_in_frame) {
        snprintf(words, sizeof words, "ends in the middle of a frame, at byte %" PRIu64,
                 s->reader.counts.bytes);
        complaints_say(&run->complaints, words);
    }
    if (run->port.cut)
        complaints_say(&run->complaints, "its compression ends early: the file was cut");
    if (!run->summary.ended)
        complaints_say(&run->complaints, "has no END: it was cut short; what is there was used");
    else if (s->chunk_at < s->chunk_count || run->port.at < run->port.count)
        complaints_say(&run->complaints, "goes on behind END; that was not read");
    if (run->summary.frames > 1 && run->summary.used == 0 &&
        plr_filter_config(&s->filter)->mode <= PLR_MODE_LOCALIZATION &&
        plr_filter_config(&s->filter)->mode != PLR_MODE_MAPPING)
        complaints_say(&run->complaints,
                       "not one observation was used: the result is dead reckoning");
    complaints_end(&run->complaints);
}

static void read_recording(replay *run) {
    const uint64_t begin = monotonic_ns();
    progress_begin(&run->progress, !run->options.quiet && !run->options.print_config,
                   run->port.size);
    while (take_step(run))
        continue;
    run->summary.cut_in_frame = plr_reader_mid_frame(&run->session.reader);
    run->finishing = true;
    if (!run->summary.ended && run->outcome.started && run->storage.load_status == PLR_OK &&
        !run->options.print_config && !run->outcome.foreign_map) {
        storage_begin(&run->storage);
        plr_session_finish(&run->session);
    }
    run->summary.wall_s = (double)(monotonic_ns() - begin) * 1e-9;
    progress_clear(&run->progress);
}

/* --- what it came to --- */

/* A log that could not be written is not recommended. */
static bool print_results(replay *run, bool written) {
    const replay_options *o = &run->options;
    const char *path = o->input;
    if (o->json)
        summary_print_json(&run->summary, &run->session, path);
    else if (!o->quiet)
        summary_print(&run->summary, &run->session, path, written ? o->out : NULL);
    if (fflush(stdout) == 0 && !ferror(stdout))
        return true;
    fprintf(stderr, PELORUS_NAME ": standard output: %s\n", strerror(errno));
    return false;
}

static bool memory_sufficed(const replay *run) {
    if (!run->summary.compute_us.out_of_memory)
        return true;
    fprintf(stderr, PELORUS_NAME ": out of memory: the figures are not complete\n");
    return false;
}

static int usage_error(const char *problem) {
    fprintf(stderr, PELORUS_NAME ": %s\n", problem);
    return REPLAY_EXIT_USAGE;
}

static int run_recording(replay *run) {
    bool written = true;
    read_recording(run);
    int status = verdict_on_recording(run->options.input, &run->session, &run->outcome);
    const bool read = status == REPLAY_EXIT_OK; /* then the log says why a state is refused */
    if (read)
        status = storage_verdict_on_load(&run->storage, &run->options);
    if (status == REPLAY_EXIT_OK && run->outcome.foreign_map)
        status = usage_error(run->outcome.map_problem);
    if (status == REPLAY_EXIT_OK && run->options.print_config) {
        config_file_print(plr_filter_config(&run->session.filter));
        return fflush(stdout) == 0 ? REPLAY_EXIT_OK : REPLAY_EXIT_OUTPUT;
    }
    if (status == REPLAY_EXIT_OK)
        tell_ending(run);
    if (read)
        written = close_outputs(run); /* a summary that nobody reads ends the program */
    if (status == REPLAY_EXIT_OK)
        status = verdict_on_frames(run->options.input, &run->session, &run->summary);
    const bool printed = status != REPLAY_EXIT_OK || print_results(run, written);
    const bool complete = memory_sufficed(run);
    const int kept = storage_verdict_on_save(&run->storage, &run->options);
    if (status == REPLAY_EXIT_OK && !(printed && written && complete))
        status = REPLAY_EXIT_OUTPUT;
    return status == REPLAY_EXIT_OK ? kept : status;
}

/* --print-config without a recording: what options and file alone give. */
static int print_settings(const replay_options *options) {
    plr_config config;
    const plr_setting *culprit = NULL;
    plr_config_default(&config);
    for (unsigned i = 0; i < options->override_count; i++)
        (void)plr_config_set(&config, plr_setting_by_id(options->overrides[i].id),
                             options->overrides[i].value);
    const char *why = plr_config_why(&config, &culprit);
    if (why != NULL) {
        fprintf(stderr, PELORUS_NAME ": the settings make no sense together: %s: %s\n",
                culprit->name, why);
        return REPLAY_EXIT_USAGE;
    }
    config_file_print(&config);
    return REPLAY_EXIT_OK;
}

static int open_and_run(replay *run) {
    const replay_options *o = &run->options;
    char problem[PROBLEM_SIZE];
    if (!map_in_read(&run->map_in, o->map_in, problem)) {
        map_in_free(&run->map_in);
        return usage_error(problem);
    }
    if (!file_port_open(&run->port, o->input)) {
        const int error = errno;
        map_in_free(&run->map_in);
        return verdict_say(o->input, REPLAY_EXIT_RECORDING, strerror(error));
    }
    int status = storage_open(&run->storage, o);
    summary_init(&run->summary);
    complaints_init(&run->complaints, o->input, o->quiet);
    if (status == REPLAY_EXIT_OK && !open_outputs(run))
        status = REPLAY_EXIT_OUTPUT;
    if (status == REPLAY_EXIT_OK) {
        status = start_session(run) == PLR_OK
                     ? run_recording(run)
                     : usage_error("the settings asked for are outside their limits");
    }
    discard_outputs(run);
    summary_free(&run->summary);
    storage_close(&run->storage);
    map_in_free(&run->map_in);
    file_port_close(&run->port);
    return status;
}

int replay_main(int argc, char **argv) {
    static replay run;
    char problem[PROBLEM_SIZE];
    if (!options_parse(&run.options, argc, argv, problem))
        return usage_error(problem);
    if (run.options.help) {
        help_print();
        return REPLAY_EXIT_OK;
    }
    if (run.options.version) {
        help_print_version();
        return REPLAY_EXIT_OK;
    }
    if (run.options.input == NULL && run.options.print_config)
        return print_settings(&run.options);
    if (run.options.input == NULL)
        return usage_error("no recording was given: " PELORUS_NAME " IN.plr [options]; --help "
                           "tells more");
    return open_and_run(&run);
}
