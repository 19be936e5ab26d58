// SPDX-License-Identifier: MIT
/* What Python has to ask the library before it calls it: tools/pelorus/native/binding.py. */
#ifndef PELORUS_PYTHON_BINDING_H
#define PELORUS_PYTHON_BINDING_H

#include <stddef.h>
#include <stdint.h>

#include "pelorus/config.h"
#include "pelorus/settings.h"
#include "pelorus/vision.h"

/* The sizes that the library was built with; `bytes` is that of a plr_filter. */
void plr_binding_sizes(plr_sizes *sizes);

/* sizeof a struct of the interface, by its name; 0 where there is none of that name. */
uint32_t plr_binding_size_of(const char *name);

/* plr_session_settings of a HEADER and a CONFIG behind it, n bytes as a recording has them. PLR_E_ARGUMENT:
 * they are something else. */
plr_status plr_binding_settings(plr_config *config, const uint8_t *bytes, size_t n,
                                const plr_setting **culprit);

/* plr_vision_init, which is compiled into its caller. */
plr_status plr_binding_vision_init(plr_vision *v, const plr_rig *rig);

/* What is to be read of a plr_vision after a pair: its report, what stands beside the observations, and the
 * tracks that ended. */
const plr_vision_report *plr_binding_vision_report(const plr_vision *v, const plr_sight **sights,
                                                   const plr_ended_track **ended);

/* Most pixels of a picture, and most tracks. */
uint32_t plr_binding_vision_limits(uint32_t *tracks);

/* An instruction that the library was built for and this processor lacks; NULL: none. */
const char *plr_binding_processor_lacks(void);

#endif
