// SPDX-License-Identifier: MIT
/* Sorting of small index arrays in place, in bounded time: heapsort, n log n in the worst case. */
#ifndef PLR_MATH_ORDER_H
#define PLR_MATH_ORDER_H

#include <stdbool.h>
#include <stdint.h>

/* True if index a comes before b: a strict order, without ties, or their order is unspecified. */
typedef bool (*plr_before)(const void *context, uint16_t a, uint16_t b);

/* Sorts indices[0..n-1]. */
void plr_order_sort(uint16_t *indices, unsigned n, plr_before before, const void *context);

#endif
