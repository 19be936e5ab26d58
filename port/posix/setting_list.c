// SPDX-License-Identifier: MIT
#include "posix/setting_list.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "posix/gate.h"
#include "posix/settings_text.h"

/* Reads one named value that is not a row of the table. */
typedef bool (*special_function)(setting_list *list, const char *value, char *problem);

/* In the place of what was given before, for the setting or for single axes of it. */
static void set_row(setting_list *list, const plr_setting *setting, double value) {
    unsigned kept = 0;
    for (unsigned i = 0; i < list->count; i++) {
        const plr_setting *old = plr_setting_by_id(list->settings[i].id);
        if (old != setting && plr_setting_of_axis(old) != setting)
            list->settings[kept++] = list->settings[i];
    }
    list->settings[kept] = (plr_wire_setting){.id = setting->id, .value = value};
    list->count = kept + 1;
}

static void set(setting_list *list, const char *name, double value) {
    set_row(list, plr_setting_by_name(name), value);
}

/* The gate by probability is the chi-square gate, so the course's own is switched off. */
static bool put_gate(setting_list *list, const char *value, char *problem) {
    double probability = 0;
    const bool off = strcmp(value, "off") == 0;
    if (!off && (!text_to_number(value, &probability) || probability <= 0 || probability >= 1)) {
        snprintf(problem, PROBLEM_SIZE, "a probability above 0 and below 1, or off");
        return false;
    }
    set(list, "gate-d2", off ? 0 : gate_threshold(probability));
    set(list, "gate-residual", 0);
    return true;
}

static bool put_preset(setting_list *list, const char *value, char *problem) {
    list->course = strcmp(value, "course") == 0;
    if (!list->course)
        snprintf(problem, PROBLEM_SIZE, "course");
    return list->course;
}

static bool put_start(setting_list *list, const char *value, char *problem) {
    static const char *const words[] = {
        [PLR_START_AUTO] = "auto",
        [PLR_START_TRUTH] = "truth",
        [PLR_START_IDENTITY] = "identity",
        [PLR_START_RECORDED] = "recorded",
    };
    for (unsigned i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strcmp(words[i], value) == 0) {
            list->start = (plr_start_choice)i;
            list->start_given = true;
            return true;
        }
    snprintf(problem, PROBLEM_SIZE, "truth, identity, recorded or auto");
    return false;
}

static bool put_deadline(setting_list *list, const char *value, char *problem) {
    double us;
    if (!text_to_number(value, &us) || us < 0 || us > 1e9 || us != floor(us)) {
        snprintf(problem, PROBLEM_SIZE, "a whole number of microseconds, 0 for none");
        return false;
    }
    list->deadline_us = (uint32_t)us;
    list->deadline_given = true;
    return true;
}

static special_function special(const char *name) {
    static const struct {
        const char *name;
        special_function put;
    } specials[] = {
        {"gate", put_gate},
        {"preset", put_preset},
        {"start", put_start},
        {"deadline", put_deadline},
    };
    for (unsigned i = 0; i < sizeof specials / sizeof specials[0]; i++)
        if (strcmp(specials[i].name, name) == 0)
            return specials[i].put;
    return NULL;
}

bool setting_list_knows(const char *name) {
    return special(name) != NULL || plr_setting_by_name(name) != NULL;
}

bool setting_list_put(setting_list *list, const char *name, const char *value,
                      char problem[PROBLEM_SIZE]) {
    const plr_setting *setting = plr_setting_by_name(name);
    char allowed[PROBLEM_SIZE / 2] = "";
    double numbers[3];
    unsigned count;
    bool good;
    if (setting != NULL) {
        good = setting_values_from_text(setting, value, numbers, &count);
        for (unsigned axis = 0; good && axis < count; axis++)
            set_row(list, count == 1 ? setting : plr_setting_axis(setting, axis), numbers[axis]);
        if (!good)
            setting_allowed_text(setting, allowed, sizeof allowed);
    } else {
        char words[PROBLEM_SIZE] = "";
        good = special(name)(list, value, words);
        snprintf(allowed, sizeof allowed, "%.*s", (int)sizeof allowed - 1, words);
    }
    if (!good)
        snprintf(problem, PROBLEM_SIZE, "%s %.64s: should be %s", name, value, allowed);
    return good;
}

/* The preset leaves alone what says how it is run, not how it computes. */
static bool course_has(const plr_setting *setting) {
    static const char *const others[] = {"mode",      "slots",   "known-map",
                                         "max-range", "max-gap", "twist-delay"};
    for (unsigned i = 0; i < sizeof others / sizeof others[0]; i++)
        if (strcmp(others[i], setting->name) == 0)
            return false;
    return true;
}

static unsigned append_course(plr_wire_setting *overrides, unsigned count) {
    plr_config course;
    plr_config_course(&course);
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *setting = plr_setting_at(i);
        if (!course_has(setting))
            continue;
        overrides[count].id = setting->id;
        overrides[count++].value = plr_config_get(&course, setting);
    }
    return count;
}

unsigned setting_list_append(const setting_list *list, plr_wire_setting *overrides,
                             unsigned count) {
    if (list->course)
        count = append_course(overrides, count);
    memcpy(overrides + count, list->settings, list->count * sizeof *list->settings);
    return count + list->count;
}
