// SPDX-License-Identifier: MIT
#include "math/order.h"

#include "pelorus/assertions.h"

/* Moves indices[root] down the heap until it comes after both of its children. */
static void sink(uint16_t *indices, unsigned root, unsigned n, plr_before before,
                 const void *context) {
    const uint16_t moved = indices[root];
    PLR_ASSERT(root < n);
    for (unsigned child = 2 * root + 1; child < n; child = 2 * root + 1) {
        if (child + 1 < n && before(context, indices[child], indices[child + 1]))
            child++;
        if (!before(context, moved, indices[child]))
            break;
        indices[root] = indices[child];
        root = child;
    }
    indices[root] = moved;
}

void plr_order_sort(uint16_t *indices, unsigned n, plr_before before, const void *context) {
    for (unsigned root = n / 2; root-- > 0;)
        sink(indices, root, n, before, context);
    for (unsigned end = n; end-- > 1;) {
        const uint16_t last = indices[0];
        indices[0] = indices[end];
        indices[end] = last;
        sink(indices, 0, end, before, context);
    }
}
