// SPDX-License-Identifier: MIT
/*
 * How far a frame is from what this machine can do: the time that its multiply-adds alone would take.
 * That floor counts the downdate P -= V V^T, at the machine's peak of fused multiply-adds with the vectors of this
 * build, or at the rate at which P goes through the processor, whichever is slower.
 */
#ifndef PELORUS_BENCH_FLOOR_H
#define PELORUS_BENCH_FLOOR_H

/* Prints a table, about two seconds and three budgets a line; an exit status. */
int beside_floor(double seconds);

#endif
