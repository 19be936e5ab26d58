// SPDX-License-Identifier: MIT
#include "posix/samples.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void samples_init(samples *list, size_t item_size) {
    memset(list, 0, sizeof *list);
    list->item_size = item_size;
}

void samples_free(samples *list) {
    free(list->items);
    list->items = NULL;
    list->count = list->capacity = 0;
}

static bool grow(samples *list) {
    const size_t capacity = list->capacity > 0 ? 2 * list->capacity : 1024;
    void *items = realloc(list->items, capacity * list->item_size);
    if (items == NULL)
        return false;
    list->items = items;
    list->capacity = capacity;
    return true;
}

void samples_add(samples *list, const void *item) {
    if (list->count == list->capacity && !grow(list)) {
        list->out_of_memory = true;
        return;
    }
    memcpy((char *)list->items + list->count * list->item_size, item, list->item_size);
    list->count++;
}

static int compare_doubles(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

void samples_sort_doubles(samples *list) {
    if (list->count > 0)
        qsort(list->items, list->count, sizeof(double), compare_doubles);
}

double samples_quantile(const samples *list, double share) {
    if (list->count == 0)
        return nan("");
    const double rank = ceil(share * (double)list->count);
    const size_t at = rank < 1 ? 0 : (size_t)rank - 1;
    return ((const double *)list->items)[at < list->count ? at : list->count - 1];
}
