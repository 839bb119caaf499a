// bare_can_loop INTERFACE... is the least that a program can do that hears frames on several CAN
// interfaces and answers each: wait, read one, write one. A second process asks, with 16 questions
// under way on each interface, so that there is always something to read. The program runs until
// SIGTERM. At the end the program prints one line of JSON. The line has the frames that passed
// (both ways) and the CPU time of the answering process alone.
#define _GNU_SOURCE
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { kInterfacesMax = 64, kEventsMax = 64, kUnderWay = 16 };
static const canid_t kQuestion = CAN_EFF_FLAG | 0x11080000;
static const canid_t kAnswer = CAN_EFF_FLAG | 0x11000000;

static void die(const char* what) {
  perror(what);
  exit(1);
}

static int open_interface(const char* name, canid_t hears) {
  const int fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK, CAN_RAW);
  const struct sockaddr_can address = {.can_family = AF_CAN,
                                       .can_ifindex = (int)if_nametoindex(name)};
  const struct can_filter filter = {.can_id = hears, .can_mask = CAN_EFF_FLAG | CAN_EFF_MASK};
  if (fd < 0 || setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, &filter, sizeof filter) != 0 ||
      bind(fd, (const struct sockaddr*)&address, sizeof address) != 0)
    die(name);
  return fd;
}

static void send_frame(int fd, canid_t id) {
  const struct can_frame frame = {.can_id = id, .can_dlc = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
  if (write(fd, &frame, sizeof frame) != (ssize_t)sizeof frame) die("write");
}

static volatile sig_atomic_t ended;
static void end(int signal) { ended = signal; }

// Waits, reads one frame and writes one, on every interface that has one. Returns the number in
// all.
static long loop(const int* fds, int count, canid_t id) {
  long frames = 0;
  const int epoll = epoll_create1(0);
  for (int i = 0; i < count; ++i) {
    struct epoll_event event = {.events = EPOLLIN, .data = {.fd = fds[i]}};
    if (epoll_ctl(epoll, EPOLL_CTL_ADD, fds[i], &event) != 0) die("epoll");
  }
  while (!ended) {
    struct epoll_event events[kEventsMax];
    const int ready = epoll_wait(epoll, events, kEventsMax, -1);
    for (int i = 0; i < ready; ++i) {
      struct can_frame frame;
      if (read(events[i].data.fd, &frame, sizeof frame) != (ssize_t)sizeof frame) die("read");
      send_frame(events[i].data.fd, id);
      frames += 2;
    }
  }
  return frames;
}

static double cpu_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

int main(int argument_count, char** arguments) {
  const int count = argument_count - 1;
  if (count < 1 || count > kInterfacesMax) {
    fprintf(stderr, "usage: bare_can_loop INTERFACE...\n");
    return 2;
  }
  int answers[kInterfacesMax], questions[kInterfacesMax];
  for (int i = 0; i < count; ++i) {
    answers[i] = open_interface(arguments[1 + i], kQuestion);
    questions[i] = open_interface(arguments[1 + i], kAnswer);
  }
  const pid_t peer = fork();
  if (peer == 0) {
    for (int i = 0; i < kUnderWay * count; ++i) send_frame(questions[i % count], kQuestion);
    loop(questions, count, kQuestion);
    _exit(0);
  }
  signal(SIGTERM, end);
  const double before_s = cpu_s();
  const long frames = loop(answers, count, kAnswer);
  const double took_s = cpu_s() - before_s;
  kill(peer, SIGKILL);
  waitpid(peer, NULL, 0);
  printf("{\"frames\":%ld,\"cpu_s\":%.2f,\"frames_per_cpu_s\":%.0f}\n", frames, took_s,
         (double)frames / took_s);
  return 0;
}
