// SPDX-License-Identifier: MIT
/* A setting's value as text, as it stands in options and config files, and back. */
#ifndef PELORUS_POSIX_SETTINGS_TEXT_H
#define PELORUS_POSIX_SETTINGS_TEXT_H

#include <stddef.h>

#include "pelorus/settings.h"

/* A finite decimal number and nothing else. */
bool text_to_number(const char *text, double *number);

/* One of the setting's words, or a number within its limits. False if it is neither; *value is then
 * unchanged. */
bool setting_value_from_text(const plr_setting *setting, const char *text, double *value);

/* The shortest text that gives the same value back. */
void setting_value_to_text(const plr_setting *setting, double value, char *text, size_t size);

/* The same for a setting that may have a number for each axis: one, or three with commas between. Tells
 * in *count how many there were; where there is one, it is for all axes. */
bool setting_values_from_text(const plr_setting *setting, const char *text, double values[3],
                              unsigned *count);

/* The value in force; three where the axes differ. */
void setting_in_force_to_text(const plr_setting *setting, const plr_config *config, char *text,
                              size_t size);

/* What may be given: "body or world", "a number from 0 to 100", "a whole number from 1 to 256". */
void setting_allowed_text(const plr_setting *setting, char *text, size_t size);

#endif
