// SPDX-License-Identifier: MIT
/* The textbook's motion: III.8 and III.14. In `world` landmarks stand still; in `body` what they do
 * waits for the next frame (body.c). */
#include <string.h>

#include "support/rigid.h"
#include "textbook/body.h"
#include "textbook/textbook.h"
#include "textbook/transport.h"

/* T <- T D. */
static void move(textbook *t, const double D[16]) {
    double moved[16];
    square_multiply(4, t->T_WB, D, moved);
    memcpy(t->T_WB, moved, sizeof moved);
    rigid_clean(t->T_WB);
}

/* P <- F P F^T + W, F = [A, N; 0, I] in the rows of pose and bias; N may be NULL. */
static void carry(textbook *t, const double A[36], const double *N, const double W[6]) {
    const unsigned k = textbook_row(t, 0);
    double head[144] = {0};
    for (unsigned i = 0; i < k; i++)
        head[i * (k + 1)] = 1;
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < 6; j++) {
            head[i * k + j] = A[6 * i + j];
            if (N)
                head[i * k + 6 + j] = N[6 * i + j];
        }
    transport_covariance(t, k, head, NULL);
    for (unsigned i = 0; i < 6; i++)
        t->P[i * (t->ld + 1)] += W[i];
}

void textbook_hold(textbook *t, const plr_twist *twist, double seconds, double interval) {
    const plr_config *c = &t->config;
    const double share =
        c->noise == PLR_NOISE_STEP ? (interval > 0 ? seconds / interval : 1) : seconds * interval;
    double xi[6], D[16], back[16], A[36], N[36], W[6];
    for (int i = 0; i < 3; i++) {
        xi[i] = seconds * (twist->v_B_mps[i] - t->bias[i]);
        xi[3 + i] = seconds * (twist->w_B_radps[i] - t->bias[3 + i]);
        W[i] = c->velocity_sigma[i] * c->velocity_sigma[i] * share;
        W[3 + i] = c->gyro_sigma[i] * c->gyro_sigma[i] * share;
    }
    rigid_exp(D, xi);
    rigid_inverse(back, D);
    rigid_adjoint(A, back);
    rigid_right_jacobian(N, xi);
    for (int i = 0; i < 36; i++)
        N[i] *= -seconds;
    move(t, D);
    if (textbook_is_body(t))
        body_hold(t, D, A, c->bias ? N : NULL, W);
    else
        carry(t, A, c->bias ? N : NULL, W);
    t->walked_s += seconds;
}

void textbook_move_to(textbook *t, const plr_pose *T_WB) {
    double back[16], there[16], D[16];
    rigid_inverse(back, t->T_WB);
    rigid_from_pose(there, T_WB);
    square_multiply(4, back, there, D);
    memcpy(t->T_WB, there, sizeof there);
    rigid_clean(t->T_WB);
    if (textbook_is_body(t))
        body_move(t, D);
}
