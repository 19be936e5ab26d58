// SPDX-License-Identifier: MIT
#include "record/layout.h"

void plr_layout(plr_pass *p, plr_message *m) {
    switch (m->kind) {
    case PLR_KIND_HEADER:
        plr_layout_header(p, &m->as.header);
        return;
    case PLR_KIND_CONFIG:
        plr_layout_config(p, &m->as.config);
        return;
    case PLR_KIND_START:
        plr_layout_start(p, &m->as.start);
        return;
    case PLR_KIND_TWIST:
        plr_layout_twist(p, &m->as.twist);
        return;
    case PLR_KIND_STEREO:
        plr_layout_stereo(p, &m->as.stereo);
        return;
    case PLR_KIND_TRUTH:
        plr_layout_truth(p, &m->as.truth);
        return;
    case PLR_KIND_LANDMARK:
        plr_layout_landmark(p, &m->as.landmark);
        return;
    case PLR_KIND_POSE:
        plr_layout_pose(p, &m->as.pose);
        return;
    case PLR_KIND_REPORT:
        plr_layout_report(p, &m->as.report);
        return;
    case PLR_KIND_TEXT:
        plr_layout_text(p, &m->as.text);
        return;
    case PLR_KIND_END:
        plr_layout_end(p, &m->as.end);
        return;
    case PLR_KIND_STATE:
        plr_layout_state(p, &m->as.state);
        return;
    case PLR_KIND_READING:
        plr_layout_reading(p, &m->as.reading);
        return;
    case PLR_KIND_NONE:
        break;
    }
    plr_pass_fail(p, PLR_FAULT_UNKNOWN);
}
