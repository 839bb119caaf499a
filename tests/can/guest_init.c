// This program is process 1 of a User Mode Linux guest whose root is the host's file system. The
// program makes the guest usable (pseudo file systems, loopback, CAN modules). Then it runs `bash
// $focalfleet_run/command` with its output on the first console. At the end it leaves the exit
// status in $focalfleet_run/status and powers the guest off.
//
// The kernel passes unknown words of its command line to process 1 as environment. Therefore
// focalfleet_run, focalfleet_modules and focalfleet_vcan (parameters of that module) are plain
// environment variables here. The program is static, because it runs before anything is set up.
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

static void mount_pseudo_file_systems(void) {
  static const struct {
    const char* type;
    const char* where;
    const char* options;
  } table[] = {
      {"proc", "/proc", NULL},
      {"sysfs", "/sys", NULL},
      {"devtmpfs", "/dev", NULL},
      {"tmpfs", "/dev/shm", "mode=1777"},
      {"devpts", "/dev/pts", "ptmxmode=0666"},
      {"tmpfs", "/run", "mode=0755"},
  };
  for (size_t i = 0; i < sizeof table / sizeof table[0]; ++i) {
    if (strncmp(table[i].where, "/dev/", 5) == 0) mkdir(table[i].where, 0755);
    if (mount(table[i].type, table[i].where, table[i].type, 0, table[i].options) != 0)
      perror(table[i].where);
  }
  if (symlink("/proc/self/fd", "/dev/fd") != 0 && errno != EEXIST) perror("/dev/fd");
}

// The first console carries the command's output unchanged: no line discipline in between.
static void take_console(void) {
  const int in = open("/dev/null", O_RDONLY);
  const int out = open("/dev/tty1", O_WRONLY | O_NOCTTY);
  struct termios raw;
  if (out >= 0 && tcgetattr(out, &raw) == 0) {
    cfmakeraw(&raw);
    tcsetattr(out, TCSANOW, &raw);
  }
  if (in >= 0) dup2(in, 0);
  if (out >= 0) {
    dup2(out, 1);
    dup2(out, 2);
  }
}

// A kernel with CAN built in has no such files, and needs none.
static void load_modules(void) {
  static const char* const names[] = {"net/can/can",
                                      "net/can/can-raw",
                                      "drivers/net/can/dev/can-dev",
                                      "drivers/net/can/vcan",
                                      "drivers/net/can/slcan/slcan",
                                      "net/sched/sch_netem"};
  const char* folder = getenv("focalfleet_modules");
  struct utsname kernel;
  uname(&kernel);
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s/kernel/%s.ko", folder ? folder : "/usr/lib/uml/modules",
             kernel.release, names[i]);
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) continue;
    const char* vcan = getenv("focalfleet_vcan");
    const char* parameters = vcan != NULL && strstr(names[i], "/vcan") != NULL ? vcan : "";
    if (syscall(SYS_finit_module, file, parameters, 0) != 0 && errno != EEXIST) perror(path);
    close(file);
  }
}

static void raise_loopback(void) {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  struct ifreq request;
  memset(&request, 0, sizeof request);
  strcpy(request.ifr_name, "lo");
  request.ifr_flags = IFF_UP | IFF_RUNNING;
  if (ioctl(fd, SIOCSIFFLAGS, &request) != 0) perror("lo");
  close(fd);
}

// Process 1 also reaps orphans.
static int run_command(const char* script) {
  const pid_t child = fork();
  if (child == 0) {
    setsid();
    execl("/bin/bash", "bash", script, (char*)NULL);
    perror("/bin/bash");
    _exit(127);
  }
  for (;;) {
    int status = 0;
    const pid_t ended = wait(&status);
    if (ended < 0 && errno != EINTR) return 127;
    if (ended != child) continue;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  }
}

int main(void) {
  const char* run = getenv("focalfleet_run");
  mount_pseudo_file_systems();
  take_console();
  if (run != NULL) {
    char path[4096];
    load_modules();
    raise_loopback();
    snprintf(path, sizeof path, "%s/command", run);
    const int status = run_command(path);
    snprintf(path, sizeof path, "%s/status", run);
    FILE* file = fopen(path, "w");
    if (file != NULL) {
      fprintf(file, "%d\n", status);
      fclose(file);
    }
  }
  tcdrain(1);
  sync();
  reboot(RB_POWER_OFF);
  return 1;
}
