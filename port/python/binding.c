// SPDX-License-Identifier: MIT
#include "python/binding.h"

#include <stddef.h>
#include <string.h>

#include "pelorus/pelorus.h"
#include "pelorus/session.h"
#include "pelorus/vision.h"
#include "posix/processor.h"

#define SIZE(type)                                                                                 \
    { #type, sizeof(type) }

void plr_binding_sizes(plr_sizes *sizes) {
    *sizes = plr_sizes_here(sizeof(plr_filter));
}

uint32_t plr_binding_size_of(const char *name) {
    static const struct {
        const char *name;
        uint32_t size;
    } table[] = {
        SIZE(plr_calibration),  SIZE(plr_ended_track),    SIZE(plr_expected),
        SIZE(plr_config),       SIZE(plr_frame),          SIZE(plr_health_state),
        SIZE(plr_imu),          SIZE(plr_landmark),       SIZE(plr_map),
        SIZE(plr_lens),         SIZE(plr_observation),    SIZE(plr_picture),
        SIZE(plr_picture_pair), SIZE(plr_depth),          SIZE(plr_pose),
        SIZE(plr_reading),      SIZE(plr_reading_result), SIZE(plr_report),
        SIZE(plr_rig),          SIZE(plr_setting),        SIZE(plr_sight),
        SIZE(plr_sizes),        SIZE(plr_supervision),    SIZE(plr_totals),
        SIZE(plr_twist),        SIZE(plr_vision),         SIZE(plr_vision_report),
    };
    for (unsigned i = 0; i < sizeof table / sizeof table[0]; i++)
        if (strcmp(table[i].name, name) == 0)
            return table[i].size;
    return 0;
}

plr_status plr_binding_vision_init(plr_vision *v, const plr_rig *rig) {
    return plr_vision_init(v, rig);
}

const plr_vision_report *plr_binding_vision_report(const plr_vision *v, const plr_sight **sights,
                                                   const plr_ended_track **ended) {
    *sights = v->sights;
    *ended = v->ended;
    return &v->report;
}

uint32_t plr_binding_vision_limits(uint32_t *tracks) {
    *tracks = PLR_VISION_TRACKS;
    return PLR_VISION_PIXELS;
}

plr_status plr_binding_settings(plr_config *config, const uint8_t *bytes, size_t n,
                                const plr_setting **culprit) {
    uint8_t buffer[PLR_WIRE_MIN_BUFFER];
    plr_reader reader;
    plr_message header, wanted;
    size_t taken = 0, more = 0;
    if (plr_reader_init(&reader, buffer, sizeof buffer, NULL, 0) != PLR_OK ||
        plr_reader_feed(&reader, bytes, n, &taken, &header) != PLR_READ_MESSAGE ||
        header.kind != PLR_KIND_HEADER ||
        plr_reader_feed(&reader, bytes + taken, n - taken, &more, &wanted) != PLR_READ_MESSAGE ||
        wanted.kind != PLR_KIND_CONFIG)
        return PLR_E_ARGUMENT;
    return plr_session_settings(config, &header.as.header, &wanted.as.config, culprit);
}

const char *plr_binding_processor_lacks(void) {
    return processor_lacks();
}
