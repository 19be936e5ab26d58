// SPDX-License-Identifier: MIT
#include "schema/tables.h"

#include "pelorus/eyes.h"
#include "pelorus/filter.h"
#include "pelorus/wire.h"

#define LENGTH(table) (sizeof(table) / sizeof *(table))

/* --- messages --- */

#define MESSAGE(name_, from_, about_)                                                              \
    {.kind = ROW_TABLE,                                                                            \
     .name = #name_,                                                                               \
     .number = PLR_KIND_##name_,                                                                   \
     .from = (from_),                                                                              \
     .about = (about_)},
#define FIELD(name_, member_, type_, count_, least_, most_, since_, unit_, about_)                 \
    {.kind = ROW_FIELD,                                                                            \
     .name = #name_,                                                                               \
     .type = #type_,                                                                               \
     .count = (count_),                                                                            \
     .least = (least_),                                                                            \
     .most = (most_),                                                                              \
     .since = (since_),                                                                            \
     .unit = (unit_),                                                                              \
     .about = (about_)},
#define ROWS(name_, struct_) {.kind = ROW_REPEATED, .name = #name_},
#define ROW(name_, struct_, member_, type_, unit_, about_)                                         \
    FIELD(name_, member_, type_, 1, 0, 0, 0, unit_, about_)
#define COLUMNS(name_, struct_) {.kind = ROW_COLUMNS, .name = #name_},
#define COLUMN(name_, struct_, member_, type_, since_, unit_, about_)                              \
    FIELD(name_, member_, type_, 1, 0, 0, since_, unit_, about_)
#define END(name_) {.kind = ROW_END, .name = #name_},
const row schema_messages[] = {
#include "record/messages.def"
};
const size_t schema_message_rows = LENGTH(schema_messages);

/* --- the saved state --- */

#undef FIELD
#define TABLE(name_, times_) {.kind = ROW_TABLE, .name = #name_, .from = (times_)},
#define GROUP(about_)        {.kind = ROW_GROUP, .about = (about_)},
#define FIELD(struct_, member_, type_, count_, most_, about_)                                      \
    {.kind = ROW_FIELD,                                                                            \
     .name = #member_,                                                                             \
     .type = #type_,                                                                               \
     .count = (count_),                                                                            \
     .most = (most_),                                                                              \
     .unit = "",                                                                                   \
     .about = (about_)},
const row schema_state[] = {
#include "filter/snapshot.def"
};
const size_t schema_state_rows = LENGTH(schema_state);

/* --- the header of a slot --- */

#undef FIELD
#define FIELD(member_, type_, about_)                                                              \
    {.kind = ROW_FIELD,                                                                            \
     .name = #member_,                                                                             \
     .type = #type_,                                                                               \
     .count = 1,                                                                                   \
     .unit = "",                                                                                   \
     .about = (about_)},
const row schema_slot[] = {
#include "session/slot.def"
};
const size_t schema_slot_rows = LENGTH(schema_slot);

/* --- numbers that no sensor measures --- */

#define LIMIT(name_, most_, what_, unit_)                                                          \
    {.kind = BOUND_LIMIT, .name = #name_, .most = (most_), .text = (what_), .unit = (unit_)},
#define BOUND(group_, type_, member_, count_, limit_)                                              \
    {.kind = BOUND_NUMBERS, .name = #limit_, .count = (count_), .text = #member_, .unit = ""},
#define BOUND_IF(group_, type_, member_, count_, limit_, flag_)                                    \
    {.kind = BOUND_NUMBERS, .name = #limit_, .count = (count_), .text = #member_, .unit = #flag_},
#undef GROUP
#define GROUP(name_, type_, what_) {.kind = BOUND_GROUP, .name = #name_, .text = (what_)},
const bound schema_bounds[] = {
#include "session/limits.def"
};
const size_t schema_bound_rows = LENGTH(schema_bounds);

/* --- words --- */

#define STATUS(number_, text_)    {"status", #number_, number_, text_},
#define HEALTH(number_, text_)    {"health", #number_, number_, text_},
#define REASON(number_, text_)    {"reason", #number_, number_, text_},
#define IMU_FAULT(number_, text_) {"imu_fault", #number_, number_, text_},
const word schema_words[] = {
#include "record/words.def"
};
const size_t schema_word_rows = LENGTH(schema_words);

/* Names for the numbers of fields. */
const word schema_enums[] = {
    {"body_axes", "FORWARD_LEFT_UP", PLR_AXES_FLU, ""},
    {"body_axes", "FORWARD_RIGHT_DOWN", PLR_AXES_FRD, ""},
    {"body_axes", "OTHER", PLR_AXES_OTHER, ""},
    {"twist_timing", "START", PLR_TWIST_START, ""},
    {"twist_timing", "END", PLR_TWIST_END, ""},
    {"twist_timing", "MID", PLR_TWIST_MID, ""},
    {"process", "TWIST", PLR_PROCESS_TWIST, ""},
    {"process", "IMU", PLR_PROCESS_IMU, ""},
    {"role", "KNOWN", PLR_LANDMARK_KNOWN, ""},
    {"role", "EVICTED", PLR_LANDMARK_EVICTED, ""},
    {"role", "FINAL", PLR_LANDMARK_FINAL, ""},
    {"action", "SAVE", PLR_STATE_SAVE, ""},
    {"action", "RESTORE", PLR_STATE_RESTORE, ""},
    {"notice", "NONE", PLR_NOTICE_NONE, ""},
    {"notice", "STARTED", PLR_NOTICE_STARTED, ""},
    {"notice", "SAVED", PLR_NOTICE_SAVED, ""},
    {"notice", "RESTORED", PLR_NOTICE_RESTORED, ""},
    {"side", "LEFT", PLR_SIDE_LEFT, ""},
    {"side", "RIGHT", PLR_SIDE_RIGHT, ""},
    {"lens_model", "NONE", PLR_LENS_NONE, ""},
    {"lens_model", "RADTAN", PLR_LENS_RADTAN, ""},
    {"lens_model", "EQUIDISTANT", PLR_LENS_EQUIDISTANT, ""},
    {"severity", "INFO", PLR_SEVERITY_INFO, ""},
    {"severity", "WARNING", PLR_SEVERITY_WARNING, ""},
    {"severity", "ERROR", PLR_SEVERITY_ERROR, ""},
#define SENSOR(number_, kind_, about_) {"sensor", #number_, number_, about_},
#include "sensor/sensors.def"
};
const size_t schema_enum_rows = LENGTH(schema_enums);

const limit schema_limits[] = {
    {"version_major", PLR_WIRE_VERSION_MAJOR},
    {"version_minor", PLR_WIRE_VERSION_MINOR},
    {"overhead_bytes", PLR_WIRE_OVERHEAD},
    {"name_bytes", PLR_WIRE_NAME_SIZE - 1},
    {"text_bytes", PLR_WIRE_MAX_TEXT},
    {"settings", PLR_WIRE_MAX_SETTINGS},
    {"observations", PLR_WIRE_MAX_OBSERVATIONS},
    {"not_seen_px", (double)PLR_NOT_SEEN_PX},
    {"imu_readings", PLR_WIRE_MAX_IMU},
    {"image_pixels", PLR_WIRE_IMAGE_PIXELS},
    {"no_budget", PLR_NO_BUDGET},
    {"rejected_landmarks", PLR_SUPERVISION_REJECTED},
    {"harmless_reasons", PLR_REASONS_HARMLESS},
    {"unknown_variance", PLR_WIRE_UNKNOWN_VARIANCE},
    {"eyes_speed_sigma_mps", PLR_EYES_SPEED_SIGMA},
};
const size_t schema_limit_rows = LENGTH(schema_limits);
