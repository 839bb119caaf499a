"""The operators' page in a real browser, against a real daemon with a simulated fleet.

  page_test.py PROGRAMS NODE_FOLDER OUT_FOLDER SCENARIO

SCENARIO: night, looks, past, study, tabs, tasks, calm, heap or plane. The steps are in page_steps.mjs, past_steps.mjs, task_steps.mjs, calm_steps.mjs,
heap_steps.mjs and plane_steps.mjs; they ask here for what the world around the page does: the daemon ends, comes back, a bus dies.
"""

import csv
import json
import pathlib
import sqlite3
import subprocess
import sys

from plane_fleet import WebPlane
from web_fleet import WebFleet

DAY_NS = 86_400_000_000_000
HERE = pathlib.Path(__file__).resolve().parent
COUNTS = {"night": 120, "looks": 5000, "past": 120, "study": 19, "tabs": 37, "tasks": 120, "calm": 120, "heap": 1000, "plane": 60}
PLACES = {"tabs": 3}  # for viewers


def world(fleet, line):
    """What the page's steps ask for."""
    word, *arguments = line.split()
    if word == "stop-daemon":
        fleet.stop_daemon()
    elif word == "start-daemon":
        fleet.start_daemon("heard")  # a unit has a fault
    elif word == "stop-sector":
        fleet.stop_sector(int(arguments[0]))
    elif word == "disable":
        fleet.cli("disable", arguments[0], "--reason", "its gear is worn")
    elif word == "yesterday":  # what the store has so far was a day before
        fleet.stop_daemon()
        with sqlite3.connect(fleet.folder / "focalfleet.db") as store:
            store.execute(f"UPDATE configuration SET began_ns = began_ns - {DAY_NS}, changed_ns = changed_ns - {DAY_NS}")
        fleet.start_daemon("heard")
    elif word == "fault":
        fleet.sim("fault", "--units", arguments[0], "--code", "over_temperature")
    elif word == "silence":
        fleet.sim("silence", "--units", arguments[0])
    elif word == "revoke":
        fleet.cli("token", "revoke", arguments[0], "--file", "tokens.csv")
    elif word == "apply":  # as another operator does
        fleet.cli("apply", "targets.csv")
    elif word == "targets":  # from where the units stand now
        (fleet.folder / "now.csv").write_text(fleet.cli("state"))
        fleet.cli("targets", "--units", "units.csv", "--from", "now.csv", "--seed", arguments[0],
                  "--as", "targets", "--out", "targets.csv", "--quiet")  # fmt: skip
    else:
        raise AssertionError(f"nobody knows {line}")


def table(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def make_campaign(fleet):
    """A campaign with backlash, whose k-th unit is at the place of the fleet's k-th."""
    folder = fleet.folder / "campaign"
    fleet.cli("simulate", "campaign", "--units", fleet.count, "--moves", 40, "--effect", "backlash:theta=0.1",
              "--out", folder, "--quiet")  # fmt: skip
    there = table(fleet.folder / "units.csv")
    units, moves = table(folder / "units.csv"), table(folder / "moves.csv")
    onto = {}
    for made, real in zip(units, there):
        onto[made["unit_id"]] = (real["unit_id"], *(float(real[axis]) - float(made[axis])
                                                    for axis in ("base_x_mm", "base_y_mm")))  # fmt: skip
    for rows, name, columns in ((units, "units", ("base_x_mm", "base_y_mm")), (moves, "moves", ("x_mm", "y_mm"))):
        for row in rows:
            row["unit_id"], *shift = onto[row["unit_id"]]
            row |= {column: float(row[column]) + by for column, by in zip(columns, shift)}
        with open(folder / f"{name}.csv", "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, rows[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    return folder


def run(fleet, node_folder, out, scenario):
    campaign = make_campaign(fleet) if scenario == "study" else ""
    given = {"campaign": str(campaign), "url": fleet.url, "tokens": fleet.tokens, "targets": str(fleet.folder / "targets.csv"),
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
    http = f"viewers_max = {PLACES.get(scenario, 16)}\n"
    Fleet = WebPlane if scenario == "plane" else WebFleet
    with Fleet(programs, COUNTS[scenario], speed=4, http=http, camera=scenario in ("study", "plane")) as fleet:
        return run(fleet, pathlib.Path(node_folder).resolve(), out.resolve(), scenario)


if __name__ == "__main__":
    sys.exit(main())
