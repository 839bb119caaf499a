#!/usr/bin/python3
"""killed_daemon.py BIN [--kills N] [--seed S] [--units U] [--speed X]: kills the real daemon (kill -9) at random instants under load. A fleet
of U units moves, a camera measures, DDS publishes, and the store is on a small file system of its own. In half of the kills units lose their
power shortly before or after, in a third of them the disk is full when the daemon dies. After each restart the store is compared with the
true shafts: nothing that was acknowledged is lost, nothing that is stored is false, no move began twice. No place is lost but that of a unit
which lost its power, and the daemon starts at the first attempt, within START_S. The last lines have the time from the start of the process
to its first answer, and to the moment at which all units have been read. The exit code is 1 where something was lost, false or late, and 77
where this machine lets nobody make a file system of one's own."""

import argparse
import csv
import io
import json
import os
import random
import sqlite3
import subprocess
import sys
import tempfile
import time

from paused_host import Lines

PATIENCE_S = 300
# A restart takes a second or two with 5000 units on two busy cores, until all of them have been read. Twenty times that is no slow machine.
START_S = 40
UNITS_PER_BUS = 100
STORE_BYTES = 192 << 20
LAG_VECTORS = 6  # of a rotor at rest behind its field, with rounding
SEEN_VECTORS = 400  # a place that the camera measured, away from the stretched arm
KNOWN, MEASURED = 1, 4  # witness: from here on there are limits; as a camera saw it
# Deadlines are in the fleet's time, but the time that real processes need does not shrink with it.
CONFIG = """
[fleet]
units = "units.csv"
[store]
path = "store/fleet.db"
[control]
socket = "control.sock"
[dds]
enabled = true
domain = {domain}
[bus]
port = "unix"
unix_directory = "."
[camera]
directory = "camera"
fiducials = "fiducials.csv"
patience_ms = 10000
[clock]
speed = {speed}
[timing]
reply_wait_ms = 1000
start_delay_ms = 2000
settle_margin_ms = 2000
silence_limit_ms = 20000
poll_period_ms = 4000
"""


class Fleet:
    """The programs in their folder."""

    def __init__(self, options, folder):
        self.options = options
        self.folder = folder
        self.daemon = None
        self.answers_s = []
        self.read_s = []

    def path(self, name):
        return os.path.join(self.folder, name)

    def run(self, *command):
        subprocess.run([os.path.join(self.options.bin, command[0]), *command[1:]], cwd=self.folder, check=True, stdout=subprocess.DEVNULL)

    def start(self, program, *arguments):
        with open(self.path(program + ".err"), "a") as log:
            return subprocess.Popen([os.path.join(self.options.bin, program), *arguments], cwd=self.folder, stdout=log, stderr=log)

    def begin(self):
        os.mkdir(self.path("store"))
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={STORE_BYTES}", "tmpfs", self.path("store")], check=True)
        self.run("focalfleet", "layout", "hex", "--count", str(self.options.units), "--units-per-bus", str(UNITS_PER_BUS), "--out",
                 "units.csv", "--fiducials", "40", "--fiducials-out", "fiducials.csv", "--quiet")
        self.run("focalfleet", "targets", "--units", "units.csv", "--seed", "1", "--as", "state", "--out", "state.csv", "--quiet")
        with open(self.path("focalfleet.toml"), "w") as config:
            config.write(CONFIG.format(speed=self.options.speed, domain=100 + self.options.seed % 100))
        self.simulation = self.start("focalfleet-sim", "--units", "units.csv", "--state", "state.csv", "--unix-directory", ".", "--control",
                                     "sim.sock", "--speed", str(self.options.speed), "--seed", str(self.options.seed), "--camera", "camera",
                                     "--fiducials", "fiducials.csv")
        self.await_("the simulation", lambda: self.connects("sim.sock"))

    def end(self):
        for process in (self.daemon, self.simulation):
            if process:
                process.kill()
                process.wait()
        subprocess.run(["umount", self.path("store")], check=False)

    def connects(self, name):
        try:
            Lines(self.path(name)).close()
            return True
        except OSError:
            return False

    def ask(self, name, verb, **arguments):
        lines = Lines(self.path(name))
        lines.socket.settimeout(PATIENCE_S)
        try:
            return lines.ask(verb, **arguments)
        finally:
            lines.close()

    def await_(self, what, done):
        end = time.monotonic() + PATIENCE_S
        while not done():
            if time.monotonic() > end:
                raise RuntimeError(f"waited in vain for {what}")
            time.sleep(0.02)

    def phases(self):
        return self.ask("control.sock", "status")["phases"]

    def start_daemon(self, wrong, without_power=0):
        begun = time.monotonic()
        self.daemon = self.start("focalfleetd", "--config", "focalfleet.toml")

        def answers():
            if self.daemon.poll() is not None:  # again, as the service manager does, to see what follows
                wrong.append(f"the daemon ended at its start with {self.daemon.returncode}")
                self.daemon = self.start("focalfleetd", "--config", "focalfleet.toml")
                time.sleep(0.2)
            return self.connects("control.sock")

        self.await_("the daemon", answers)
        self.phases()
        self.answers_s.append(time.monotonic() - begun)

        def are_read():
            phases = self.phases()
            return sum(phases.get(phase, 0) for phase in ("absent", "identifying")) <= without_power

        self.await_("units to be read", are_read)
        self.read_s.append(time.monotonic() - begun)
        if self.read_s[-1] > START_S:
            wrong.append(f"all units were read {self.read_s[-1]:.1f} s after the start, and {START_S} s are enough")

    def truth(self):
        text = self.ask("sim.sock", "truth")["csv"]
        rows = csv.DictReader(line for line in io.StringIO(text) if not line.startswith("#"))
        return {int(row["unit_id"]): row for row in rows}

    def rows(self, question):
        store = sqlite3.connect(f"file:{self.path('store/fleet.db')}?mode=ro", uri=True, timeout=30)
        try:
            return store.execute(question).fetchall()
        finally:
            store.close()

    def is_settled(self):
        if self.ask("control.sock", "status")["busy"] or self.rows("SELECT count(*) FROM intent WHERE ended_ns IS NULL")[0][0]:
            return False
        return all(row["state"] not in ("moving", "homing") for row in self.truth().values())


class Disk:
    """The store's file system, filled to its last byte."""

    def __init__(self, fleet):
        self.filler = fleet.path("store/filler")

    def fill(self):
        with open(self.filler, "wb", buffering=0) as file:
            try:
                for size in (1 << 20, 4096, 1):
                    try:
                        while file.write(b"\0" * size) == size:
                            pass
                    except OSError:
                        pass
            except OSError:
                pass

    def free(self):
        if os.path.exists(self.filler):
            os.remove(self.filler)


def check(fleet, disabled, wrong):
    truth = fleet.truth()
    for unit, axis, witness, low, high, offset in fleet.rows(
        "SELECT unit_id, axis, witness, low, high, offset FROM axis_state JOIN unit USING (serial)"
    ):
        row = truth[unit]
        at = float(row["phi_true_vectors" if axis else "theta_true_vectors"])
        slack = SEEN_VECTORS if witness == MEASURED or offset else LAG_VECTORS  # an offset is what the camera saw before
        if witness >= KNOWN and not low - slack <= at <= high + slack:
            wrong.append(f"unit {unit} axis {axis} is at {at:.1f}, stored is {low}..{high} (witness {witness})")
    for unit, row in truth.items():
        if int(row["begun_twice"]):
            wrong.append(f"unit {unit} began a move twice")
    if disabled:
        stored = fleet.rows(f"SELECT enabled, reason FROM unit WHERE unit_id = {disabled[0]}")
        if stored != [(0, disabled[1])]:
            wrong.append(f"unit {disabled[0]} was disabled, acknowledged, and the store has {stored}")
    if (health := fleet.rows("PRAGMA quick_check")) != [("ok",)]:
        wrong.append(f"the store is damaged: {health}")


def kill_once(fleet, number, disk):
    """The statements that were wrong."""
    chance = random.Random(f"kill {fleet.options.seed} {number}")
    wrong = []
    fleet.run("focalfleet", "targets", "--units", "units.csv", "--seed", str(chance.randrange(1, 1 << 30)), "--as", "targets", "--out",
              "targets.csv", "--quiet")
    with open(fleet.path("targets.csv")) as text:
        arguments = {"targets_csv": text.read(), "source": f"kill {number}"}
    if chance.random() < 0.3:
        arguments["corrections"] = 1
    span_s = chance.uniform(0, fleet.options.span_s)
    begun = time.monotonic()
    fleet.ask("control.sock", "apply", **arguments)
    disabled = None
    if chance.random() < 0.5:
        disabled = (chance.randrange(1, fleet.options.units + 1), f"before kill {number}")
        fleet.ask("control.sock", "disable", unit_ids=[disabled[0]], reason=disabled[1])
    time.sleep(max(0.0, span_s - (time.monotonic() - begun)))
    victims = chance.sample(range(1, fleet.options.units + 1), 20) if chance.random() < 0.5 else []
    cut_first = chance.random() < 0.5
    full = chance.random() < 1 / 3
    if full:
        disk.fill()
    cut = lambda: victims and fleet.ask("sim.sock", "power_cut", units=victims, seconds=chance.uniform(5, 60))
    if cut_first:
        cut()
    time.sleep(chance.uniform(0, 0.3))
    fleet.daemon.kill()
    fleet.daemon.wait()
    if not cut_first:
        cut()
    time.sleep(chance.uniform(0, 1.5))
    disk.free()
    fleet.start_daemon(wrong, len(victims))
    fleet.await_("all to settle", fleet.is_settled)
    check(fleet, disabled, wrong)
    if disabled:
        fleet.ask("control.sock", "enable", unit_ids=[disabled[0]])
    lost = {row[0] for row in fleet.rows("SELECT DISTINCT unit_id FROM axis_state JOIN unit USING (serial) WHERE witness < 3")}
    if not_explained := sorted(lost.difference(victims)):
        wrong.append(f"{len(not_explained)} units had their power all the time and lost their place: {not_explained[:20]}")
    if lost:
        fleet.ask("control.sock", "home", not_known=True, unproven=True, wait=True)
        fleet.await_("all to settle", fleet.is_settled)
        check(fleet, None, wrong)
    print(f"kill {number}: after {span_s:.1f} s, {len(victims)} units without power, disk {'full' if full else 'well'}, {len(lost)} units lost, "
          f"answers after {fleet.answers_s[-1]:.2f} s, read after {fleet.read_s[-1]:.2f} s, {len(wrong)} wrong", flush=True)
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin")
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--units", type=int, default=5000)
    parser.add_argument("--speed", type=float, default=5)
    parser.add_argument("--span-s", type=float, default=15, help="a kill comes so long after a configuration began, at most")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.bin = os.path.abspath(options.bin)
    if not options.inside:  # a namespace of mounts of its own, for the small file system
        if subprocess.run(["unshare", "-r", "-m", "true"], check=False).returncode:
            print("no namespace of mounts may be made here")
            return 77
        os.execvp("unshare", ["unshare", "-r", "-m", sys.executable, os.path.abspath(__file__), *sys.argv[1:], "--inside"])
    with tempfile.TemporaryDirectory() as folder:
        fleet = Fleet(options, folder)
        disk = Disk(fleet)
        wrong = []
        try:
            fleet.begin()
            fleet.start_daemon(wrong)
            fleet.await_("all to settle", fleet.is_settled)
            for number in range(options.kills):
                wrong += [f"kill {number}: {what}" for what in kill_once(fleet, number, disk)]
        finally:
            if sys.exc_info()[0]:
                for name in ("focalfleetd.err", "focalfleet-sim.err"):
                    subprocess.run(["tail", "-n", "20", fleet.path(name)], check=False)
            fleet.end()
    for what in wrong:
        print(f"WRONG {what}")
    for name, times in (("first answer", fleet.answers_s), ("all units read", fleet.read_s)):
        times = sorted(times)
        print(f"{name}: median {times[len(times) // 2]:.2f} s, most {times[-1]:.2f} s")
    print(f"{options.kills} kills of seed {options.seed}, {len(wrong)} wrong statements")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
