#!/usr/bin/python3
"""paused_host.py BIN SHIM [--seeds N] [--first-seed S] [--jobs J] [--clocks-off]: tests the daemon's statements on units' clocks and starts
while the host is busy. Each seed runs real programs on UNIX sockets, with 40 units, four times as fast as life. Configurations are applied
while daemon and simulation are stopped and continued (SIGSTOP), singly and both, and held up in mid-turn (SHIM, pauses.c). Instants and
lengths are drawn from the seed. The statements are compared with the truth. With --clocks-off some units' clocks are off by 1 %: all of
these have to be named, and no other one. The exit code is 1 where a statement was false, or a true one was missing."""

import argparse
import concurrent.futures
import csv
import io
import json
import os
import random
import re
import select
import signal
import socket
import sqlite3
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time

UNITS, UNITS_PER_BUS, SPEED = 40, 10, 4
LEAST_MS, MOST_MS = 10, 2000
ALLOWED_CLOCK_ERROR = 0.005  # PlanOptions::clock_error
CLOCK_OFF = 0.01
NAMED_BY = 16  # readings: the daemon keeps eight of a clock, and wide ones in a row may fill these
ROUNDED_S = 1e-4  # figures in texts are rounded to half of it
CONFIG = """
[fleet]
units = "units.csv"
[control]
socket = "control.sock"
[dds]
enabled = false
[bus]
port = "unix"
unix_directory = "."
[clock]
speed = {speed}
"""


class Lines:
    """Asks a program on its control socket."""

    PATIENCE_S = 60

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(self.PATIENCE_S)
        self.socket.connect(path)
        self.file = self.socket.makefile("rw")

    def ask(self, verb, **arguments):
        self.file.write(json.dumps({"id": 1, "verb": verb, "args": arguments}) + "\n")
        self.file.flush()
        while "result" not in (answer := json.loads(self.file.readline())):
            if "error" in answer:
                raise RuntimeError(answer["error"])
        return answer["result"]

    def close(self):
        self.file.close()
        self.socket.close()


class Watcher:
    """Repeats an action in a thread of its own, until the run is over."""

    def __init__(self, what, period_s, over):
        self.over = over
        self.trouble = None

        def run():
            try:
                while not self.over.is_set():
                    what()
                    self.over.wait(period_s)
            except Exception as error:  # end() reports it
                self.trouble = error

        self.thread = threading.Thread(target=run)
        self.thread.start()

    def end(self):
        self.over.set()
        self.thread.join()
        if self.trouble:
            raise self.trouble


class Pauser:
    """Stops one process or both, and lets them go on."""

    def __init__(self, seed, victims, gap_s):
        self.chance = random.Random(f"pauses {seed}")
        self.victims = victims
        self.gap_s = gap_s
        self.count = 0
        self.total_s = 0

    def __call__(self):
        wait_s = self.chance.uniform(0, 2 * self.gap_s)
        length_s = 1e-3 * LEAST_MS * (MOST_MS / LEAST_MS) ** self.chance.random()
        who = self.chance.choice([self.victims[:1], self.victims[1:], self.victims]) or self.victims
        time.sleep(wait_s)
        for victim in who:
            victim.send_signal(signal.SIGSTOP)
        time.sleep(length_s)
        for victim in who:
            victim.send_signal(signal.SIGCONT)
        self.count += 1
        self.total_s += length_s


class Eavesdropper:
    """Counts the clock answers of every unit."""

    CLOCK_ANSWER = 3 << 20 | 1 << 19

    def __init__(self, places):
        self.places = places  # by socket: units by node
        self.heard = {}  # by unit: time

    def __call__(self):
        ready, _, _ = select.select(list(self.places), [], [], 0.2)
        for bus in ready:
            try:
                while frame := bus.recv(16, socket.MSG_DONTWAIT):
                    number = struct.unpack_from("<I", frame)[0] & 0x1FFFFFFF
                    if number & (63 << 20 | 1 << 19) == self.CLOCK_ANSWER:
                        self.heard.setdefault(self.places[bus][number >> 11 & 255], []).append(time.time())
            except BlockingIOError:
                pass


class Night:
    """The run of one seed: a fleet of its own, in a folder of its own."""

    def __init__(self, options, seed, folder):
        self.options = options
        self.seed = seed
        self.folder = folder
        self.chance = random.Random(f"night {seed}")
        self.off = {}  # unit: error of its clock
        if options.clocks_off:
            for unit in self.chance.sample(range(1, UNITS + 1), 4):
                self.off[unit] = self.chance.choice([-CLOCK_OFF, CLOCK_OFF])
        self.false = set()  # statements that were made and are not true
        self.begun = {}  # (unit, move): start, as seen from time to time
        self.clocks = 0  # number of intervals checked
        self.errors = {}  # unit: true error of its clock
        self.wide_s = []
        self.over = threading.Event()

    def run(self, *command):
        return subprocess.run([os.path.join(self.options.bin, command[0]), *command[1:]], cwd=self.folder, check=True, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE).stdout

    def path(self, name):
        return os.path.join(self.folder, name)

    def begin(self):
        self.run("focalfleet", "layout", "hex", "--count", str(UNITS), "--units-per-bus", str(UNITS_PER_BUS), "--out", "units.csv", "--quiet")
        self.run("focalfleet", "targets", "--units", "units.csv", "--seed", str(self.seed), "--as", "state", "--out", "state.csv", "--quiet")
        with open(self.path("focalfleet.toml"), "w") as config:
            config.write(CONFIG.format(speed=SPEED))
        clocks = [word for unit, error in self.off.items() for word in ("--clock-error", f"{unit}={error}")]
        self.simulation = self.start("focalfleet-sim", "--units", "units.csv", "--state", "state.csv", "--unix-directory", ".", "--control",
                                     "sim.sock", "--speed", str(SPEED), "--seed", str(self.seed), *clocks)
        self.await_file("sim.sock")
        self.truth = Lines(self.path("sim.sock"))
        self.answers = self.eavesdrop()
        self.eavesdropping = Watcher(self.answers, 0, self.over)
        self.daemon = self.start("focalfleetd", "--config", "focalfleet.toml")
        self.await_file("control.sock")

    def start(self, program, *arguments):
        seed = self.seed * 2 + (program == "focalfleetd")
        environment = dict(os.environ, PAUSES=f"{seed},{LEAST_MS},{MOST_MS},{1e3 * self.options.gap_s}", PAUSES_LOG=f"{program}.pauses")
        if self.options.shim != "none" and (program == "focalfleetd" or not self.options.daemon_alone):
            environment["LD_PRELOAD"] = os.path.abspath(self.options.shim)
        with open(self.path(program + ".err"), "w") as log:
            return subprocess.Popen([os.path.join(self.options.bin, program), *arguments], cwd=self.folder, env=environment,
                                    stdout=log, stderr=log)

    def await_file(self, name):
        end = time.monotonic() + 60
        while True:
            try:
                Lines(self.path(name)).close()
                return
            except OSError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.05)

    # ---- the truth, and the daemon's statements

    def look_at_truth(self):
        for row in csv.DictReader(io.StringIO(self.truth.ask("truth")["csv"])):
            unit = int(row["unit_id"])
            self.errors[unit] = float(row["clock_error"])
            if row["began_s"]:
                self.begun[unit, int(row["last_move"])] = float(row["began_s"])

    def look_at_clocks(self):
        for unit, error in self.errors.copy().items():
            clock = self.said.ask("unit", unit_id=unit)["clock"]
            if clock["readings"] == 0:
                continue
            self.clocks += 1
            if abs(clock["rate_error"] - error) > clock["rate_bound"] + 1e-6:
                self.false.add(f"unit {unit}'s clock is off by {error:.6f}: {clock}")

    def look_at_starts(self):
        starts = self.said.ask("status")["configuration"]
        if starts and starts["starts_known"] > 0:
            self.starts[starts["id"]] = starts

    def judge_starts(self, moves):
        """Checks rounds in which all units reported when they began. The daemon states the widest of several rounds only."""
        for configuration, said in self.starts.items():
            rounds = [units for (of, _), units in moves.items() if of == configuration and len(units) == said["starts"] == said["starts_known"]]
            truths = [max(units.values()) - min(units.values()) for units in rounds if None not in units.values()]
            if not truths or len(truths) < len(rounds):
                continue
            least, most = said["start_skew_least_s"], said["start_skew_most_s"]
            self.wide_s.append(most - least)
            if not least <= said["start_skew_s"] <= most or not any(least - ROUNDED_S <= truth <= most + ROUNDED_S for truth in truths):
                self.false.add(f"configuration {configuration}: starts truly within {truths} s: {said}")

    def judge_alarm(self, text, moves):
        if match := re.match(r"unit (\d+)'s clock is ", text):
            if abs(self.errors[int(match[1])]) <= ALLOWED_CLOCK_ERROR:
                self.false_alarms.append(text)
        elif match := re.match(r"unit (\d+) \(bus \d+\) began ([\d.]+) to ([\d.]+) ms after unit (\d+) .*more than the ([\d.]+) ms", text):
            last, first = int(match[1]), int(match[4])
            least, most, allowed = (1e-3 * float(match[i]) for i in (2, 3, 5))
            apart = [units[last] - units[first] for units in moves.values() if units.get(last) and units.get(first)]
            if apart and not any(max(least - ROUNDED_S, allowed) <= truth <= most + ROUNDED_S for truth in apart):
                self.false_alarms.append(f"{text}; truly {apart}")
        elif "does not answer" in text:
            self.silences += 1
            if self.options.daemon_alone:
                self.false_alarms.append(text)
        elif match := re.match(r"unit (\d+) did not begin to move", text):
            if all(units[int(match[1])] for units in moves.values() if int(match[1]) in units):
                self.false_alarms.append(text)

    def judge(self):
        store = sqlite3.connect(self.path("focalfleet.db"))
        moves = {}  # (configuration, move): when its units truly began
        for configuration, move, unit in store.execute("SELECT configuration, move, unit_id FROM intent"):
            moves.setdefault((configuration, move), {})[unit] = self.begun.get((unit, move))
        self.judge_starts(moves)
        self.false_alarms = []
        self.silences = 0
        named = {}
        for text, at_ns in store.execute("SELECT text, at_ns FROM alarm ORDER BY id"):
            self.judge_alarm(text, moves)
            if match := re.match(r"unit (\d+)'s clock is ", text):
                named.setdefault(int(match[1]), 1e-9 * at_ns)
        store.close()
        heard = self.answers.heard
        self.readings = sum(len(times) for times in heard.values())
        # The answer that named the unit is one of those heard before; both are reported some milliseconds later.
        until = {unit: sum(when <= named.get(unit, time.time()) + 0.05 for when in heard.get(unit, [])) for unit in self.off}
        self.until_named = [count for unit, count in until.items() if unit in named]
        self.missed = sorted(set(self.off) - set(named))
        self.named_late = [f"unit {unit} after {count} readings" for unit, count in until.items() if count > NAMED_BY]

    # ---- the run

    def eavesdrop(self):
        places = {}
        with open(self.path("units.csv")) as text:
            for row in csv.DictReader(text):
                places.setdefault(row["bus_id"], {})[int(row["node_id"])] = int(row["unit_id"])
        buses = {}
        for bus, nodes in places.items():
            client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            client.connect(self.path(f"bus{bus}.sock"))
            buses[client] = nodes
        return Eavesdropper(buses)

    def watch(self):
        self.said = Lines(self.path("control.sock"))
        self.starts = {}

        def look():
            self.look_at_clocks()
            self.look_at_starts()

        self.look_at_truth()
        return [Watcher(self.look_at_truth, 0.2, self.over), Watcher(look, 0.7, self.over), self.eavesdropping]

    def live(self):
        self.begin()
        watchers = self.watch()
        victims = [self.daemon] if self.options.daemon_alone else [self.daemon, self.simulation]
        self.pauser = Pauser(self.seed, victims, self.options.gap_s)
        watchers.append(Watcher(self.pauser, 0.001, self.over))
        end = time.monotonic() + self.options.seconds
        self.configurations = 0
        while time.monotonic() < end and not any(watcher.trouble for watcher in watchers):
            self.configurations += 1
            self.apply(end)
            time.sleep(self.chance.uniform(0, 2))
        for watcher in watchers:
            watcher.end()
        self.look_at_truth()
        self.look_at_starts()
        self.said.close()
        self.end_programs()
        self.judge()
        logs = [self.path(name + ".pauses") for name in ("focalfleetd", "focalfleet-sim")]
        pauses = [open(log).read().split() for log in logs if os.path.exists(log)]
        self.pauses = self.pauser.count + sum(int(count) for count, _ in pauses)
        self.paused_s = self.pauser.total_s + sum(float(total_s) for _, total_s in pauses)

    def apply(self, end):
        """Applies a configuration. Its result is not checked: units that a pause silenced are refused, and it may outlast the run."""
        self.run("focalfleet", "targets", "--units", "units.csv", "--seed", str(1000 * self.seed + self.configurations), "--out",
                 "targets.csv", "--quiet")
        command = [os.path.join(self.options.bin, "focalfleet"), "apply", "targets.csv", "--wait", "--quiet"]
        applying = subprocess.Popen(command, cwd=self.folder, env=dict(os.environ, FOCALFLEET_SOCKET=self.path("control.sock")),
                                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            applying.wait(max(0, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            applying.terminate()
            applying.wait()

    def end_programs(self):
        for process in (self.daemon, self.simulation):
            process.send_signal(signal.SIGCONT)
            process.terminate()
        try:
            codes = [self.daemon.wait(60)]
        except subprocess.TimeoutExpired:  # it waits for its planner, which may take minutes for units that stand anywhere
            self.daemon.kill()
            self.daemon.wait()
            codes = [0]
        codes.append(self.simulation.wait(60))
        if codes != [0, 0]:
            raise RuntimeError(f"daemon and simulation ended with {codes}")


def live_through(options, seed):
    with tempfile.TemporaryDirectory(prefix="paused-host.") as folder:
        night = Night(options, seed, folder)
        try:
            night.live()
        except Exception as error:
            night.over.set()
            for name in ("daemon", "simulation"):
                if process := getattr(night, name, None):
                    process.kill()
            for name in ("focalfleetd.err", "focalfleet-sim.err"):
                if os.path.exists(night.path(name)):
                    print(f"seed {seed}: {name}: {open(night.path(name)).read()[-2000:]}", file=sys.stderr)
            print(f"seed {seed}: {error!r}")
            return None
        return night


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin")
    parser.add_argument("shim", help="pauses.so, or none")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=15, help="for which configurations are applied")
    parser.add_argument("--gap-s", type=float, default=0.7, help="mean, from one pause to the next")
    parser.add_argument("--clocks-off", action="store_true")
    parser.add_argument("--daemon-alone", action="store_true", help="is paused, and no unit is silent")
    options = parser.parse_args()
    options.bin = os.path.abspath(options.bin)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        nights = list(pool.map(lambda seed: live_through(options, seed), seeds))
    bad = nights.count(None)
    nights = [night for night in nights if night]
    for night in nights:
        for what, lines in (("false alarm", night.false_alarms), ("false", night.false), ("named late or never", night.named_late)):
            for line in lines:
                print(f"seed {night.seed}: {what}: {line}")
            bad += len(lines)
    until = [count for night in nights for count in night.until_named]
    wide_s = [wide for night in nights for wide in night.wide_s]
    total = lambda name: sum(getattr(night, name) for night in nights)
    count = lambda name: sum(len(getattr(night, name)) for night in nights)
    print("seeds configurations pauses paused_s readings clock_intervals skew_intervals false_intervals false_alarms off missed until_named_median "
          "until_named_most skew_interval_median_ms silences")
    print(len(nights), total("configurations"), total("pauses"), f"{total('paused_s'):.0f}", total("readings"), total("clocks"), len(wide_s),
          count("false"), count("false_alarms"), count("off"), count("missed"), statistics.median(until) if until else "-",
          max(until) if until else "-", f"{1e3 * statistics.median(wide_s):.1f}" if wide_s else "-", total("silences"))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
