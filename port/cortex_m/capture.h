// SPDX-License-Identifier: MIT
/*
 * Pairs of pictures from two cameras that are read out together, pixel beside pixel. A DMA writes strips of some
 * rows in two banks by turns; the interrupt at the end of each takes the strip apart, into one of two pairs:
 *
 *     trigger         capture_begin       which pair is free?
 *     exposure        capture_exposed     its time
 *     end of a strip  capture_strip       while the DMA fills the other bank
 *     loop            capture_take        the pair is the caller's until the next call
 *
 * One pair is filled while the other is worked on. Where neither is free a picture is left out and counted: what
 * a caller holds is never written. Knows no hardware: tests/unit/test_capture.c.
 */
#ifndef PELORUS_CORTEX_M_CAPTURE_H
#define PELORUS_CORTEX_M_CAPTURE_H

#include <stdbool.h>
#include <stdint.h>

enum { CAPTURE_BANKS = 2 };

/* Who may write the next state: of FREE and FILLING the interrupt, of FULL and HELD the loop. */
typedef enum capture_state {
    CAPTURE_FREE,
    CAPTURE_FILLING,
    CAPTURE_FULL,
    CAPTURE_HELD
} capture_state;

typedef struct capture_pair {
    uint8_t *left, *right; /* width * height bytes each, aligned to words */
    uint64_t t_ns;         /* middle of the exposure */
    volatile uint8_t state;
} capture_pair;

typedef struct capture {
    capture_pair pairs[2];
    uint16_t width, height; /* width: a multiple of four */
    uint16_t rows;          /* of a strip; divides the height */
    capture_pair *filling;  /* or NULL */
    uint16_t strip;         /* the one that is awaited */
    bool stamped, late;
    volatile uint32_t done;   /* pairs that were handed on */
    volatile uint32_t busy;   /* left out: neither pair was free */
    volatile uint32_t broken; /* left out: strips missing, overwritten, or no time */
} capture;

/* Pixels of a strip as the DMA writes them: a half-word for each place, seven bits of the left picture and above
 * them seven of the right. */
static inline uint32_t capture_strip_words(const capture *c) {
    return (uint32_t)c->rows * c->width / 2;
}

/* Interrupt: a picture is triggered. False: leave it out. One that is not complete by now is given up. */
bool capture_begin(capture *c);

/* Interrupt: the middle of its exposure. */
void capture_exposed(capture *c, uint64_t t_ns);

/* Interrupt: the bank that holds the awaited strip. */
static inline unsigned capture_bank(const capture *c) {
    return c->strip % CAPTURE_BANKS;
}

/* Interrupt: takes the awaited strip apart, and asks then which bank the DMA writes: if it is this one, the strip
 * was overwritten meanwhile. */
void capture_strip(capture *c, const volatile uint32_t *strip, unsigned (*written_now)(void));

/* Loop: the oldest pair that is full, or NULL. The one that was handed out before is free from now on. */
const capture_pair *capture_take(capture *c);

#endif
