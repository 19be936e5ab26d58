// SPDX-License-Identifier: MIT
/*
 * Matrices for tests, in double and row by row: made at random, compared, and brought to the
 * filter's precision and packing and back.
 */
#ifndef PELORUS_TEST_MATRICES_H
#define PELORUS_TEST_MATRICES_H

#include <stdbool.h>
#include <stddef.h>

#include "pelorus/config.h"
#include "support/random.h"

/* The filter's rounding: the step from 1 to the next number. */
#define REAL_EPSILON (PLR_REAL == 32 ? 0x1p-23 : 0x1p-52)

/* --- made at random --- */

/* A symmetric positive definite n x n matrix G G^T / n + floor I, G normal. Its smallest eigenvalue
 * is at least `floor`. */
void random_spd(rng *r, unsigned n, double floor, double *A);

/* A rotation, evenly distributed (from a normal quaternion). */
void random_rotation(rng *r, double R[9]);

/* A vector of that length, n numbers, in any direction. */
void random_direction(rng *r, double length, double *v, size_t n);

/* --- between precisions and packings --- */

void to_reals(plr_real *out, const double *in, size_t n);
void to_doubles(double *out, const plr_real *in, size_t n);

/* Rounds every number to the filter's precision, so that oracle and filter start from the same. */
void round_to_real(double *x, size_t n);

/* Lower triangle of the n x n matrix A, row by row, n (n + 1) / 2 numbers. */
void pack_lower(plr_real *packed, const double *A, unsigned n);

/* The symmetric n x n matrix of a packed lower triangle. */
void unpack_symmetric(double *A, const plr_real *packed, unsigned n);

/* --- compared --- */

/* max |a_i - b_i|; NaN if any of the numbers is. */
double largest_difference(const double *a, const double *b, size_t n);

/* max |a_i|; NaN if any of the numbers is. */
double largest(const double *a, size_t n);

/* True if all n numbers are finite. */
bool all_finite(const double *x, size_t n);

/* True if a and b agree in every bit (so that 0 and -0 differ). */
bool same_bits(const plr_real *a, const plr_real *b, size_t n);

/* True if A, n x n, is symmetric to the bit. */
bool is_symmetric(const plr_real *A, unsigned n);

#endif
