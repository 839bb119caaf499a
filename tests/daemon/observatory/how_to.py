#!/usr/bin/python3
"""how_to.py FOCALFLEET SOURCE PROJECT: docs/observatories.md holds for small files of that project.

The commands of the page run as they stand. The tables that they make are compared with the geometry
from which make_files.py made the files; what goes out is what came in; broken robots do not move; rows
that are left out have their place and reason; wrong files are refused and leave nothing.
"""
import csv
import math
import os
import pathlib
import subprocess
import sys
import tempfile

from astropy.table import Table

import make_files

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
PAGE = pathlib.Path(sys.argv[2], "docs", "observatories.md").read_text()
PROJECT = sys.argv[3]
WRONG = []


def check(what, holds, shown=""):
    if not holds:
        WRONG.append(f"{what}: {shown}")


def run(words):
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True)


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def commands():
    """The lines of the page's section that begin with four blanks and the program's name."""
    name = {"desi": "DESI", "sdss": "SDSS", "pfs": "PFS", "moons": "MOONS"}[PROJECT]
    section = PAGE.split(f"## You run {name}-like robots")[1].split("\n## ")[0].replace("\\\n", " ")
    return [line.split()[1:] for line in section.splitlines() if line.startswith("    focalfleet ")]


def import_command():
    return next(words for words in commands() if words[0] == "import")


def fibre_of(unit, theta, phi):
    t = math.radians(theta + float(unit["theta_zero_deg"]))
    p = t + math.radians(phi + float(unit["phi_zero_deg"]))
    return (float(unit["base_x_mm"]) + float(unit["arm_theta_mm"]) * math.cos(t) +
            float(unit["arm_phi_mm"]) * math.cos(p),
            float(unit["base_y_mm"]) + float(unit["arm_theta_mm"]) * math.sin(t) +
            float(unit["arm_phi_mm"]) * math.sin(p))


def places_of_targets():
    """Where the project's own file wants each fibre, by unit; from the files, not from the import."""
    if PROJECT == "desi":
        table = Table.read("fiberassign.fits.gz", hdu="FIBERASSIGN")
        name = {int(r["petal_loc"]) * 1000 + int(r["device_loc"]): int(r["pos_id"][1:])
                for r in rows("calib.csv")}
        return {name[r["LOCATION"]]: (r["FIBERASSIGN_X"], r["FIBERASSIGN_Y"]) for r in table}
    if PROJECT == "pfs":
        table = Table.read("pfsDesign.fits", hdu="DESIGN")
        return {2605 - int(r["fiberId"]): tuple(r["pfiNominal"]) for r in table}
    if PROJECT == "moons":
        lines = [line.split() for line in open("targets.txt")]
        return {int(w[0]): (float(w[1]) * math.sin(math.radians(float(w[2]))),
                            float(w[1]) * math.cos(math.radians(float(w[2])))) for w in lines}
    return {}  # SDSS: angles


def places_that_came_back():
    if PROJECT == "desi":
        table = Table.read("fiberassign-done.fits")
        return {int(r["POS_ID"][1:]): (r["FIBERASSIGN_X"], r["FIBERASSIGN_Y"]) for r in table}
    if PROJECT == "pfs":
        table = Table.read("pfsDesign-done.fits")
        check("export", table["pfiNominal"].shape == (len(table), 2), table["pfiNominal"].shape)
        return {int(r["cobraId"]): tuple(r["pfiNominal"]) for r in table}
    if PROJECT == "moons":
        lines = [line.split() for line in open("targets-done.txt")]
        return {int(w[0]): (float(w[1]) * math.sin(math.radians(float(w[2]))),
                            float(w[1]) * math.cos(math.radians(float(w[2])))) for w in lines}
    return {}


def plan_serves_all(units):
    ends = {int(r["unit_id"]): {} for r in units}
    for row in rows("plan.csv"):
        ends[int(row["unit_id"])][row["axis"]] = float(row["to_deg"])
    broken = {int(r["unit_id"]) for r in rows("plate/disabled.csv")}
    check("plan", not any(ends[unit] for unit in broken), "a broken robot moves")
    state = {int(r["unit_id"]): r for r in rows("plate/state.csv")}
    place = {int(r["unit_id"]): r for r in units}
    worst = 0.0
    for target in rows("plate/targets.csv"):
        unit = int(target["unit_id"])
        end = {axis: ends[unit].get(axis, float(state[unit][f"{axis}_deg"]))
               for axis in ("theta", "phi")}
        at = fibre_of(place[unit], end["theta"], end["phi"])
        if target.get("x_mm"):
            wanted = float(target["x_mm"]), float(target["y_mm"])
        else:
            wanted = fibre_of(place[unit], float(target["theta_deg"]), float(target["phi_deg"]))
        worst = max(worst, math.dist(at, wanted))
    check("plan", worst < 0.02, f"a fibre ends {worst} mm off its target")
    print(f"{len(units)} units, {len(broken)} broken, {len(rows('plate/targets.csv'))} targets served, "
          f"worst {1e3 * worst:.1f} um")


def the_page():
    for words in commands():
        done = run(words)
        check(" ".join(words[:2]), done.returncode == 0, done.stderr)
    if WRONG:
        return
    units = rows("plate/units.csv")
    plan_serves_all(units)
    asked, back = places_of_targets(), places_that_came_back()
    taken = {int(r["unit_id"]) for r in rows("plate/targets.csv")}
    for unit in taken & set(asked):
        check("round trip", math.dist(asked[unit], back[unit]) < 0.02, f"{unit}: {asked[unit]} {back[unit]}")
    for row in rows("plate/left_out.csv"):
        check("left out", row["place"] and row["reason"], row)
    # Measured moves fit the geometry: the fibre is where the commanded angles put it.
    place = {r["unit_id"]: r for r in units}
    moves = rows("plate/moves.csv") if pathlib.Path("plate/moves.csv").exists() else []
    check("moves", bool(moves) == (PROJECT != "moons"), len(moves))
    for row in moves:
        if not row["x_mm"]:
            continue
        at = fibre_of(place[row["unit_id"]], float(row["theta_cmd_deg"]), float(row["phi_cmd_deg"]))
        off = math.dist(at, (float(row["x_mm"]), float(row["y_mm"])))
        check("moves", off < 0.02, f"unit {row['unit_id']} move {row['move_id']}: {off} mm off")
    check("moves", not moves or any(not row["x_mm"] for row in moves), "no place is missing")


def broken_files():
    """One wrong thing at a time: refused with file, place, column and reason, and nothing is written."""
    cases = {
        "desi": [("calib.csv", "3.0", None, []),
                 ("calib.csv", "\nM01003,", "\nM01002,", ["calib.csv:5: unit M01002: is there twice"]),
                 ("posstate.csv", "\nM01001,", "\nM01001,x", ["posstate.csv:3: column pos_t: 'x"]),
                 ("calib.csv", "length_r1", "length", ["calib.csv:1: column length_r1 is missing"])],
        "sdss": [("positionerTable.csv", "R+0C3", "R+9C3", ["positionerTable.csv:5: column holeID: 'R+9C3'"]),
                 ("wokCoords.csv", ",1,0,0,0,0,1", ",-1,0,0,0,0,1", ["its axes i, j are mirrored"]),
                 ("confSummary.par", "FIBERMAP 5 ", "FIBERMAP 5 5 ", ["confSummary.par:35: field mag: 1 elements are not 5"])],
        "pfs": [("SC01.xml", "<Positioner_Id>2<", "<Positioner_Id>1<",
                 ["SC01.xml:28: unit SC1 PID1: is there twice"]),
                ("SC01.xml", "<Pixel_scale>90.0<", "<Pixel_scale>0<",
                 ["SC01.xml:4: column Link1_Link_Length: ", "is no length in mm"]),
                ("fibres.csv", "2603", "2604", ["fibres.csv:3: column fiberId: 2604 is there twice"])],
        "moons": [("positioners.cfg", "INS.POS2.RFOCAL  ", "INS.POS2.RFOCAL  x", ["positioners.cfg:",
                   "key INS.POS2.RFOCAL: 'x"]),
                  ("targets.txt", " L ", " Q ", ["targets.txt:", "column parity: 'Q' is neither L nor R"]),
                  ("positioners.cfg", 'LOCK    "F"', 'LOCK    "Fault"', ["LOCK: 'Fault' is neither T nor F"]),
                  ("positioners.cfg", 'HEALTH  "T"', 'HEALTH  "BROKEN"', ["'BROKEN' is neither T nor F"]),
                  ("positioners.cfg", "INS.POS.LENGTH2", "INS.POS.LENGTHX",
                   ["key INS.POS.LENGTH2 is missing"])]}
    for name, old, new, reasons in cases[PROJECT]:
        if new is None:
            continue
        good = pathlib.Path(name).read_text()
        check(name, old in good, f"'{old}' is not in it")
        pathlib.Path(name).write_text(good.replace(old, new, 1))
        words = import_command()
        words[words.index("--out") + 1] = "none"
        done = run(words)
        check(name, done.returncode == 1, f"{old}: ends with {done.returncode}")
        for reason in reasons:
            check(name, reason in done.stderr, f"'{reason}' is not in: {done.stderr}")
        check(name, not pathlib.Path("none").exists(), "a folder was made")
        pathlib.Path(name).write_text(good)


def state_by(file):
    """state.csv of an import with this file of states."""
    words = import_command()
    words[words.index("--out") + 1] = "by_state"
    if "--state" in words:
        words[words.index("--state") + 1] = file
    else:
        words += ["--state", file]
    done = run(words)
    check(file, done.returncode == 0, done.stderr)
    return pathlib.Path("by_state/state.csv").read_text() if done.returncode == 0 else ""


def the_latest_state_counts():
    """The order of the rows says nothing, and declared units of angles count."""
    if PROJECT == "pfs":
        table = Table.read("cobra_move.csv")
        wanted = state_by("cobra_move.csv")
        table[::-1].write("reversed.csv")
        check("state", state_by("reversed.csv") == wanted, "rows in another order")
        for name in ("motor_target_theta", "motor_target_phi"):
            table[name] = [math.degrees(angle) for angle in table[name]]
            table[name].unit = "deg"
        table.write("degrees.ecsv")
        degrees = [(r["unit_id"], round(float(r["theta_deg"]), 6), round(float(r["phi_deg"]), 6))
                   for r in csv.DictReader(state_by("degrees.ecsv").splitlines())]
        check("state", degrees == [(r["unit_id"], round(float(r["theta_deg"]), 6), round(float(r["phi_deg"]), 6))
                                   for r in csv.DictReader(wanted.splitlines())], "declared degrees")
    if PROJECT == "desi":
        pathlib.Path("log.csv").write_text(
            "LOCATION,TIME,STATE,POS_T,POS_P\n1001,2026-01-01T00:00:00,0,2,151\n"
            "1001,2025-01-01T00:00:00,2,1,150\n")
        state_by("log.csv")
        left = rows("by_state/state.csv")
        check("state", any((r["theta_deg"], r["phi_deg"]) == ("2", "151") for r in left), "the latest row")


def nothing_goes_unsaid():
    """Columns that nobody reads are named once; robots at their stops stay; targets that are all left out end with 3."""
    if PROJECT == "moons":
        return
    words = import_command()
    words[words.index("--out") + 1] = "noted"
    if PROJECT == "sdss":
        pathlib.Path("low.csv").write_text("positionerID,alphaReport,betaReport\n5,-0.002,170\n7,-0.02,170\n")
        done = run([*words, "--state", "low.csv"])
        check("stop", "1 axes up to 0.01 degrees outside their range" in done.stderr, done.stderr)
        stands = {r["unit_id"]: r["theta_deg"] for r in rows("noted/state.csv")}
        broken = {r["unit_id"]: r["reason"] for r in rows("noted/disabled.csv")}
        check("stop", float(stands["5"]) == 0 and "5" not in broken, stands.get("5"))
        check("stop", broken.get("7", "").startswith("stands outside its range"), broken)
    layout = words[words.index("--layout") + 1]
    if layout.endswith(".csv"):
        text = pathlib.Path(layout).read_text().splitlines()
        pathlib.Path(layout).write_text("\n".join(f"{line},{'COLOUR' if k == 0 else 'red'}"
                                                  for k, line in enumerate(text)) + "\n")
        done = run(words)
        check("notes", f"{layout}: columns passed over: " in done.stderr and "COLOUR" in done.stderr, done.stderr)
        check("notes", done.stderr.count("COLOUR") == 1, done.stderr)
    ids = {"desi": "pos_id", "sdss": "positionerID", "pfs": "cobraId"}[PROJECT]
    names = {r["unit_id"]: r["name"] for r in rows("plate/origin.csv")}
    pathlib.Path("all.csv").write_text(f"{ids},reason\n" + "".join(
        f"{unit if PROJECT != 'desi' else names[unit]},broken\n" for unit in names))
    if "--disabled" in words:
        words[words.index("--disabled") + 1] = "all.csv"
    else:
        words += ["--disabled", "all.csv"]
    done = run(words)
    check("nothing served", done.returncode == 3, f"{done.returncode} {done.stderr}")


def fibres_go_out():
    """Measured fibres are in the project's file; an import of another project is refused."""
    units = rows("plate/units.csv")
    with open("fibres.csv.out", "w") as out:
        out.write("unit_id,x_mm,y_mm\n")
        for unit in units[:9]:
            out.write(f"{unit['unit_id']},{float(unit['base_x_mm']) + 1},{unit['base_y_mm']}\n")
    name = {"desi": "d.fits", "sdss": "d.par", "pfs": "d.fits", "moons": "d.txt"}[PROJECT]
    done = run(["export", PROJECT, "--import", "plate", "--fibres", "fibres.csv.out", "--out", name])
    check("fibres", done.returncode == 0, done.stderr)
    if PROJECT == "desi":
        table = Table.read(name)
        check("fibres", abs(table["FIBER_X"][0] - float(units[0]["base_x_mm"]) - 1) < 1e-9, "FIBER_X")
        check("fibres", math.isnan(table["FIBER_X"][20]), "a fibre that was not seen has a place")
    if PROJECT == "pfs":
        table = Table.read(name)
        check("fibres", abs(table["pfiCenter"][0][0] - float(units[0]["base_x_mm"]) - 1) < 1e-9, "pfiCenter")
    other = "sdss" if PROJECT != "sdss" else "desi"
    done = run(["export", other, "--import", "plate", "--out", "x"])
    check("another project", done.returncode == 1 and f"is not {other}" in done.stderr, done.stderr)


def main():
    with tempfile.TemporaryDirectory(prefix="observatory.") as folder:
        os.chdir(folder)
        make_files.make(PROJECT, ".", 80)
        the_page()
        if not WRONG:
            broken_files()
            the_latest_state_counts()
            nothing_goes_unsaid()
            fibres_go_out()
    for wrong in WRONG:
        print(wrong)
    return 1 if WRONG else 0


if __name__ == "__main__":
    sys.exit(main())
