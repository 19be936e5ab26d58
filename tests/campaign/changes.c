// SPDX-License-Identifier: MIT
/* Changes to a scenario from the command line: for finding out what a figure hangs on. */
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign/scenario.h"
#include "campaign/world.h"

typedef enum kind { NUMBER, COUNT, SWITCH } kind;

static const struct field {
    const char *name;
    size_t offset;
    kind kind;
    double minimum, maximum;
} fields[] = {
    {"room", offsetof(scenario, room), SWITCH, 0, 1},
    {"speed", offsetof(scenario, speed_mps), NUMBER, 0, 100},
    {"turn", offsetof(scenario, turn), NUMBER, 0, 10},
    {"near", offsetof(scenario, near_m), NUMBER, 0.1, 1e4},
    {"far", offsetof(scenario, far_m), NUMBER, 0.2, 1e4},
    {"baseline", offsetof(scenario, baseline_m), NUMBER, 1e-3, 10},
    {"landmarks", offsetof(scenario, landmarks), COUNT, 1, MAX_POINTS},
    {"slots", offsetof(scenario, slots), COUNT, 0, PLR_MAX_LANDMARKS},
    {"twists", offsetof(scenario, twists_per_frame), COUNT, 1, 100},
    {"pixel", offsetof(scenario, pixel_px), NUMBER, 1e-3, 100},
    {"velocity", offsetof(scenario, velocity_mps), NUMBER, 0, 100},
    {"gyro", offsetof(scenario, gyro_radps), NUMBER, 0, 10},
    {"bias", offsetof(scenario, bias), SWITCH, 0, 1},
    {"wrong-matches", offsetof(scenario, wrong_matches), NUMBER, 0, 1},
    {"track-drift", offsetof(scenario, track_drift), NUMBER, 0, 100},
    {"told-drift", offsetof(scenario, told_drift), NUMBER, 0, 100},
    {"lost-tracks", offsetof(scenario, lost_tracks), NUMBER, 0, 1},
    {"before", offsetof(scenario, before), COUNT, 0, 1e6},
    {"during", offsetof(scenario, during), COUNT, 0, 1e6},
    {"after", offsetof(scenario, after), COUNT, 0, 1e6},
    {"strength", offsetof(scenario, strength), NUMBER, -1e3, 1e3},
};
enum { FIELDS = sizeof fields / sizeof fields[0] };

static const struct field *find(const char *name, size_t length) {
    for (unsigned i = 0; i < FIELDS; i++)
        if (strlen(fields[i].name) == length && memcmp(fields[i].name, name, length) == 0)
            return &fields[i];
    return NULL;
}

static void store(scenario *s, const struct field *field, double value) {
    unsigned char *at = (unsigned char *)s + field->offset;
    const unsigned count = field->kind == NUMBER ? 0 : (unsigned)value;
    const bool on = count != 0;
    if (field->kind == NUMBER)
        memcpy(at, &value, sizeof value);
    else if (field->kind == COUNT)
        memcpy(at, &count, sizeof count);
    else
        memcpy(at, &on, sizeof on);
}

const char *scenario_change(scenario *s, const char *changes) {
    while (*changes) {
        const size_t length = strcspn(changes, "=,");
        const struct field *field = find(changes, length);
        char *end = NULL;
        if (!field || changes[length] != '=')
            return changes;
        const double value = strtod(changes + length + 1, &end);
        if (end == changes + length + 1 || (*end && *end != ',') ||
            !(value >= field->minimum && value <= field->maximum))
            return changes;
        store(s, field, value);
        changes = end + (*end == ',');
    }
    return s->near_m < s->far_m ? NULL : "near: must be less than far";
}

void scenario_fields(char *text, unsigned size) {
    unsigned used = 0;
    text[0] = 0;
    for (unsigned i = 0; i < FIELDS && used < size; i++)
        used += (unsigned)snprintf(text + used, size - used, "%s%s", i ? ", " : "", fields[i].name);
}
