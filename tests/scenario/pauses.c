// This LD_PRELOAD library holds a process' main thread up at the most sensitive instants. A busy
// host may take the processor away between any two instructions. A signal sent at random rarely
// meets the few microseconds in which a time has been read and not been used. The library holds the
// thread up right after it read the monotonic clock, before or after it reads frames, or before it
// sends some.
//
// PAUSES=SEED,LEAST_MS,MOST_MS,GAP_MS: lengths of equal share per octave from LEAST_MS to MOST_MS,
// gaps evenly from 0 to twice GAP_MS, both drawn from SEED. PAUSES_LOG: a file that gets "<pauses>
// <seconds>" when the process ends.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum Place { kClockRead, kBeforeReceive, kAfterReceive, kBeforeSend, kPlaces };

static struct {
  int on;
  uint64_t random;
  double least_ms;
  double most_ms;
  double gap_ms;
  int64_t due_ns;
  enum Place place;
  unsigned count;
  double total_s;
} state;

static int64_t now_ns(void) {
  struct timespec now;
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

// Generator splitmix64, scaled to 0..1.
static double draw(void) {
  uint64_t z = state.random += 0x9e3779b97f4a7c15u;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
  z = (z ^ z >> 27) * 0x94d049bb133111ebu;
  return (double)((z ^ z >> 31) >> 11) / 9007199254740992.0;
}

static void plan_next(void) {
  state.due_ns = now_ns() + (int64_t)(2e6 * state.gap_ms * draw());
  state.place = (enum Place)(kPlaces * draw());
}

__attribute__((constructor)) static void begin(void) {
  const char* text = getenv("PAUSES");
  unsigned long seed = 0;
  if (text == NULL || sscanf(text, "%lu,%lf,%lf,%lf", &seed, &state.least_ms, &state.most_ms,
                             &state.gap_ms) != 4)
    return;
  state.random = seed;
  plan_next();
  state.on = 1;
}

__attribute__((destructor)) static void end(void) {
  const char* path = getenv("PAUSES_LOG");
  FILE* log = state.on && path != NULL ? fopen(path, "w") : NULL;
  if (log == NULL) return;
  fprintf(log, "%u %.3f\n", state.count, state.total_s);
  fclose(log);
}

static void hold_up(enum Place place) {
  if (!state.on || syscall(SYS_gettid) != getpid()) return;
  if (place != state.place || now_ns() < state.due_ns) return;
  const int kept = errno;
  const double s = 1e-3 * state.least_ms * pow(state.most_ms / state.least_ms, draw());
  struct timespec left = {(time_t)s, (long)(1e9 * (s - floor(s)))};
  while (nanosleep(&left, &left) != 0 && errno == EINTR) {
  }
  ++state.count;
  state.total_s += s;
  plan_next();
  errno = kept;
}

int clock_gettime(clockid_t which, struct timespec* at) {
  static int (*real)(clockid_t, struct timespec*);
  if (real == NULL) *(void**)&real = dlsym(RTLD_NEXT, "clock_gettime");
  const int done = real(which, at);
  if (which == CLOCK_MONOTONIC) hold_up(kClockRead);
  return done;
}

int recvmmsg(int fd, struct mmsghdr* messages, unsigned count, int flags, struct timespec* wait) {
  static int (*real)(int, struct mmsghdr*, unsigned, int, struct timespec*);
  if (real == NULL) *(void**)&real = dlsym(RTLD_NEXT, "recvmmsg");
  hold_up(kBeforeReceive);
  const int got = real(fd, messages, count, flags, wait);
  hold_up(kAfterReceive);
  return got;
}

int sendmmsg(int fd, struct mmsghdr* messages, unsigned count, int flags) {
  static int (*real)(int, struct mmsghdr*, unsigned, int);
  if (real == NULL) *(void**)&real = dlsym(RTLD_NEXT, "sendmmsg");
  hold_up(kBeforeSend);
  return real(fd, messages, count, flags);
}
