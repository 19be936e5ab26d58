// SPDX-License-Identifier: MIT
/* One flat JSON object on a stream, a member at a time. */
#ifndef PELORUS_POSIX_JSON_H
#define PELORUS_POSIX_JSON_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

typedef struct json_object {
    FILE *file;
    bool begun;
} json_object;

void json_begin(json_object *object, FILE *file);
void json_end(json_object *object);

void json_count(json_object *object, const char *key, uint64_t value);
void json_flag(json_object *object, const char *key, bool value);
void json_string(json_object *object, const char *key, const char *value);

/* JSON has no NaN and no infinity: they become null. */
void json_number(json_object *object, const char *key, double value);

#endif
