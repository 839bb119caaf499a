"""Compares camera-loop's files with the store and the truth, by readers from outside the project."""
import csv
import json
import math
import sqlite3
import sys


def fibres(fits, truth_file, store, summary_file):
    from astropy.table import Table

    table = Table.read(fits)
    rows = sqlite3.connect(f"file:{store}?mode=ro", uri=True).execute(
        "SELECT unit_id, x_mm, y_mm, target_x_mm, target_y_mm, error_um, status, var_x_mm2, cov_xy_mm2, var_y_mm2, target_id"
        " FROM measurement WHERE exposure = ? ORDER BY unit_id",
        (int(table.meta["EXPOSURE"]),),
    ).fetchall()
    assert len(rows) == len(table) == 100, (len(rows), len(table))
    assert str(table["X_MM"].unit) == "mm" and str(table["ERROR_UM"].unit) == "um"
    for row, (unit, x, y, target_x, target_y, error, status, *covariance, target_id) in zip(table, rows):
        assert row["UNIT_ID"] == unit
        assert row["STATUS_BITS"] == 1 << status, (unit, row["STATUS"], status)
        if row["STATUS"].strip() in ("measured", "did_not_move"):
            # The pipeline must get the store's values to the bit.
            assert (row["X_MM"], row["Y_MM"]) == (x, y), unit
            assert (row["TARGET_X_MM"], row["TARGET_Y_MM"]) == (target_x, target_y), unit
            assert row["ERROR_UM"] == error, unit
            assert [row["VAR_X_MM2"], row["COV_XY_MM2"], row["VAR_Y_MM2"]] == covariance and covariance[0] > 0, unit
        assert row["TARGET_ID"].strip() == target_id == f"target {unit}", unit
    with open(truth_file, newline="") as text:
        truth = {int(row["unit_id"]): row for row in csv.DictReader(text)}
    with open(summary_file) as text:
        unserved = {unit["unit_id"] for unit in json.load(text)["unserved"]}
    worst = 0
    for row in table:
        unit = int(row["UNIT_ID"])
        if row["STATUS"].strip() != "measured":
            continue
        off_um = 1e3 * math.hypot(float(truth[unit]["x_mm"]) - row["X_MM"], float(truth[unit]["y_mm"]) - row["Y_MM"])
        worst = max(worst, off_um)
        if unit not in unserved:
            missed_um = 1e3 * math.hypot(
                float(truth[unit]["x_mm"]) - row["TARGET_X_MM"], float(truth[unit]["y_mm"]) - row["TARGET_Y_MM"]
            )
            assert missed_um < 15 + 4 * 3 * math.sqrt(2), (unit, missed_um)
    assert worst < 20, worst
    print(f"astropy reads 100 rows as they are stored; measured places are within {worst:.1f} um of the truth")


KNOWN = "t_s delay_s rail_id rail_slot bus_id bus_slot movers_on_rail v_bus_V counter1 repeat drive_amplitude cycles_theta cycles_phi mode".split()


def campaign(folder, store, moves):
    database = sqlite3.connect(f"file:{store}?mode=ro", uri=True)
    exposures = [row[0] for row in database.execute("SELECT DISTINCT exposure FROM measurement ORDER BY exposure DESC LIMIT ?", (int(moves),))][::-1]
    assert len(exposures) == int(moves)
    measured = {
        (move, unit): (x, y, status, delay)
        for move, exposure in enumerate(exposures, start=1)
        for unit, x, y, status, delay in database.execute(
            "SELECT unit_id, x_mm, y_mm, status, delay_s FROM measurement WHERE exposure = ?", (exposure,)
        )
    }
    believed = {}
    with open(f"{folder}/moves.csv", newline="") as text:
        rows = list(csv.DictReader(text))
    for row in rows:
        key = int(row["move_id"]), int(row["unit_id"])
        x, y, status, delay = measured[key]
        assert (float(row["delay_s"]) if row["delay_s"] else None) == delay, key
        moved = (row["theta_from_deg"], row["phi_from_deg"]) != (row["theta_cmd_deg"], row["phi_cmd_deg"])
        assert not moved or (delay is not None and delay > 0), key
        unknown = [name for name in KNOWN if row[name] == "" and name not in ("delay_s", "rail_slot", "bus_slot")]
        assert not unknown, (key, unknown)
        if status <= 2:
            assert (float(row["x_mm"]), float(row["y_mm"])) == (x, y), key
        else:
            assert row["x_mm"] == "" and row["y_mm"] == "", key
        before = believed.get(key[1])
        if before is not None:
            assert (row["theta_from_deg"], row["phi_from_deg"]) == before, key
        believed[key[1]] = row["theta_cmd_deg"], row["phi_cmd_deg"]
    with open(f"{folder}/units.csv", newline="") as text:
        assert {int(row["unit_id"]) for row in csv.DictReader(text)} >= {int(row["unit_id"]) for row in rows}
    print(f"{len(rows)} rows of {moves} moves are what the store has, each move begins where the one before ended")


if len(sys.argv) == 5:
    fibres(*sys.argv[1:])
else:
    campaign(*sys.argv[1:])
