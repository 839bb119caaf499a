// slcan_buses COUNT emulates COUNT CAN controllers behind serial lines (slcan), each on a bus of
// its own with the units of vcanN. To the kernel a controller is a real one. Each has bit timing,
// states, error counters and a driver, and can be pulled out of the machine. The program prints
// "ready" and then the messages of the drivers.
//
// Commands on stdin, one a line; bus N of 0..COUNT-1:
//   raw N TEXT    the controller sends its driver TEXT: "e2ab" (errors: no acknowledgement, bit),
//                 "sw096000", "sp128000" (warning, passive, with rx and tx counters) ...
//   busoff N      it goes bus-off: nothing passes until its driver closes and opens it again
//   unplug N      it leaves the machine; its interface vanishes
//   plug N        another one takes its place, closed, without a bit rate
//   count N       prints how many frames it carried each way
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <pty.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

enum { kBusesMax = 16, kDisciplineSlcan = 17, kTextMax = 4096 };

struct bus {
  int master;  // the controller's end of the serial line; -1: unplugged
  int slave;   // keeps the line discipline alive
  int units;   // CAN_RAW on vcanN
  int off;     // bus-off
  int length;
  char text[kTextMax];
  unsigned long down, up;  // frames to and from the units
};
static struct bus buses[kBusesMax];

static void die(const char* what) {
  perror(what);
  exit(1);
}

static void plug(struct bus* bus) {
  struct termios raw;
  memset(&raw, 0, sizeof raw);
  cfmakeraw(&raw);
  raw.c_cflag |= CS8 | CREAD | CLOCAL;
  cfsetspeed(&raw, B3000000);
  if (openpty(&bus->master, &bus->slave, NULL, &raw, NULL) != 0) die("openpty");
  const int discipline = kDisciplineSlcan;
  if (ioctl(bus->slave, TIOCSETD, &discipline) != 0) die("slcan");
  fcntl(bus->master, F_SETFL, O_NONBLOCK);
  bus->off = 0;
  bus->length = 0;
}

static void unplug(struct bus* bus) {
  if (bus->master < 0) return;
  close(bus->slave);
  close(bus->master);
  bus->master = -1;
}

static void open_units(struct bus* bus, int number) {
  char name[IFNAMSIZ];
  snprintf(name, sizeof name, "vcan%d", number);
  bus->units = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK, CAN_RAW);
  struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(name)};
  const int bytes = 4 << 20;
  setsockopt(bus->units, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes);
  if (bus->units < 0 || bind(bus->units, (struct sockaddr*)&address, sizeof address) != 0)
    die(name);
}

static void tell(struct bus* bus, const char* text) {
  if (bus->master < 0) return;
  char line[128];
  const int length = snprintf(line, sizeof line, "%s\r", text);
  // The driver reads at once; a full line makes the loop wait.
  for (int done = 0; done < length;) {
    const ssize_t now = write(bus->master, line + done, (size_t)(length - done));
    if (now > 0) done += (int)now;
    if (now < 0 && errno != EAGAIN) return;
  }
}

// The driver's text "Tiiiiiiiildd.." is one frame for the bus.
static void send_down(struct bus* bus, const char* text) {
  struct can_frame frame;
  memset(&frame, 0, sizeof frame);
  unsigned id = 0, length = 0;
  if (sscanf(text, "T%8x%1u", &id, &length) != 2 || length > 8) return;
  frame.can_id = id | CAN_EFF_FLAG;
  frame.can_dlc = (unsigned char)length;
  for (unsigned i = 0; i < length; ++i) {
    unsigned byte = 0;
    if (sscanf(text + 10 + 2 * i, "%2x", &byte) != 1) return;
    frame.data[i] = (unsigned char)byte;
  }
  while (write(bus->units, &frame, sizeof frame) < 0 && (errno == EAGAIN || errno == ENOBUFS)) {
  }
  ++bus->down;
}

static void from_driver(struct bus* bus, int number) {
  const ssize_t got = read(bus->master, bus->text + bus->length, (size_t)(kTextMax - bus->length));
  if (got <= 0) return;
  bus->length += (int)got;
  int begin = 0;
  for (int i = 0; i < bus->length; ++i) {
    if (bus->text[i] != '\r') continue;
    bus->text[i] = 0;
    const char* line = bus->text + begin;
    begin = i + 1;
    if (line[0] == 'T') {
      if (!bus->off) send_down(bus, line);
      continue;
    }
    printf("driver %d %s\n", number, line);
    if (line[0] == 'O') bus->off = 0;
  }
  memmove(bus->text, bus->text + begin, (size_t)(bus->length - begin));
  bus->length -= begin;
}

static void from_units(struct bus* bus) {
  struct can_frame frame;
  while (read(bus->units, &frame, sizeof frame) == (ssize_t)sizeof frame) {
    if (bus->off || bus->master < 0 || (frame.can_id & CAN_EFF_FLAG) == 0) continue;
    char text[64];
    int at = snprintf(text, sizeof text, "T%08X%d", frame.can_id & CAN_EFF_MASK, frame.can_dlc);
    for (int i = 0; i < frame.can_dlc; ++i)
      at += snprintf(text + at, sizeof text - (size_t)at, "%02X", frame.data[i]);
    tell(bus, text);
    ++bus->up;
  }
}

static void obey(char* line, int count) {
  char what[16] = "", text[64] = "";
  int number = 0;
  if (sscanf(line, "%15s %d %63s", what, &number, text) < 2 || number < 0 || number >= count) {
    fprintf(stderr, "slcan_buses: not understood: %s\n", line);
    return;
  }
  struct bus* bus = &buses[number];
  if (strcmp(what, "raw") == 0) tell(bus, text);
  if (strcmp(what, "busoff") == 0) {
    tell(bus, "sb000256");
    bus->off = 1;
  }
  if (strcmp(what, "unplug") == 0) unplug(bus);
  if (strcmp(what, "plug") == 0 && bus->master < 0) plug(bus);
  if (strcmp(what, "count") == 0) printf("count %d %lu down %lu up\n", number, bus->down, bus->up);
}

// Reads a command. False: the end of the commands.
static int from_stdin(int count) {
  static char text[1024];
  static int length = 0;
  const ssize_t got = read(0, text + length, sizeof text - 1 - (size_t)length);
  if (got <= 0) return 0;
  length += (int)got;
  text[length] = 0;
  char* begin = text;
  for (char* end; (end = strchr(begin, '\n')) != NULL; begin = end + 1) {
    *end = 0;
    obey(begin, count);
  }
  length -= (int)(begin - text);
  memmove(text, begin, (size_t)length);
  return 1;
}

int main(int argument_count, char** arguments) {
  const int count = argument_count == 2 ? atoi(arguments[1]) : 0;
  if (count < 1 || count > kBusesMax) {
    fprintf(stderr, "usage: slcan_buses COUNT (1..%d)\n", kBusesMax);
    return 2;
  }
  setvbuf(stdout, NULL, _IOLBF, 0);
  for (int i = 0; i < count; ++i) {
    plug(&buses[i]);
    open_units(&buses[i], i);
  }
  puts("ready");
  for (;;) {
    struct pollfd polls[2 * kBusesMax + 1];
    for (int i = 0; i < count; ++i) {
      polls[2 * i] = (struct pollfd){.fd = buses[i].master, .events = POLLIN};
      polls[2 * i + 1] = (struct pollfd){.fd = buses[i].units, .events = POLLIN};
    }
    polls[2 * count] = (struct pollfd){.fd = 0, .events = POLLIN};
    if (poll(polls, (nfds_t)(2 * count + 1), -1) < 0) die("poll");
    for (int i = 0; i < count; ++i) {
      if (polls[2 * i].revents & POLLIN) from_driver(&buses[i], i);
      if (polls[2 * i + 1].revents & POLLIN) from_units(&buses[i]);
    }
    if (polls[2 * count].revents != 0 && !from_stdin(count)) return 0;
  }
}
