#!/usr/bin/python3
"""one_unit.py INTERFACE NODE [--lose FUNCTION,...]: a unit on a CAN interface, written from docs/protocol.md
alone, with python3-can. The unit answers, moves in real time, and prints a line of JSON for each motion that ended. The
first answer of each function named by --lose is not sent. On SIGTERM the program prints the unit's FLASH and ends."""

import argparse
import json
import signal
import struct
import sys
import time
import zlib

import can

# Functions of the identifier, with their priorities.
STOP, START, DONE, CLOCK, ARM, STAGE_BEGIN, STAGE_SEGMENT, CONFIRM, HOME, PROGRESS, STATUS, VECTOR, FAULT, IDENTIFY, \
    PARAMETER_READ, PARAMETER_WRITE = range(16)
PRIORITY = [0, 1, 2, 2, 3, 4, 4, 4, 4, 5, 5, 5, 5, 6, 6, 6]
NAMES = ["stop", "start", "done", "clock", "arm", "stage_begin", "stage_segment", "confirm", "home", "progress", "status",
         "vector", "fault", "identify", "parameter_read", "parameter_write"]
EVERY_UNIT = 255

REST, STAGING, ARMED, MOVING, HOMING, IN_FAULT, HOST_LOST = range(7)
ARRIVED, STOPPED, FAULTED, HOMED = range(4)
OK, WRONG_MOVE, INCOMPLETE, OUT_OF_RANGE, WRONG_STATE, BEGUN_BEFORE, BAD_VALUE, INTERRUPTED = range(8)
COUNTER1, REPEAT, SUBDIVISION, MODE, POSITION, MIN_POSITION, MAX_POSITION, HOME_POSITION, HOST_TIMEOUT_MS = range(9)
AXES = (0, 1)

TICK_S = 100e-6
TIMER_HZ = 144e6


def i24(data):
    return int.from_bytes(data, "little", signed=True)


def put24(value):
    return value.to_bytes(3, "little", signed=True)


class Flash:
    def __init__(self, serial):
        self.serial = serial
        self.begun = 0  # number of the last move begun
        self.count = 0  # number of moves begun
        self.marked = False
        self.host_timeout_ms = 5000
        self.position = [0, 40000]
        self.settings = [{COUNTER1: 500, REPEAT: 37, SUBDIVISION: 96, MODE: 0, MIN_POSITION: -48000,
                          MAX_POSITION: 48000, HOME_POSITION: -48000} for _ in AXES]
        self.settings[1].update({MIN_POSITION: -1000, HOME_POSITION: 48000})


class Run:
    """The path of an axis, from the instant at which it begins."""

    def __init__(self, start, segments, counter1, begin):
        self.pieces, free = [], begin
        at = start
        for ticks, delta, repeat in segments:
            first = max(begin + ticks * TICK_S, free)
            per_vector = repeat * counter1 / TIMER_HZ
            self.pieces.append((first, at, delta, per_vector))
            at += delta
            free = first + abs(delta) * per_vector
        self.start, self.end = start, free

    def applied(self, now):
        at = self.start
        for first, start, delta, per_vector in self.pieces:
            if now < first:
                break
            shown = min(abs(delta), int((now - first) / per_vector) + 1)
            at = start + (shown if delta > 0 else -shown)
        return at


class Unit:
    def __init__(self, bus, node, lose):
        self.bus, self.node, self.lose = bus, node, lose
        self.flash = Flash(0xC0FFEE)
        self.state, self.host_lost, self.restarted = REST, False, True
        self.resume = None  # (identifier, data received)
        self.drop_staged()
        self.granted_arm = self.granted_home = None
        self.runs = None
        self.powered_at = self.heard_at = time.monotonic()
        self.began_ticks = 0

    # ---- sending

    def send(self, function, sequence, data=b"", detail=0):
        if function in self.lose and sequence != 0:
            self.lose.discard(function)
            return
        identifier = (PRIORITY[function] << 26 | function << 20 | 1 << 19 | self.node << 11 | sequence << 3 | detail)
        self.bus.send(can.Message(arbitration_id=identifier, is_extended_id=True, data=data))

    def send_done(self, outcome, sequence):
        theta, phi = self.flash.position
        self.send(DONE, sequence, put24(theta) + put24(phi) + struct.pack("<H", self.flash.begun), outcome)

    # ---- staged moves

    def drop_staged(self):
        self.begin, self.segments, self.begins_at = None, [{}, {}], None

    def held_digest(self):
        move, mode = (self.begin[0], self.begin[2]) if self.begin else (0, 0)
        data = struct.pack("<HBBB", move, len(self.segments[0]), len(self.segments[1]), mode)
        for axis in AXES:
            for index in sorted(self.segments[axis]):
                ticks, delta, repeat = self.segments[axis][index]
                data += bytes([index]) + ticks.to_bytes(3, "little") + put24(delta) + bytes([repeat])
        return zlib.crc32(data)

    def judge(self, move):
        if move != 0 and move == self.flash.begun:
            return BEGUN_BEFORE
        if self.state not in (REST, STAGING, ARMED):
            return WRONG_STATE
        if self.begin is None or self.begin[0] != move:
            return WRONG_MOVE
        if self.flash.marked:
            return INTERRUPTED
        if any(len(self.segments[axis]) != self.begin[1][axis] for axis in AXES):
            return INCOMPLETE
        for axis in AXES:
            at, settings = self.flash.position[axis], self.flash.settings[axis]
            for index in sorted(self.segments[axis]):
                at += self.segments[axis][index][1]
                if not settings[MIN_POSITION] <= at <= settings[MAX_POSITION]:
                    return OUT_OF_RANGE
        return OK

    # ---- moving

    def position_now(self, axis):
        if self.runs is None:
            return self.flash.position[axis]
        return self.runs[axis].applied(time.monotonic())

    def begin_move(self):
        self.flash.marked, self.flash.begun = True, self.begin[0]
        self.flash.count = (self.flash.count + 1) & 0xFFFF
        begin = self.begins_at
        self.began_ticks = self.ticks_at(begin)
        self.runs = [Run(self.flash.position[axis],
                         [self.segments[axis][index] for index in sorted(self.segments[axis])],
                         self.flash.settings[axis][COUNTER1], begin) for axis in AXES]
        self.drop_staged()
        self.state = MOVING

    def end_motion(self, now):
        for axis in AXES:
            self.flash.position[axis] = self.runs[axis].applied(now)
        self.runs, self.flash.marked = None, False
        self.state = HOST_LOST if self.host_lost else REST

    def on_time(self):
        now = time.monotonic()
        if self.state == ARMED and self.begins_at is not None and now >= self.begins_at:
            self.begin_move()
        if self.state == MOVING and now >= max(run.end for run in self.runs):
            self.end_motion(now)
            self.send_done(ARRIVED, 0)
            print(json.dumps({"move": self.flash.begun, "arrived": self.flash.position}), flush=True)
        if not self.host_lost and now - self.heard_at >= self.flash.host_timeout_ms * 1e-3:
            self.host_lost = True
            if self.state in (REST, STAGING) or (self.state == ARMED and self.begins_at is None):
                self.drop_staged()
                self.state = HOST_LOST

    # ---- receiving

    def on_message(self, message):
        if not message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd:
            return
        identifier, data = message.arbitration_id, bytes(message.data)
        function, node = identifier >> 20 & 63, identifier >> 11 & 255
        if function > 15 or identifier >> 26 != PRIORITY[function] or identifier >> 19 & 1:
            return
        if node not in (self.node, EVERY_UNIT) or not self.well_formed(function, identifier & 7, data):
            return
        self.heard_at = time.monotonic()
        to_all = node == EVERY_UNIT
        if not to_all and not (function == STATUS and identifier & 7 == 1):
            self.resume = None
        if to_all and function in (ARM, STAGE_BEGIN, STAGE_SEGMENT, CONFIRM, HOME, PARAMETER_WRITE):
            return
        handler = getattr(self, "on_" + NAMES[function])
        handler(identifier >> 3 & 255, identifier & 7, data, (identifier, data, to_all))

    @staticmethod
    def well_formed(function, detail, data):
        length = {STOP: 0, START: 5, CLOCK: 0 if detail == 1 else 6, ARM: 6, STAGE_BEGIN: 5, STAGE_SEGMENT: 8, CONFIRM: 2,
                  HOME: 2, PROGRESS: 0, STATUS: 0, VECTOR: 0, FAULT: 0, IDENTIFY: 0, PARAMETER_READ: 1, PARAMETER_WRITE: 5}
        detail_max = 1 if function in (CLOCK, STAGE_SEGMENT, STATUS, VECTOR, FAULT, PARAMETER_READ, PARAMETER_WRITE) else 0
        if len(data) != length.get(function, -1) or detail > detail_max:
            return False
        if function == STAGE_BEGIN:
            return data[:2] != b"\0\0" and data[2] <= 15 and data[3] <= 15 and data[4] <= 2
        if function == STAGE_SEGMENT:
            return data[0] <= 14 and data[7] >= 1
        if function in (PARAMETER_READ, PARAMETER_WRITE):
            return data[0] <= HOST_TIMEOUT_MS
        return True

    def on_stop(self, sequence, _detail, _data, _frame):
        if self.state in (MOVING, HOMING):
            self.end_motion(time.monotonic())
        elif self.state in (STAGING, ARMED):
            self.state = REST
        self.drop_staged()
        self.send_done(STOPPED, sequence)

    def on_start(self, _sequence, _detail, data, _frame):
        move, ticks = struct.unpack("<H", data[:2])[0], int.from_bytes(data[2:5], "little")
        if self.state == ARMED and self.begins_at is None and not self.host_lost and move == self.begin[0]:
            self.begins_at = time.monotonic() + ticks * TICK_S

    def on_clock(self, sequence, detail, _data, _frame):
        if detail == 1:
            self.send(CLOCK, sequence, struct.pack("<II", self.ticks_at(time.monotonic()), self.began_ticks))

    def ticks_at(self, now):
        return int((now - self.powered_at) / TICK_S) & 0xFFFFFFFF

    def on_arm(self, sequence, _detail, data, frame):
        move, digest = struct.unpack("<HI", data)
        if move == self.flash.begun and self.granted_arm == frame[:2]:
            answer = OK
        else:
            answer = self.judge(move)
            if answer == OK and digest != self.held_digest():
                answer = INCOMPLETE
            if answer == OK:
                self.state, self.granted_arm = ARMED, frame[:2]
        self.send(ARM, sequence, struct.pack("<HB", move, answer))

    def on_stage_begin(self, _sequence, _detail, data, _frame):
        begin = (struct.unpack("<H", data[:2])[0], (data[2], data[3]), data[4])
        waits = self.begins_at is not None
        if self.host_lost or self.state not in (REST, STAGING, ARMED) or waits or begin == self.begin:
            return
        self.drop_staged()
        self.begin, self.state = begin, STAGING

    def on_stage_segment(self, _sequence, detail, data, _frame):
        if self.state == STAGING and data[0] < self.begin[1][detail]:
            self.segments[detail][data[0]] = (int.from_bytes(data[1:4], "little"), i24(data[4:7]), data[7])

    def on_confirm(self, sequence, _detail, data, _frame):
        move = struct.unpack("<H", data)[0]
        received = len(self.segments[0]) | len(self.segments[1]) << 4
        self.send(CONFIRM, sequence, struct.pack("<HIBB", move, self.held_digest(), received, self.judge(move)))

    def on_home(self, sequence, _detail, data, _frame):
        # The unit has no stops to drive to, so homing is always refused for its state.
        self.send(HOME, sequence, data + bytes([WRONG_STATE]))

    def on_progress(self, sequence, _detail, _data, _frame):
        data = b"".join(put24(self.position_now(axis)) for axis in AXES) + struct.pack("<H", self.flash.begun)
        self.send(PROGRESS, sequence, data, self.state)

    def on_status(self, sequence, detail, _data, frame):
        restarted = self.restarted
        if detail == 1:
            if self.resume and self.resume[0] == frame[0]:
                restarted = self.resume[1]
            self.resume = (frame[0], restarted)
            self.restarted = self.host_lost = False
            if self.state == HOST_LOST:
                self.state = REST
        interrupted = self.flash.marked and self.state not in (MOVING, HOMING)
        flags = 1 * interrupted | 2 * self.host_lost | 4 * restarted
        percent = 0
        if self.state == MOVING:
            begin, end = self.began_and_ends()
            percent = min(100, int((time.monotonic() - begin) * 100 / max(end - begin, 1e-6)))
        self.send(STATUS, sequence, struct.pack("<BBBBHH", self.state, 0, flags, percent, self.flash.begun, self.flash.count))

    def began_and_ends(self):
        begin = min(run.pieces[0][0] if run.pieces else run.end for run in self.runs)
        return begin, max(run.end for run in self.runs)

    def on_vector(self, sequence, detail, _data, _frame):
        subdivision = self.flash.settings[detail][SUBDIVISION]
        turns, vector = divmod(self.flash.position[detail], subdivision)
        self.send(VECTOR, sequence, struct.pack("<HHi", vector, subdivision, turns), detail)

    def on_fault(self, sequence, _detail, _data, _frame):
        self.send(FAULT, sequence, struct.pack("<BBHH", 0, 0, self.flash.begun, 0))

    def on_identify(self, sequence, _detail, _data, _frame):
        self.send(IDENTIFY, sequence, struct.pack("<IBBBB", self.flash.serial, 1, 3, 1, 4))

    def value_of(self, axis, parameter):
        if parameter == POSITION:
            return self.position_now(axis)
        if parameter == HOST_TIMEOUT_MS:
            return self.flash.host_timeout_ms
        return self.flash.settings[axis][parameter]

    def on_parameter_read(self, sequence, detail, data, _frame):
        value = self.value_of(detail, data[0])
        self.send(PARAMETER_READ, sequence, struct.pack("<BBi", data[0], OK, value), detail)

    def on_parameter_write(self, sequence, detail, data, _frame):
        parameter, value = struct.unpack("<Bi", data)
        # A host must set these parameters to move the unit; any other parameter is answered by BAD_VALUE.
        ranges = {COUNTER1: (50, 20000), REPEAT: (1, 255), MODE: (0, 2)}
        answer = BAD_VALUE
        if self.state != REST:
            answer = WRONG_STATE
        elif parameter in ranges and ranges[parameter][0] <= value <= ranges[parameter][1]:
            self.flash.settings[detail][parameter], answer = value, OK
        elif parameter == HOST_TIMEOUT_MS and 100 <= value <= 3600000:
            self.flash.host_timeout_ms, answer = value, OK
        self.send(PARAMETER_WRITE, sequence, struct.pack("<BBi", parameter, answer, self.value_of(detail, parameter)), detail)


class Ended(Exception):
    pass


def end(_signal, _frame):
    raise Ended


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("interface")
    parser.add_argument("node", type=int)
    parser.add_argument("--lose", default="")
    arguments = parser.parse_args()
    lose = {NAMES.index(name) for name in arguments.lose.split(",") if name}
    signal.signal(signal.SIGTERM, end)
    bus = can.Bus(channel=arguments.interface, interface="socketcan")
    unit = Unit(bus, arguments.node, lose)
    print(json.dumps({"ready": True}), flush=True)
    try:
        while True:
            message = bus.recv(timeout=0.005)
            if message is not None:
                unit.on_message(message)
            unit.on_time()
    except Ended:
        pass
    finally:
        bus.shutdown()
    print(json.dumps({"flash": {"position": unit.flash.position, "begun": unit.flash.begun, "count": unit.flash.count,
                                "marked": unit.flash.marked}, "not_lost": [NAMES[f] for f in unit.lose]}), flush=True)
    return 0


sys.exit(main())
