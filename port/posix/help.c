// SPDX-License-Identifier: MIT
#include "posix/help.h"

#include <stdio.h>
#include <string.h>

#include "posix/options.h"
#include "posix/program.h"
#include "posix/replay.h"
#include "posix/settings_text.h"

enum {
    COLUMN = 34, /* where the meaning of an option begins */
    NAMES = 16
};

/* The settings in the order in which a newcomer meets them. Those that stand in no group come
 * last. */
static const struct {
    const char *title;
    const char *names[NAMES];
} groups[] = {
    {"What is estimated", {"model", "mode", "process", "bias", "slots", "known-map"}},
    {"Motion",
     {"twist-timing", "noise", "velocity-sigma", "gyro-sigma", "bias-velocity-sigma",
      "bias-gyro-sigma", "bias-velocity-walk", "bias-gyro-walk", "standstill-sigma"}},
    {"IMU",
     {"gyro-noise", "accel-noise", "gyro-walk", "accel-walk", "bias-accel-sigma", "gravity",
      "imu-turn", "imu-arm", "imu-start", "start-velocity-sigma", "gyro-range", "accel-range",
      "imu-timing"}},
    {"Vision",
     {"pixel-sigma", "gate-d2", "gate-residual", "min-depth", "min-disparity", "max-depth",
      "max-row-gap", "max-range", "landmark-sigma", "landmark-prior"}},
    {"Start and time", {"start-sigma", "max-gap", "twist-delay", "camera-offset"}},
};

enum { GROUPS = sizeof groups / sizeof groups[0] };

static void print_row(const char *name, const char *value, const char *about) {
    char head[128];
    snprintf(head, sizeof head, "  --%s%s%s", name, value != NULL ? " " : "",
             value != NULL ? value : "");
    if (strlen(head) >= COLUMN)
        printf("%s\n%*s%s", head, COLUMN, "", about);
    else
        printf("%-*s%s", COLUMN, head, about);
}

/* The words joined by |, or the unit. */
static void value_hint(const plr_setting *setting, char *text, size_t size) {
    const char *between = setting->kind == PLR_SETTING_LIST ? "," : "|";
    text[0] = '\0';
    if (setting->choices == NULL) {
        const char *number = setting->kind == PLR_SETTING_COUNT ? "N" : "X";
        snprintf(text, size, "%s%s", setting->unit[0] != '\0' ? setting->unit : number,
                 plr_setting_axis(setting, 0) != NULL ? "[,Y,Z]" : "");
        return;
    }
    for (unsigned i = 0; setting->choices[i] != NULL; i++) {
        const size_t at = strlen(text);
        snprintf(text + at, size - at, "%s%s", i > 0 ? between : "", setting->choices[i]);
    }
}

static void print_setting(const plr_setting *setting) {
    char hint[128], standard[64];
    value_hint(setting, hint, sizeof hint);
    if (setting->kind == PLR_SETTING_NUMBER)
        snprintf(standard, sizeof standard, "%g", setting->standard); /* six digits will do */
    else
        setting_value_to_text(setting, setting->standard, standard, sizeof standard);
    print_row(setting->name, hint, plr_setting_about(setting));
    printf(" [%s]\n", standard);
}

static bool in_group(const char *name) {
    for (unsigned g = 0; g < GROUPS; g++)
        for (unsigned i = 0; i < NAMES && groups[g].names[i] != NULL; i++)
            if (strcmp(groups[g].names[i], name) == 0)
                return true;
    return false;
}

static void print_settings(void) {
    for (unsigned g = 0; g < GROUPS; g++) {
        printf("\n%s [default]\n", groups[g].title);
        for (unsigned i = 0; i < NAMES && groups[g].names[i] != NULL; i++) {
            const plr_setting *setting = plr_setting_by_name(groups[g].names[i]);
            if (setting != NULL)
                print_setting(setting);
        }
    }
    bool titled = false;
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *setting = plr_setting_at(i);
        if (in_group(setting->name) || plr_setting_of_axis(setting) != NULL)
            continue;
        if (!titled)
            printf("\nMore settings [default]\n");
        titled = true;
        print_setting(setting);
    }
}

void help_print(void) {
    printf("usage: " PELORUS_NAME " IN.plr [options]\n"
           "\n"
           "Runs the filter, in %s, over a recording: docs/REPLAY-FORMAT.md. IN.plr may be -,\n"
           "the standard input.\n"
           "\n"
           "%s"
           "  " PELORUS_NAME " drive.plr --bias on --gate 0.99 --trajectory drive.tum\n"
           "  " PELORUS_NAME " drive.plr --config robot.conf --slots 120 --json\n"
           "  " PELORUS_NAME " drive.plr --preset course --print-config\n"
           "  " PELORUS_NAME " morning.plr --save-state robot.state\n"
           "  " PELORUS_NAME " evening.plr --load-state robot.state\n"
           "  " PELORUS_NAME " first.plr --out map.plr\n"
           "  " PELORUS_NAME " second.plr --mode localization --map-in map.plr\n"
           "\n"
           "A setting is taken from the first that gives it: option, config file, the recording's\n"
           "CONFIG, the recording's HEADER, default.\n"
           "\n"
           "Options\n",
           sizeof(plr_real) == sizeof(float) ? "float32" : "float64", program_about);
    for (unsigned i = 0; options_describe(i) != NULL; i++) {
        const option_description *o = options_describe(i);
        print_row(o->name, o->value, o->about);
        printf("\n");
    }
    print_settings();
    printf("\n"
           "Exit status\n"
           "  %d  a result was computed; what was skipped or refused is told and counted\n"
           "  %d  nothing useful could be done with the recording\n"
           "  %d  an option, a config file, a saved state or the settings in force make no sense\n"
           "  %d  an output could not be written\n"
           "  %d  the processor lacks instructions that this build needs\n",
           REPLAY_EXIT_OK, REPLAY_EXIT_RECORDING, REPLAY_EXIT_USAGE, REPLAY_EXIT_OUTPUT,
           REPLAY_EXIT_CPU);
}

void help_print_version(void) {
    printf(PELORUS_NAME " %s, float%u, at most %d landmarks and %d observations a frame, "
                        "build %08x\n",
           plr_version(), (unsigned)(8 * sizeof(plr_real)), PLR_MAX_LANDMARKS, PLR_MAX_OBSERVATIONS,
           (unsigned)plr_build_fingerprint());
}
