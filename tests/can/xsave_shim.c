// This LD_PRELOAD library is for Debian 12's linux.uml. The kernel writes a traced process'
// extended registers with a buffer of fixed size. On a processor whose XSAVE area is larger (AMX)
// the host refuses the short write with EFAULT and the guest dies at once. The library completes
// the write to the host's size. Every component beyond the caller's buffer is marked as in its
// initial state.
#define _GNU_SOURCE
#include <cpuid.h>
#include <elf.h>
#include <errno.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum { kAreaMax = 64 * 1024, kHeaderOffset = 512, kComponents = 63 };

static size_t host_area_size(void) {
  static size_t size;
  if (size == 0) {
    unsigned a = 0, enabled = 0, c = 0, d = 0;
    __cpuid_count(0xd, 0, a, enabled, c, d);
    size = enabled;
  }
  return size;
}

// Components (cpuid leaf 0xd) that do not end within the first `size` bytes.
static uint64_t components_beyond(size_t size) {
  uint64_t beyond = 0;
  for (unsigned i = 2; i < kComponents; ++i) {
    unsigned length = 0, offset = 0, c = 0, d = 0;
    __cpuid_count(0xd, i, length, offset, c, d);
    if (length != 0 && (size_t)offset + length > size) beyond |= (uint64_t)1 << i;
  }
  return beyond;
}

static long write_registers(pid_t pid, void* kind, const struct iovec* given) {
  static unsigned char area[kAreaMax] __attribute__((aligned(64)));
  const size_t size = host_area_size();
  if (given->iov_len >= size || size > sizeof area || given->iov_len < kHeaderOffset + 8)
    return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, kind, given);
  memset(area, 0, size);
  memcpy(area, given->iov_base, given->iov_len);
  uint64_t present;
  memcpy(&present, area + kHeaderOffset, sizeof present);
  present &= ~components_beyond(given->iov_len);
  memcpy(area + kHeaderOffset, &present, sizeof present);
  struct iovec whole = {area, size};
  return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, kind, &whole);
}

long ptrace(enum __ptrace_request request, ...) {
  va_list arguments;
  va_start(arguments, request);
  const pid_t pid = va_arg(arguments, pid_t);
  void* address = va_arg(arguments, void*);
  void* data = va_arg(arguments, void*);
  va_end(arguments);

  switch (request) {
    case PTRACE_SETREGSET:
      if ((uintptr_t)address == NT_X86_XSTATE) return write_registers(pid, address, data);
      break;
    case PTRACE_PEEKTEXT:
    case PTRACE_PEEKDATA:
    case PTRACE_PEEKUSER: {
      // The C library returns the word; the system call stores it.
      long word = 0;
      if (syscall(SYS_ptrace, request, pid, address, &word) < 0) return -1;
      errno = 0;
      return word;
    }
    default:
      break;
  }
  return syscall(SYS_ptrace, request, pid, address, data);
}
