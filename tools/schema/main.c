// SPDX-License-Identifier: MIT
/*
 * Prints the tables of the library: messages, settings, statuses, reasons, limits, the saved state.
 *
 *     pelorus-schema json                  schema.json, which the Python tools read
 *     pelorus-schema markdown TABLE        a table of the docs; TABLE is kinds, settings, statuses,
 *                                          reasons, imu_faults, sensors, state, slot, bounds, limits, or the
 *                                          name of a message
 *
 * tests/layering/schema.py compares what it prints with the files, or writes them.
 */
#include <stdio.h>
#include <string.h>

#include "schema/print.h"

int main(int argc, char **argv) {
    if (argc == 2 && strcmp(argv[1], "json") == 0) {
        schema_print_json();
        return 0;
    }
    if (argc == 3 && strcmp(argv[1], "markdown") == 0 && schema_print_markdown(argv[2]))
        return 0;
    fprintf(stderr, "usage: pelorus-schema json | pelorus-schema markdown TABLE\n"
                    "TABLE: kinds, settings, statuses, reasons, imu_faults, sensors, state, slot, "
                    "bounds, or the name of a "
                    "message\n");
    return 2;
}
