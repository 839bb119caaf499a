#!/usr/bin/python3
"""formats_of_astropy.py FOCALFLEET: what astropy writes is read as the CSV that it was made from.

One plan is made from tables in every format that astropy writes; all plans must be the same. Units of
columns are other ones, values are masked, names are in capitals, columns stand beside that nobody
needs. What cannot be read is refused with file, row, column and reason.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy
from astropy.io import fits
from astropy.table import MaskedColumn, Table

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
WRONG = []


def run(*words):
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True)


def check(what, holds, shown=""):
    if not holds:
        WRONG.append(f"{what}: {shown}")


def plan(what, units="units.csv", targets="targets.csv", state="state.csv"):
    """The plan with one table in another form is the plan of the CSV tables."""
    made = run("plan", "--units", units, "--targets", targets, "--from", state, "--out", "other.csv")
    check(what, made.returncode == 0, made.stderr)
    if made.returncode == 0:
        check(what, pathlib.Path("other.csv").read_text() == PLAN, "another plan")
    return made.stderr


def refused(what, targets, *reasons):
    made = run("plan", "--units", "units.csv", "--targets", targets, "--from", "state.csv", "--out",
               "none.csv")
    check(what, made.returncode == 1, f"ends with {made.returncode}")
    for reason in reasons:
        check(what, reason in made.stderr, f"'{reason}' is not in: {made.stderr}")
    check(what, not pathlib.Path("none.csv").exists(), "a plan was written")


def columns_beside(table):
    """Columns that nobody needs, of every kind that astropy writes to FITS."""
    n = len(table)
    table["flag"] = numpy.arange(n) % 2 == 0
    table["matrix"] = numpy.zeros((n, 2, 2))
    table["spectrum"] = numpy.zeros((n, 500))
    table["complex"] = numpy.ones(n) * 1j
    table["masked"] = MaskedColumn(numpy.arange(n), mask=numpy.arange(n) % 3 == 0)
    table["words"] = ["a, \"b\" c"] * n
    table["big"] = numpy.full(n, 2**63 + 5, "u8")
    table["small"] = numpy.full(n, 7, "i2")
    return table


def formats():
    targets = Table.read("targets.csv", format="ascii.csv")
    plain = columns_beside(targets.copy())
    plain.write("t.fits")
    said = plan("FITS", targets="t.fits")
    check("FITS", "t.fits: a FITS file, 30 rows" in said, said)
    check("FITS", "complex" in said and "spectrum" in said, said)
    plan("FITS, .gz", targets=write(plain, "t.fits.gz"))

    capitals = Table({name.upper(): targets[name] for name in targets.colnames})
    fits.HDUList([fits.PrimaryHDU(numpy.zeros((3, 3))), fits.BinTableHDU(Table({"RA": [1.0]})),
                  fits.BinTableHDU(capitals, name="TARGETS")]).writeto("third.fits")
    check("FITS, third unit", "table 2 of 2 (TARGETS)" in plan("FITS", targets="third.fits"))

    narrow = Table({"unit_id": targets["unit_id"].astype("i2")})
    narrow["x_mm"] = targets["x_mm"] * 1e-3
    narrow["x_mm"].unit = "m"
    narrow["y_mm"] = targets["y_mm"] * 1e3
    narrow["y_mm"].unit = "um"
    for name in ("u.fits", "u.ecsv", "u.vot"):
        near(name, write(narrow, name))

    masked = Table(targets, masked=True)
    masked["theta_deg"] = MaskedColumn(numpy.zeros(30), mask=True, unit="rad")
    masked["phi_deg"] = MaskedColumn(numpy.zeros(30), mask=True, unit="rad")
    masked["target_id"] = MaskedColumn(["NGC 1"] * 30, mask=numpy.arange(30) % 2 == 0)
    for name in ("m.fits", "m.ecsv", "m.csv", "m.vot"):
        plan(f"masked, {name}", targets=write(masked, name))

    units = Table.read("units.csv", format="ascii.csv")
    units["enabled"] = units["enabled"].astype(bool)
    for name in ("units.fits", "units.ecsv", "units.vot"):
        plan(f"units, {name}", units=write(units, name))
    state = Table.read("state.csv", format="ascii.csv")
    plan("state", state=write(state, "state.fits"))
    state["theta_deg"] = numpy.radians(state["theta_deg"])
    state["theta_deg"].unit = "rad"
    near("state in rad", "targets.csv", state=write(state, "rad.ecsv"))
    pathlib.Path("t.json").write_text(json.dumps(
        [{name: row[name].item() for name in targets.colnames} for row in targets]))
    plan("JSON", targets="t.json")
    targets.write("tab.txt", format="ascii.tab")
    plan("tabs", targets="tab.txt")
    targets.write("blank.txt", format="ascii.basic")
    plan("blanks", targets="blank.txt")
    targets.write("semi.csv", format="ascii.csv", delimiter=";")
    plan("semicolons", targets="semi.csv")
    fortran = "".join(
        ",".join(cell if k == 0 or n == 0 else cell + "D+00" for k, cell in enumerate(line.split(",")))
        + "\r\n" for n, line in enumerate(pathlib.Path("targets.csv").read_text().splitlines()))
    pathlib.Path("dos.csv").write_bytes(b"\xef\xbb\xbf" + fortran.encode())
    plan("BOM, CRLF, numbers of Fortran", targets="dos.csv")


def write(table, name):
    if name.endswith(".vot"):
        table.write(name, format="votable")
    elif name.endswith(".csv"):
        table.write(name, format="ascii.csv")
    else:
        table.write(name)
    return name


def near(what, targets, state="state.csv"):
    """Numbers that were converted differ in the last bit: the plan is the same to a micrometre."""
    made = run("plan", "--units", "units.csv", "--targets", targets, "--from", state, "--out",
               "near.csv")
    check(what, made.returncode == 0, made.stderr)
    if made.returncode != 0:
        return
    a = Table.read("near.csv", format="ascii.csv")
    b = Table.read("plan.csv", format="ascii.csv")
    check(what, len(a) == len(b) and numpy.abs(a["to_deg"] - b["to_deg"]).max() < 0.01, "another plan")


def refusals():
    targets = Table.read("targets.csv", format="ascii.csv")
    wrong = targets.copy()
    wrong["x_mm"].unit = "deg"
    refused("a unit of another kind", write(wrong, "deg.fits"),
            "deg.fits: row 1: column x_mm: its unit is 'deg', which cannot be converted to mm")
    hole = Table(targets, masked=True)
    hole["x_mm"].mask[6] = True
    refused("a masked place", write(hole, "hole.fits"),
            "hole.fits: row 7: column x_mm: the value is missing")
    refused("a masked place", write(hole, "hole.ecsv"), "hole.ecsv:", "column x_mm: the value is missing")
    twice = targets.copy()
    twice["unit_id"][3] = twice["unit_id"][1]
    refused("a unit twice", write(twice, "twice.fits"), "twice.fits: row 4: unit",
            "named twice, first in row 2")
    lost = Table({"unit_id": targets["unit_id"], "x": targets["x_mm"], "y_mm": targets["y_mm"]})
    refused("no such column", write(lost, "lost.fits"), "lost.fits: column x_mm is missing; there are")
    far = targets.copy()
    far["x_mm"][[2, 5]] += 500
    refused("out of patrol", write(far, "far.fits"), "far.fits: row 3: unit", "far.fits: row 6: unit",
            "out of patrol")
    pathlib.Path("cut.fits").write_bytes(pathlib.Path("t.fits").read_bytes()[:6000])
    refused("cut short", "cut.fits", "cut.fits: ")
    image = fits.HDUList([fits.PrimaryHDU(numpy.zeros((5, 5)))])
    image.writeto("image.fits")
    refused("an image", "image.fits", "image.fits: there is no binary table in this FITS file")


def big_table():
    """A million rows of a table that is refused by its last row, in bounded time and memory."""
    n = 1_000_000
    table = Table({"unit_id": numpy.arange(n, dtype="i4") % 30 + 1, "x_mm": numpy.zeros(n),
                   "y_mm": numpy.zeros(n)})
    table.write("big.fits")
    made = run("plan", "--units", "units.csv", "--targets", "big.fits", "--from", "state.csv", "--out",
               "none.csv")
    check("big table", made.returncode == 1 and "and 999950 more rows" in made.stderr,
          made.stderr[-300:])


def campaign():
    """The folder of a campaign in FITS is diagnosed as the one in CSV."""
    run("simulate", "campaign", "--out", "night", "--units", "12", "--moves", "12", "--seed", "3", "-q")
    pathlib.Path("fits").mkdir()
    for name in ("moves", "units"):
        table = Table.read(f"night/{name}.csv", format="ascii.csv")
        table.write(f"fits/{name}.fits")
    answers = []
    for folder in ("night", "fits"):
        made = run("diagnose", folder, "--out", f"{folder}-report", "-q")
        check("campaign", made.returncode == 0, made.stderr)
        report = json.loads(pathlib.Path(f"{folder}-report/report.json").read_text())
        answers.append((report["verdict"], report["causes"]))
    check("campaign", answers[0] == answers[1], "the verdicts differ")


def main():
    global PLAN
    with tempfile.TemporaryDirectory(prefix="formats.") as folder:
        import os
        os.chdir(folder)
        run("layout", "hex", "--count", "30", "--out", "units.csv", "-q")
        run("targets", "--units", "units.csv", "--seed", "1", "--as", "state", "--out", "state.csv", "-q")
        run("targets", "--units", "units.csv", "--seed", "2", "--out", "targets.csv", "-q")
        run("plan", "--units", "units.csv", "--targets", "targets.csv", "--from", "state.csv", "--out",
            "plan.csv", "-q")
        PLAN = pathlib.Path("plan.csv").read_text()
        formats()
        refusals()
        big_table()
        campaign()
    for wrong in WRONG:
        print(wrong)
    return 1 if WRONG else 0


if __name__ == "__main__":
    sys.exit(main())
