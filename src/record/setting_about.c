// SPDX-License-Identifier: MIT
#include "pelorus/settings.h"

#define SETTING(id, name, unit, about, kind, words, minimum, maximum, standard, field, storage)    \
    case id:                                                                                       \
        return about;

/* In a file of its own: a linker leaves sentences out with their file, not one by one. */
const char *plr_setting_about(const plr_setting *setting) {
    switch (setting->id) {
#include "record/settings.def"
    default:
        return "";
    }
}
