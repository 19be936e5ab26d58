// SPDX-License-Identifier: MIT
#include "posix/settings_text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool text_to_number(const char *text, double *number) {
    char *end;
    if (text[strspn(text, "+-.0123456789eE")] != '\0')
        return false; /* strtod would also take blanks, words and hexadecimals */
    const double parsed = strtod(text, &end);
    if (end == text || *end != '\0' || !isfinite(parsed))
        return false;
    *number = parsed;
    return true;
}

static bool next_word(const char **text, char *word, size_t size);

static bool choice_from_text(const char *const *choices, const char *text, double *value) {
    for (unsigned i = 0; choices[i] != NULL; i++)
        if (strcmp(choices[i], text) == 0) {
            *value = i;
            return true;
        }
    return false;
}

/* "off", or words between commas, as bits. */
static bool list_from_text(const char *const *choices, const char *text, double *value) {
    unsigned bits = 0;
    char word[64];
    double index;
    if (*text == '\0' || text[strlen(text) - 1] == ',')
        return false;
    while (strcmp(text, "off") != 0 && *text != '\0') {
        if (!next_word(&text, word, sizeof word) || !choice_from_text(choices, word, &index))
            return false;
        bits |= 1U << (unsigned)index;
    }
    *value = bits;
    return true;
}

bool setting_value_from_text(const plr_setting *setting, const char *text, double *value) {
    double parsed;
    if (setting->kind == PLR_SETTING_LIST)
        return list_from_text(setting->choices, text, value);
    if (setting->choices != NULL)
        return choice_from_text(setting->choices, text, value);
    if (!text_to_number(text, &parsed))
        return false;
    if (parsed < setting->minimum || parsed > setting->maximum)
        return false;
    if (setting->kind == PLR_SETTING_COUNT && parsed != floor(parsed))
        return false;
    *value = parsed;
    return true;
}

/* %g would write 1000 as 1e+03 where one digit is enough. */
static void number_to_text(double value, char *text, size_t size) {
    if (value == floor(value) && fabs(value) < 1e7) {
        snprintf(text, size, "%.0f", value);
        return;
    }
    for (int digits = 1; digits <= 17; digits++) {
        snprintf(text, size, "%.*g", digits, value);
        if (strtod(text, NULL) == value)
            return;
    }
}

static void append(char *text, size_t size, const char *more) {
    const size_t at = strlen(text);
    snprintf(text + at, size - at, "%s", more);
}

static void list_to_text(const char *const *choices, unsigned bits, char *text, size_t size) {
    snprintf(text, size, "%s", bits == 0 ? "off" : "");
    for (unsigned i = 0; choices[i] != NULL; i++)
        if ((bits >> i & 1) != 0) {
            append(text, size, text[0] != '\0' ? "," : "");
            append(text, size, choices[i]);
        }
}

void setting_value_to_text(const plr_setting *setting, double value, char *text, size_t size) {
    if (setting->kind == PLR_SETTING_LIST)
        list_to_text(setting->choices, (unsigned)value, text, size);
    else if (setting->choices != NULL)
        snprintf(text, size, "%s", setting->choices[(unsigned)value]);
    else if (setting->kind == PLR_SETTING_COUNT)
        snprintf(text, size, "%.0f", value);
    else
        number_to_text(value, text, size);
}

/* The next of the words between commas, without the blanks around it; false if it is too long. */
static bool next_word(const char **text, char *word, size_t size) {
    *text += strspn(*text, " \t");
    size_t n = strcspn(*text, ",");
    const char *after = *text + n + ((*text)[n] == ',');
    while (n > 0 && strchr(" \t", (*text)[n - 1]) != NULL)
        n--;
    if (n >= size)
        return false;
    memcpy(word, *text, n);
    word[n] = '\0';
    *text = after;
    return true;
}

bool setting_values_from_text(const plr_setting *setting, const char *text, double values[3],
                              unsigned *count) {
    char word[64];
    *count = 1;
    if (plr_setting_axis(setting, 0) == NULL || strchr(text, ',') == NULL)
        return setting_value_from_text(setting, text, values);
    if (text[strlen(text) - 1] == ',')
        return false;
    double parsed[3];
    for (*count = 0; *count < 3; (*count)++)
        if (!next_word(&text, word, sizeof word) ||
            !setting_value_from_text(setting, word, &parsed[*count]))
            return false;
    if (*text != '\0')
        return false;
    memcpy(values, parsed, sizeof parsed);
    return true;
}

void setting_in_force_to_text(const plr_setting *setting, const plr_config *config, char *text,
                              size_t size) {
    const double x = plr_config_get(config, setting);
    bool same = true;
    setting_value_to_text(setting, x, text, size);
    for (unsigned axis = 1; axis < 3; axis++) {
        const plr_setting *other = plr_setting_axis(setting, axis);
        same = same && (other == NULL || plr_config_get(config, other) == x);
    }
    for (unsigned axis = 1; !same && axis < 3; axis++) {
        const plr_setting *other = plr_setting_axis(setting, axis);
        char number[32];
        setting_value_to_text(other, plr_config_get(config, other), number, sizeof number);
        append(text, size, ", ");
        append(text, size, number);
    }
}

static void choices_to_text(const char *const *choices, char *text, size_t size) {
    text[0] = '\0';
    for (unsigned i = 0; choices[i] != NULL; i++) {
        if (i > 0)
            append(text, size, choices[i + 1] == NULL ? " or " : ", ");
        append(text, size, choices[i]);
    }
}

void setting_allowed_text(const plr_setting *setting, char *text, size_t size) {
    char low[32], high[32];
    if (setting->choices != NULL) {
        choices_to_text(setting->choices, text, size);
        if (setting->kind == PLR_SETTING_LIST)
            append(text, size, ", several with commas, or off");
        return;
    }
    setting_value_to_text(setting, setting->minimum, low, sizeof low);
    setting_value_to_text(setting, setting->maximum, high, sizeof high);
    snprintf(text, size, "%s from %s to %s%s%s%s",
             setting->kind == PLR_SETTING_COUNT ? "a whole number" : "a number", low, high,
             setting->unit[0] != '\0' ? " " : "", setting->unit,
             plr_setting_axis(setting, 0) != NULL ? ", or three with commas: x,y,z" : "");
}
