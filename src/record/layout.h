// SPDX-License-Identifier: MIT
/*
 * The order of the fields in the payload of every kind of message, one function for each. The same
 * function reads, writes or checks a message, depending on the pass (pass.h); only READ changes it.
 * docs/REPLAY-FORMAT.md has the same layouts as tables.
 */
#ifndef PLR_RECORD_LAYOUT_H
#define PLR_RECORD_LAYOUT_H

#include "record/pass.h"

/* layout_setup.c */
void plr_layout_header(plr_pass *p, plr_header *m);
void plr_layout_config(plr_pass *p, plr_config_message *m);
void plr_layout_start(plr_pass *p, plr_start *m);
void plr_layout_state(plr_pass *p, plr_state_message *m);

/* layout_measurement.c */
void plr_layout_twist(plr_pass *p, plr_twist_message *m);
void plr_layout_stereo(plr_pass *p, plr_frame *m);
void plr_layout_truth(plr_pass *p, plr_truth *m);
void plr_layout_reading(plr_pass *p, plr_reading *m);

/* layout_result.c */
void plr_layout_landmark(plr_pass *p, plr_landmark_message *m);
void plr_layout_pose(plr_pass *p, plr_pose_message *m);
void plr_layout_report(plr_pass *p, plr_report_message *m);

/* layout_stream.c */
void plr_layout_text(plr_pass *p, plr_text *m);
void plr_layout_end(plr_pass *p, plr_end *m);

/* layout.c: the payload of m->kind, whichever it is; PLR_FAULT_UNKNOWN if it is none. */
void plr_layout(plr_pass *p, plr_message *m);

#endif
