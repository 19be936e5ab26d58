// SPDX-License-Identifier: MIT
/* TEXT, END: what goes along with a stream. */
#include "record/layout.h"

static bool continues_character(uint8_t byte) {
    return (byte & 0xC0) == 0x80;
}

/* READ: how much of the payload is kept. UTF-8 is cut between characters: at most three bytes of
 * one go before the cut. */
static size_t kept_text(const plr_pass *p) {
    if (p->left <= PLR_WIRE_MAX_TEXT)
        return p->left;
    size_t n = PLR_WIRE_MAX_TEXT;
    while (n > PLR_WIRE_MAX_TEXT - 3 && continues_character(p->payload[n]))
        n--;
    return n;
}

void plr_layout_text(plr_pass *p, plr_text *m) {
    plr_pass_choice(p, &m->severity, PLR_SEVERITY_ERROR);
    size_t length =
        plr_pass_reads(p) ? kept_text(p) : plr_pass_text_length(m->text, sizeof m->text);
    plr_pass_require(p, length <= PLR_WIRE_MAX_TEXT);
    if (p->fault == PLR_FAULT_NONE)
        plr_pass_text(p, m->text, length);
}

void plr_layout_end(plr_pass *p, plr_end *m) {
    plr_pass_u32(p, &m->twists);
    plr_pass_u32(p, &m->stereos);
    plr_pass_u32(p, &m->truths);
    plr_pass_u32(p, &m->landmarks);
    plr_pass_u32(p, &m->frames);
    if (plr_pass_reads(p) && p->left == 0) { /* before version 1.3 */
        m->readings = 0;
        m->differs = 0;
        for (unsigned i = 0; i < PLR_COUNTED; i++)
            m->arrived[i] = 0;
        return;
    }
    plr_pass_u32(p, &m->readings);
    plr_pass_u8(p, &m->differs);
    for (unsigned i = 0; i < PLR_COUNTED; i++)
        plr_pass_u32(p, &m->arrived[i]);
}
