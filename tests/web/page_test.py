"""The operators' page in a real browser, against a real daemon with a simulated fleet.

  page_test.py PROGRAMS NODE_FOLDER OUT_FOLDER SCENARIO

SCENARIO: night or looks. The steps are in page_steps.mjs; they ask here for what the
world around the page does: the daemon ends, comes back, a bus dies.
"""

import json
import pathlib
import subprocess
import sys

from web_fleet import WebFleet

HERE = pathlib.Path(__file__).resolve().parent
COUNTS = {"night": 120, "looks": 5000}


def world(fleet, line):
    """What the page's steps ask for."""
    word, *arguments = line.split()
    if word == "stop-daemon":
        fleet.stop_daemon()
    elif word == "start-daemon":
        fleet.start_daemon("heard")  # a unit has a fault
    elif word == "fault":
        fleet.sim("fault", "--units", arguments[0], "--code", "over_temperature")
    elif word == "revoke":
        fleet.cli("token", "revoke", arguments[0], "--file", "tokens.csv")
    elif word == "targets":  # from where the units stand now
        (fleet.folder / "now.csv").write_text(fleet.cli("state"))
        fleet.cli("targets", "--units", "units.csv", "--from", "now.csv", "--seed", arguments[0],
                  "--as", "targets", "--out", "targets.csv", "--quiet")  # fmt: skip
    else:
        raise AssertionError(f"nobody knows {line}")


def run(fleet, node_folder, out, scenario):
    given = {"url": fleet.url, "tokens": fleet.tokens, "targets": str(fleet.folder / "targets.csv"),
             "nodeFolder": str(node_folder), "out": str(out), "scenario": scenario, "pid": fleet.daemon.pid,
             "count": fleet.count}  # fmt: skip
    steps = subprocess.Popen(["node", HERE / "page_steps.mjs", json.dumps(given)], stdin=subprocess.PIPE,
                             stdout=subprocess.PIPE, text=True, bufsize=1)  # fmt: skip
    try:
        for line in steps.stdout:
            if line.startswith("@"):
                world(fleet, line[1:].strip())
                steps.stdin.write("done\n")
                steps.stdin.flush()
            else:
                print(line, end="", flush=True)
        return steps.wait(timeout=60)
    finally:
        if steps.poll() is None:
            steps.kill()


def main():
    programs, node_folder, out, scenario = sys.argv[1:5]
    out = pathlib.Path(out)
    out.mkdir(parents=True, exist_ok=True)
    with WebFleet(programs, COUNTS[scenario], speed=4) as fleet:
        return run(fleet, pathlib.Path(node_folder).resolve(), out.resolve(), scenario)


if __name__ == "__main__":
    sys.exit(main())
