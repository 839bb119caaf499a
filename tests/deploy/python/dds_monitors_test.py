"""Both example monitors, built as a user outside the project would, see all 5000 units.

    dds_monitors_test.py PROGRAMS BUILD_FOLDER
"""

import os
import pathlib
import re
import subprocess
import sys

from simulated_fleet import WAIT_S, SimulatedFleet

ROOT = pathlib.Path(__file__).resolve().parents[3]
UNITS = 5000


def build(example, folder):
    folder = pathlib.Path(folder, example)
    configure = ["cmake", "-S", ROOT / "docs/examples" / example, "-B", folder, "-G", "Ninja",
                 f"-DFOCALFLEET_IDL={ROOT / 'daemon/dds/focalfleet.idl'}"]  # fmt: skip
    for command in (configure, ["cmake", "--build", folder]):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning:" not in done.stdout + done.stderr, done.stdout + done.stderr
    return folder


def start(program, domain):
    loopback = {"CYCLONEDDS_URI": f"file://{ROOT}/deploy/cyclonedds.xml"}
    return subprocess.Popen(
        [program, str(domain), "--once", "--wait", str(WAIT_S)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | loopback)  # fmt: skip


def check(monitor, name, phases):
    printed, complaints = monitor.communicate()
    lines = printed.splitlines()
    last = lines[-1] if lines else ""
    assert monitor.returncode == 0, f"{name} ended with {monitor.returncode}: {last} {complaints}"
    states = [re.fullmatch(r"unit (\d+): (\w+), theta .* mm", line) for line in lines[:-1]]
    assert all(states), f"{name}: {[line for line, state in zip(lines, states) if not state][:3]}"
    seen = {int(state[1]) for state in states}
    assert seen == set(range(1, UNITS + 1)), f"{name} printed {len(seen)} units"
    assert phases is None or {state[2] for state in states} == phases, f"{name}: {last}"
    summary = rf"all {UNITS} of {UNITS} units seen \S+ s after discovery, \S+ s after joining"
    assert re.fullmatch(summary, last), last
    print(f"{name}: {last}", flush=True)


def main(programs, folder):
    monitors = {
        "Cyclone DDS": build("dds_monitor_c", folder) / "dds_monitor",
        "Fast DDS": build("dds_monitor_fastdds", folder) / "dds_monitor_fastdds",
    }
    with SimulatedFleet(programs, UNITS, speed=4, dds=True) as fleet:
        # The fleet rests, so what a late joiner sees is history alone.
        for name, program in monitors.items():
            check(start(program, fleet.domain), f"late joiner, {name}, fleet at rest", {"ready"})
        fleet.cli("apply", "targets.csv")
        for name, program in monitors.items():
            check(start(program, fleet.domain), f"late joiner, {name}, fleet busy", None)


main(*sys.argv[1:])
