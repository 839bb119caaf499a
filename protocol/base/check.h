// FOCALFLEET_CHECK guards against the third kind of trouble, a bug in this project's own reasoning.
// The check is always on; it prints the condition and the place, and aborts. A restart is safe,
// because the store holds the intent before anything moves. Data from outside (a frame, a file, a
// row) passes a validator before any check.
//
// Without a hosted library (a unit's firmware) the board decides what follows a failed check: it
// stops the motors and resets.
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
