// SPDX-License-Identifier: MIT
/*
 * PLR_ASSERT: a check of what the library assumes about itself, such as the sizes that one function
 * passes to another. Bad input is never a matter for it: that is refused with a status. Off unless
 * the library is compiled with PLR_ASSERTIONS=1, as the project's tests are; it changes no result.
 */
#ifndef PELORUS_ASSERTIONS_H
#define PELORUS_ASSERTIONS_H

#ifdef __cplusplus
extern "C" {
#endif

/* Called where an assertion fails. The library has no such function: with PLR_ASSERTIONS=1 the
 * program that links it defines one, which must not return. */
void plr_assertion_failed(const char *condition, const char *file, int line);

/* 0 (default) or 1. */
#ifndef PLR_ASSERTIONS
#define PLR_ASSERTIONS 0
#endif

#if PLR_ASSERTIONS
#define PLR_ASSERT(condition)                                                                      \
    ((condition) ? (void)0 : plr_assertion_failed(#condition, __FILE__, __LINE__))
#else
#define PLR_ASSERT(condition) ((void)0)
#endif

#ifdef __cplusplus
}
#endif

#endif
