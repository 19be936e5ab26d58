// SPDX-License-Identifier: MIT
#include "filter/scene.h"

#include <string.h>

#include "math/small.h"

enum {
    ROWS = 4,         /* numbers of an observation, as report->nis_dof counts them */
    MIN_MATCHES = 10, /* with fewer matches in the sums, nothing is said */
    MIN_USUAL = 30    /* with fewer, they are not held against what is usual */
};

/* What the sums keep from frame to frame. They look back three frames: a scene that moves is to be told
 * before it has carried the pose far. */
#define DECAY PLR_R(0.7)
/* If a larger share of the matches is rejected when last seen and again, the scene contradicts itself. A
 * wrong match is seldom followed by another one of the same point; what moves stays off. If all that is
 * rejected is so much, one frame says it. */
#define AGAIN_SHARE    PLR_R(0.3)
#define REJECTED_SHARE PLR_R(0.6)
/* What is rejected again counts as if it were off by five sigma, and what is rejected for once by three:
 * how far off it is in fact says nothing. Where there is no gate, the others count for no more on
 * average. */
#define AGAIN_SQUARE PLR_R(25)
#define ONCE_SQUARE  PLR_R(9)
/* What is usual is the mean square of about 100 frames. Bad tracks that last become usual, and so do
 * those that come in bursts, because the limit goes by the deviation in the same frames. As long as little
 * has been seen, the deviation is taken to be large. */
#define USUAL_WEIGHT PLR_R(0.01)
#define RISE_SIGMAS  PLR_R(3.4)
#define FIRST_MEAN   PLR_R(1)
#define FIRST_SQUARE PLR_R(1.1)
/* Limits on NIS per degree of freedom, and the degrees of freedom that it takes to judge by
 * them. */
#define NIS_HIGH PLR_R(1.6)
#define NIS_LOW  PLR_R(0.3)
#define NIS_DOF  PLR_R(80)

void plr_scene_clear(plr_filter *f) {
    memset(&f->scene, 0, sizeof f->scene);
    f->scene.usual_mean = FIRST_MEAN;
    f->scene.usual_square = FIRST_SQUARE;
}

/* The mean square of an observation's numbers, in their sigmas. */
static plr_real mean_square(const plr_scene *s) {
    const plr_real once = s->rejected - s->again;
    const plr_real rejected = PLR_FMA(AGAIN_SQUARE, s->again, ONCE_SQUARE * once);
    return (s->nis + rejected) / (ROWS * s->matched);
}

static bool is_worse_than_usual(const plr_scene *s, plr_real now) {
    const plr_real variance = s->usual_square - s->usual_mean * s->usual_mean;
    const plr_real sigma = variance > 0 ? PLR_SQRT(variance) : PLR_R(0);
    return now > s->usual_mean + RISE_SIGMAS * sigma;
}

static void learn_usual(plr_scene *s, plr_real now) {
    s->usual_mean = PLR_FMA(USUAL_WEIGHT, now - s->usual_mean, s->usual_mean);
    s->usual_square = PLR_FMA(USUAL_WEIGHT, now * now - s->usual_square, s->usual_square);
}

plr_scene_verdict plr_scene_add(plr_filter *f, const plr_report *report) {
    plr_scene *s = &f->scene;
    const plr_real most = AGAIN_SQUARE * (plr_real)(report->matched - report->gated);
    const plr_real nis = (plr_real)report->nis < most ? (plr_real)report->nis : most;
    s->matched = PLR_FMA(DECAY, s->matched, (plr_real)report->matched);
    s->rejected = PLR_FMA(DECAY, s->rejected, (plr_real)report->gated);
    s->again = PLR_FMA(DECAY, s->again, (plr_real)report->gated_again);
    s->nis = PLR_FMA(DECAY, s->nis, nis);
    if (report->matched == 0 || !(s->matched > MIN_MATCHES))
        return PLR_SCENE_AGREES;
    bool worse = false;
    if (s->matched > MIN_USUAL) {
        const plr_real now = mean_square(s);
        worse = is_worse_than_usual(s, now);
        learn_usual(s, now);
    }
    const bool split =
        s->again > AGAIN_SHARE * s->matched || s->rejected > REJECTED_SHARE * s->matched;
    return split ? PLR_SCENE_SPLIT : worse ? PLR_SCENE_WORSE : PLR_SCENE_AGREES;
}

uint32_t plr_scene_noise_reasons(const plr_filter *f) {
    const plr_scene *s = &f->scene;
    const plr_real dof = ROWS * (s->matched - s->rejected);
    if (!(dof > NIS_DOF))
        return 0;
    return s->nis > NIS_HIGH * dof  ? PLR_REASON_NIS_HIGH
           : s->nis < NIS_LOW * dof ? PLR_REASON_NIS_LOW
                                    : 0;
}
