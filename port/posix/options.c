// SPDX-License-Identifier: MIT
#include "posix/options.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "pelorus/supervisor.h"
#include "posix/config_file.h"

typedef enum option_kind { OPTION_SETTING, OPTION_PATH, OPTION_FLAG } option_kind;

typedef struct option {
    option_description shown;
    option_kind kind;
    size_t offset; /* of a path or flag in replay_options */
} option;

#define AT(field) offsetof(replay_options, field)

/* All options besides the rows of the setting table. */
static const option table[] = {
    {{"gate", "PROBABILITY|off", "gate-d2 as a chi-square probability, for example 0.99"},
     OPTION_SETTING,
     0},
    {{"preset", "course",
      "the course report's settings (III-F), under all others; 30 m and 20 px are our limits"},
     OPTION_SETTING,
     0},
    {{"start", "truth|identity|recorded", "initial pose; else START, first TRUTH, or identity"},
     OPTION_SETTING,
     0},
    {{"deadline", "US", "time that a frame's update may take, in us; 0 = no limit"},
     OPTION_SETTING,
     0},
    {{"config", "FILE", "settings as lines `name = value`; options win over it"},
     OPTION_PATH,
     AT(config)},
    {{"print-config", NULL, "print the settings in force as such a file, and stop"},
     OPTION_FLAG,
     AT(print_config)},
    {{"trajectory", "OUT.tum", "poses as lines `t x y z qx qy qz qw`"},
     OPTION_PATH,
     AT(trajectory)},
    {{"out", "OUT.plr", "flight log: inputs and outputs; can itself be replayed"},
     OPTION_PATH,
     AT(out)},
    {{"answers", NULL, "write poses and reports alone to --out, without inputs and landmarks"},
     OPTION_FLAG,
     AT(answers)},
    {{"map-in", "FILE.plr", "known landmarks: those of an earlier result of --out, in its world"},
     OPTION_PATH,
     AT(map_in)},
    {{"load-state", "FILE", "go on from the state saved there; START and TRUTH are not looked at"},
     OPTION_PATH,
     AT(load_state)},
    {{"save-state", "FILE", "save the filter's state there at the end; FILE keeps the last two"},
     OPTION_PATH,
     AT(save_state)},
    {{"without", "NAME,...",
      "leaves out rules of the supervisor: the names of docs/SUPERVISION.md"},
     OPTION_PATH,
     AT(without)},
    {{"force", NULL, "overwrite files of --out and --trajectory that are there"},
     OPTION_FLAG,
     AT(force)},
    {{"json", NULL, "the summary as one JSON object"}, OPTION_FLAG, AT(json)},
    {{"quiet", NULL, "no summary, no progress, no warnings"}, OPTION_FLAG, AT(quiet)},
    {{"help", NULL, "this text"}, OPTION_FLAG, AT(help)},
    {{"version", NULL, "version and build"}, OPTION_FLAG, AT(version)},
};

enum { TABLE_SIZE = sizeof table / sizeof table[0], NAME_SIZE = 64 };

const option_description *options_describe(unsigned index) {
    return index < TABLE_SIZE ? &table[index].shown : NULL;
}

static const option *find(const char *name) {
    for (unsigned i = 0; i < TABLE_SIZE; i++)
        if (strcmp(table[i].shown.name, name) == 0)
            return &table[i];
    return NULL;
}

/* --- what was meant by an unknown name --- */

static unsigned least(unsigned a, unsigned b) {
    return a < b ? a : b;
}

/* How many letters must be put in, left out or exchanged (Levenshtein). */
static unsigned letters_apart(const char *a, const char *b) {
    unsigned row[NAME_SIZE + 1];
    const size_t n = strlen(b);
    if (strlen(a) > NAME_SIZE || n > NAME_SIZE)
        return NAME_SIZE;
    for (unsigned j = 0; j <= n; j++)
        row[j] = j;
    for (unsigned i = 1; a[i - 1] != '\0'; i++) {
        unsigned diagonal = row[0];
        row[0] = i;
        for (unsigned j = 1; j <= n; j++) {
            const unsigned exchanged = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = least(exchanged, least(row[j], row[j - 1]) + 1);
        }
    }
    return row[n];
}

static const char *nearest_name(const char *name) {
    const char *best = NULL;
    unsigned distance = 4; /* further away is another word */
    for (unsigned i = 0; i < TABLE_SIZE + plr_setting_count(); i++) {
        const char *candidate =
            i < TABLE_SIZE ? table[i].shown.name : plr_setting_at(i - TABLE_SIZE)->name;
        const unsigned apart = letters_apart(name, candidate);
        if (apart < distance) {
            distance = apart;
            best = candidate;
        }
    }
    return best;
}

static bool unknown(const char *name, char *problem) {
    const char *meant = nearest_name(name);
    if (strcmp(name, "set") == 0) /* of the tools in Python */
        snprintf(problem, PROBLEM_SIZE,
                 "--set: unknown option; each setting is one here: --pixel-sigma 2 in place of "
                 "--set pixel-sigma=2");
    else if (meant != NULL)
        snprintf(problem, PROBLEM_SIZE, "--%.64s: unknown option; is --%s meant?", name, meant);
    else
        snprintf(problem, PROBLEM_SIZE, "--%.64s: unknown option; --help lists them", name);
    return false;
}

/* --- one argument --- */

typedef struct arguments {
    int count, at;
    char *const *words;
} arguments;

/* "--name=value", or "--name" with the value as the next argument. */
static bool split(arguments *given, char name[NAME_SIZE], const char **value) {
    const char *word = given->words[given->at] + 2;
    const size_t n = strcspn(word, "=");
    snprintf(name, NAME_SIZE, "%.*s", (int)n, word);
    *value = word[n] == '=' ? word + n + 1 : NULL;
    return n < NAME_SIZE;
}

static bool take_flag(replay_options *options, const option *o, const char *value, char *problem) {
    if (value != NULL) {
        snprintf(problem, PROBLEM_SIZE, "--%s takes no value", o->shown.name);
        return false;
    }
    *(bool *)((char *)options + o->offset) = true;
    return true;
}

static bool take_value(replay_options *options, setting_list *list, const option *o,
                       const char *name, const char *value, char *problem) {
    if (o == NULL || o->kind == OPTION_SETTING) {
        char cause[PROBLEM_SIZE];
        if (setting_list_put(list, name, value, cause))
            return true;
        snprintf(problem, PROBLEM_SIZE, "--%.500s", cause);
        return false;
    }
    if (*value == '\0') {
        snprintf(problem, PROBLEM_SIZE, "--%s: should be the path of a file", name);
        return false;
    }
    memcpy((char *)options + o->offset, &value, sizeof value);
    return true;
}

static bool take_option(replay_options *options, setting_list *list, arguments *given,
                        char *problem) {
    char name[NAME_SIZE];
    const char *value;
    const bool fits = split(given, name, &value);
    const option *o = fits ? find(name) : NULL;
    if (!fits || (o == NULL && !setting_list_knows(name)))
        return unknown(name, problem);
    if (o != NULL && o->kind == OPTION_FLAG)
        return take_flag(options, o, value, problem);
    if (value == NULL) {
        if (given->at + 1 >= given->count) {
            snprintf(problem, PROBLEM_SIZE, "--%s: a value is missing behind it", name);
            return false;
        }
        value = given->words[++given->at];
    }
    return take_value(options, list, o, name, value, problem);
}

static bool take_input(replay_options *options, const char *word, char *problem) {
    if (options->input != NULL) {
        snprintf(problem, PROBLEM_SIZE, "%.128s and %.128s: one recording at a time",
                 options->input, word);
        return false;
    }
    options->input = word;
    return true;
}

static bool take_all(replay_options *options, setting_list *list, arguments *given, char *problem) {
    bool only_paths = false; /* behind "--" */
    for (; given->at < given->count; given->at++) {
        const char *word = given->words[given->at];
        bool good;
        if (!only_paths && strcmp(word, "--") == 0) {
            only_paths = true;
            continue;
        }
        if (only_paths || word[0] != '-' || word[1] == '\0')
            good = take_input(options, word, problem);
        else if (word[1] == '-')
            good = take_option(options, list, given, problem);
        else if (strcmp(word, "-h") == 0)
            good = options->help = true;
        else
            good = unknown(word + 1, problem);
        if (!good)
            return false;
    }
    return true;
}

static void merge(replay_options *options, const setting_list *list) {
    options->override_count =
        setting_list_append(list, options->overrides, options->override_count);
    if (list->start_given)
        options->start = list->start;
    if (list->deadline_given)
        options->deadline_us = list->deadline_us;
}

/* The rules that --without names. */
static bool find_left_out(replay_options *options, char *problem) {
    for (const char *name = options->without; name && *name;) {
        const size_t n = strcspn(name, ",");
        unsigned row = 0;
        const plr_limit_row *limit;
        while ((limit = plr_limit_at(row)) != NULL &&
               (strlen(limit->name) != n || memcmp(limit->name, name, n) != 0))
            row++;
        if (limit == NULL || limit->rule) {
            snprintf(problem, PROBLEM_SIZE,
                     "--without: %.*s is no rule; docs/SUPERVISION.md lists them", (int)n, name);
            return false;
        }
        options->left_out |= UINT64_C(1) << row;
        name += n + (name[n] == ',');
    }
    return true;
}

bool options_parse(replay_options *options, int argc, char *const *argv,
                   char problem[PROBLEM_SIZE]) {
    setting_list from_line = {0}, from_file = {0};
    arguments given = {argc, 1, argv};
    memset(options, 0, sizeof *options);
    if (!take_all(options, &from_line, &given, problem))
        return false;
    if (options->config != NULL && !config_file_read(options->config, &from_file, problem))
        return false;
    if (!find_left_out(options, problem))
        return false;
    merge(options, &from_file);
    merge(options, &from_line);
    if (options->load_state != NULL && options->start != PLR_START_AUTO) {
        snprintf(problem, PROBLEM_SIZE,
                 "--load-state and --start: the pose can start from one of them alone");
        return false;
    }
    return true;
}
