"""Both example monitors, built as a user outside the project would, see all 5000 units.

    dds_monitors_test.py PROGRAMS BUILD_FOLDER
"""

import os
import re
import subprocess
import sys
import tempfile

from dds_examples import ROOT, build
from simulated_fleet import WAIT_S, SimulatedFleet

UNITS = 5000
LATE_JOINERS_MAX = 20  # a second or two each


class Monitor:
    """A monitor that runs until it has seen all. A file takes its lines, as nobody reads them yet."""

    def __init__(self, name, program, domain):
        self.name = name
        self._printed = tempfile.TemporaryFile("w+")
        loopback = {"CYCLONEDDS_URI": f"file://{ROOT}/deploy/cyclonedds.xml"}
        command = [program, str(domain), "--once", "--wait", str(WAIT_S)]
        self._process = subprocess.Popen(
            command, stdout=self._printed, stderr=subprocess.STDOUT, env=os.environ | loopback
        )

    def finish(self):
        """The exit code and the printed lines."""
        code = self._process.wait()
        with self._printed:
            self._printed.seek(0)
            return code, self._printed.read().splitlines()


def check(monitor):
    """Every unit was printed. Returns the count of states that are older than the monitor."""
    name = monitor.name
    code, lines = monitor.finish()
    last = lines[-1] if lines else ""
    assert code == 0, f"{name} ended with {code}: {last}"
    states = [re.fullmatch(r"unit (\d+): (\w+), theta .* mm", line) for line in lines[:-1]]
    assert all(states), f"{name}: {[line for line, state in zip(lines, states) if not state][:3]}"
    seen = {int(state[1]) for state in states}
    assert seen == set(range(1, UNITS + 1)), f"{name} printed {len(seen)} units"
    summary = rf"all {UNITS} of {UNITS} units seen \S+ s after discovery, \S+ s after joining; (\d+) from history"
    found = re.fullmatch(summary, last)
    assert found, last
    print(f"{name}: {last}", flush=True)
    return int(found[1])


def main(programs, folder):
    programs_of = {
        "Cyclone DDS": build("dds_monitor_c", folder) / "dds_monitor",
        "Fast DDS": build("dds_monitor_fastdds", folder) / "dds_monitor_fastdds",
    }
    fleet = SimulatedFleet(programs, UNITS, speed=1, dds=True, awaited="heard")

    def start(when):
        return [
            Monitor(f"{when}, {vendor}", program, fleet.domain)
            for vendor, program in programs_of.items()
        ]

    early = start("there before the daemon")
    with fleet:
        for monitor in early:
            check(monitor)
        # What a late joiner sees is history as soon as the fleet rests. Units that were just heard
        # still change: each is published again while a monitor looks for the daemon.
        for _ in range(LATE_JOINERS_MAX):
            if all([check(monitor) for monitor in start("late joiner, fleet at rest")]):
                break
        else:
            raise AssertionError("a late joiner got nothing that it was too late for")
        fleet.cli("apply", "targets.csv")
        for monitor in start("late joiner, fleet busy"):
            check(monitor)


main(*sys.argv[1:])
