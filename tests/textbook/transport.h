// SPDX-License-Identifier: MIT
/* How P goes along with a change of the state. */
#ifndef PELORUS_TEXTBOOK_TRANSPORT_H
#define PELORUS_TEXTBOOK_TRANSPORT_H

#include "textbook/textbook.h"

/* P <- F P F^T, F = diag(head, I, blocks): head is k x k, blocks 3x3 for each landmark (NULL: I). */
void transport_covariance(textbook *t, unsigned k, const double *head, const double *blocks);

/* P <- P + X G^T + G X^T: X and G are n x 6. */
void transport_widen(textbook *t, const double *X, const double *G);

#endif
