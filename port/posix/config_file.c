// SPDX-License-Identifier: MIT
#include "posix/config_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "posix/settings_text.h"

#define BLANKS " \t\r\n"

enum { LINE_SIZE = 512, NAME_SIZE = 32, NAMES = 80 };

/* Which names stand in which line: one that stands twice is an oversight. */
typedef struct named_lines {
    unsigned count, line[NAMES];
    char name[NAMES][NAME_SIZE];
} named_lines;

/* False if the name stands in an earlier line. */
static bool is_first(named_lines *before, const char *name, unsigned line, char *problem) {
    for (unsigned i = 0; i < before->count; i++)
        if (strcmp(before->name[i], name) == 0) {
            snprintf(problem, PROBLEM_SIZE, "%.32s is set in line %u already: delete one of them",
                     name, before->line[i]);
            return false;
        }
    if (before->count < NAMES) {
        snprintf(before->name[before->count], NAME_SIZE, "%s", name);
        before->line[before->count++] = line;
    }
    return true;
}

/* Cuts blanks off both ends, in place. */
static char *trim(char *text) {
    text += strspn(text, BLANKS);
    size_t n = strlen(text);
    while (n > 0 && strchr(BLANKS, text[n - 1]) != NULL)
        n--;
    text[n] = '\0';
    return text;
}

/* One line without its comment. */
static bool take_line(char *line, unsigned number, named_lines *before, setting_list *list,
                      char *problem) {
    char *name = trim(line);
    if (*name == '\0')
        return true;
    char *equals = strchr(name, '=');
    if (equals == NULL) {
        snprintf(problem, PROBLEM_SIZE, "%.64s: should be `name = value`", name);
        return false;
    }
    *equals = '\0';
    name = trim(name);
    if (!setting_list_knows(name)) {
        snprintf(problem, PROBLEM_SIZE,
                 "%.64s is not a setting: --print-config lists them, and gate, preset, start and "
                 "deadline are taken too",
                 name);
        return false;
    }
    return is_first(before, name, number, problem) &&
           setting_list_put(list, name, trim(equals + 1), problem);
}

static bool take_file(FILE *file, const char *path, setting_list *list, char *problem) {
    char line[LINE_SIZE], cause[PROBLEM_SIZE];
    named_lines before = {.count = 0};
    for (unsigned number = 1; fgets(line, sizeof line, file) != NULL; number++) {
        bool good = strchr(line, '\n') != NULL || feof(file);
        if (!good)
            snprintf(cause, sizeof cause, "the line is longer than %d characters", LINE_SIZE - 2);
        line[strcspn(line, "#")] = '\0';
        good = good && take_line(line, number, &before, list, cause);
        if (!good) {
            snprintf(problem, PROBLEM_SIZE, "%.128s, line %u: %.300s", path, number, cause);
            return false;
        }
    }
    if (ferror(file)) {
        snprintf(problem, PROBLEM_SIZE, "%.128s: %s", path, strerror(errno));
        return false;
    }
    return true;
}

bool config_file_read(const char *path, setting_list *list, char problem[PROBLEM_SIZE]) {
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        snprintf(problem, PROBLEM_SIZE, "%.256s: %s", path, strerror(errno));
        return false;
    }
    const bool good = take_file(file, path, list, problem);
    fclose(file);
    return good;
}

void config_file_print(const plr_config *config) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *setting = plr_setting_at(i);
        char value[96], pair[160];
        if (plr_setting_of_axis(setting) != NULL)
            continue; /* in the line of the setting that it belongs to */
        setting_in_force_to_text(setting, config, value, sizeof value);
        snprintf(pair, sizeof pair, "%s = %s", setting->name, value);
        printf("%-36s # %s%s%s\n", pair, setting->unit, setting->unit[0] != '\0' ? ": " : "",
               plr_setting_about(setting));
    }
}
