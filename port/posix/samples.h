// SPDX-License-Identifier: MIT
/* A list that grows, for what a desk collects over a recording. */
#ifndef PELORUS_POSIX_SAMPLES_H
#define PELORUS_POSIX_SAMPLES_H

#include <stdbool.h>
#include <stddef.h>

typedef struct samples {
    void *items;
    size_t item_size, count, capacity;
    bool out_of_memory; /* something was not added */
} samples;

void samples_init(samples *list, size_t item_size);
void samples_free(samples *list);

/* Appends a copy of the item. */
void samples_add(samples *list, const void *item);

/* Sorts a list of doubles. */
void samples_sort_doubles(samples *list);

/* Of a sorted list of doubles: the smallest value that at least that share (0 to 1) of them does
 * not exceed. NaN for an empty list. */
double samples_quantile(const samples *list, double share);

#endif
