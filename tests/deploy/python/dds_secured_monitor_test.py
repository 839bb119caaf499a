"""DDS Security across vendors: the example monitor on Fast DDS reads a secured daemon on Cyclone DDS.

With a monitor's credentials it sees all units. With a camera's, those of another authority or none it gets nothing. A daemon
takes renewed credentials by itself, and the monitor sees all units by these.

    dds_secured_monitor_test.py PROGRAMS BUILD_FOLDER
"""

import subprocess
import sys
import time

from dds_examples import ROOT, build
from simulated_fleet import WAIT_S, SimulatedFleet

UNITS = 5000
HANDSHAKES_S = 8  # an admitted monitor takes 1.5 s; those who must get nothing are given this long


def run(program, domain, wait_s, *credentials):
    """The exit code, the last line, and the number of units that were printed."""
    command = [program, str(domain), "--once", "--wait", str(wait_s), *credentials]
    done = subprocess.run(command, capture_output=True, text=True)
    lines = done.stdout.splitlines()
    return done.returncode, (lines or [""])[-1], sum(line.startswith("unit ") for line in lines)


def make_keys(fleet, folder, *options):
    program = ROOT / "deploy/dds-security/make-keys"
    subprocess.run([program, folder, "--domain", str(fleet.domain), *options], check=True, capture_output=True)


def main(programs, folder):
    monitor = build("dds_monitor_fastdds", folder) / "dds_monitor_fastdds"
    with SimulatedFleet(programs, UNITS, speed=1, dds=True, awaited="heard", secured=True) as fleet:
        foreign = fleet.folder / "foreign"
        make_keys(fleet, foreign)
        code, last, _ = run(monitor, fleet.domain, WAIT_S, "--credentials", str(fleet.keys("monitor")))
        print(f"monitor: {last}", flush=True)
        assert code == 0 and last.startswith(f"all {UNITS} of {UNITS} units seen"), last
        for who, credentials in (
            ("nobody", []),
            ("camera", ["--credentials", str(fleet.keys("camera"))]),
            ("another authority's monitor", ["--credentials", str(foreign / "monitor")]),
        ):
            code, _, units = run(monitor, fleet.domain, HANDSHAKES_S, *credentials)
            print(f"{who}: {units} units", flush=True)
            assert code != 0 and units == 0, f"{who}: exit {code}, {units} units"
        make_keys(fleet, fleet.folder / "keys", "--only", "daemon:daemon")
        until = time.monotonic() + WAIT_S
        while "a new participant has taken the place of the old one" not in (fleet.folder / "daemon.err").read_text():
            assert time.monotonic() < until, "the daemon does not take renewed credentials"
            time.sleep(0.5)
        code, last, _ = run(monitor, fleet.domain, WAIT_S, "--credentials", str(fleet.keys("monitor")))
        print(f"monitor, after the renewal: {last}", flush=True)
        assert code == 0 and last.startswith(f"all {UNITS} of {UNITS} units seen"), last


main(*sys.argv[1:])
