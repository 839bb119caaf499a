// FOCALFLEET_CHECK: the third kind of trouble, a bug in our own reasoning. It is always on, prints
// what was believed and where, and aborts: a restart is safe, because the store holds the intent
// before anything moves. Data from outside (a frame, a file, a row) never meets a CHECK before it
// met a validator.
//
// Without a hosted library (a unit's firmware) the board says what happens then: it stops the
// motors and resets.
#pragma once

#if __STDC_HOSTED__
#include <cstdio>
#include <cstdlib>

#define FOCALFLEET_CHECK(condition)                                                     \
  do {                                                                                  \
    if (!(condition)) [[unlikely]] {                                                    \
      std::fprintf(stderr, "focalfleet: %s:%d: check failed: %s\n", __FILE__, __LINE__, \
                   #condition);                                                         \
      std::abort();                                                                     \
    }                                                                                   \
  } while (false)
#else
extern "C" [[noreturn]] void focalfleet_check_failed(const char* file, int line);

#define FOCALFLEET_CHECK(condition)                \
  do {                                             \
    if (!(condition)) [[unlikely]]                 \
      focalfleet_check_failed(__FILE__, __LINE__); \
  } while (false)
#endif
