"""Tables as the daemon's CSV, with astropy and without."""

import pathlib
import tempfile
import unittest
import warnings

import astropy.units as u
import numpy as np
from astropy.table import MaskedColumn, QTable, Table
from astropy.utils.masked import Masked
from focalfleet.errors import InvalidInput
from focalfleet.results import measurement_of, table_of
from focalfleet.tables import targets_csv


def lines(targets):
    return targets_csv(targets)[0].splitlines()


class Targets(unittest.TestCase):
    def test_units_are_converted_in_any_order_and_case(self):
        table = QTable({"TARGET_ID": ["a", "b"], "Y": [1500.0, 2500.0] * u.um})
        table["x"] = [0.25, 0.5] * u.cm
        table["UNIT_ID"] = np.array([7, 8], dtype=np.int16)
        expected = ["target_id,y_mm,x_mm,unit_id", "a,1.5,2.5,7", "b,2.5,5.0,8"]
        self.assertEqual(lines(table), expected)

    def test_angles(self):
        table = QTable({"unit_id": [1], "theta": [np.pi / 2] * u.rad, "phi": [30.0] * u.arcmin})
        self.assertEqual(lines(table), ["unit_id,theta_deg,phi_deg", "1,90.0,0.5"])

    def test_a_unit_wins_over_the_name(self):
        table = Table({"unit_id": [1], "x_mm": [1000.0], "y_mm": [2.0]})
        table["x_mm"].unit = u.um
        self.assertEqual(lines(table), ["unit_id,x_mm,y_mm", "1,1.0,2.0"])

    def test_masked_rows_have_no_target(self):
        expected = ["unit_id,x_mm,y_mm", "1,0.5,1.0", "# row 1 has no target", "3,2.5,3.0"]
        x, y, hidden = [0.5, np.nan, 2.5], [1.0, 9.0, 3.0], [False, True, False]
        masked = QTable({"unit_id": [1, 2, 3]})
        masked["x"] = Masked(x, mask=hidden) * u.mm
        masked["y"] = Masked(y, mask=hidden) * u.mm
        self.assertEqual(lines(masked), expected)
        columns = Table({"unit_id": [1, 2, 3]})
        columns["x_mm"] = MaskedColumn(x, mask=hidden)
        columns["y_mm"] = MaskedColumn(y, mask=hidden, unit=u.mm)
        self.assertEqual(lines(columns), expected)
        dicts = [{"unit_id": 1, "x_mm": 0.5, "y_mm": 1.0}, {"unit_id": 2}]
        dicts.append({"y_mm": 3.0, "x_mm": np.float64(2.5), "unit_id": np.int64(3)})
        self.assertEqual(lines(dicts), expected)

    def test_half_a_place_is_for_the_daemon_to_refuse(self):
        self.assertEqual(lines([{"unit_id": 1, "x_mm": 1.0, "y_mm": None}])[1], "1,1.0,")

    def test_places_and_angles_in_one_table(self):
        rows = [{"unit_id": 1, "x_mm": 1, "y_mm": 2}, {"unit_id": 2, "theta_deg": 3, "phi_deg": 4}]
        self.assertEqual(lines(rows), ["unit_id,x_mm,y_mm,theta_deg,phi_deg", "1,1,2,,", "2,,,3,4"])

    def test_dicts_with_quantities(self):
        self.assertEqual(lines([{"unit_id": 1, "x": 5 * u.um, "y": 1 * u.m}])[1], "1,0.005,1000.0")

    def test_what_is_no_number_is_refused_with_its_row(self):
        for bad in (np.nan, np.inf):
            table = QTable({"unit_id": [7, 8], "x": [1.0, bad] * u.mm, "y": [1.0, 2.0] * u.mm})
            with self.assertRaisesRegex(InvalidInput, r"row 1 \(unit 8\): x_mm is (nan|inf); mask"):
                lines(table)
        with self.assertRaisesRegex(InvalidInput, r"row 0 \(unit 3\): y_mm is nan"):
            lines([{"unit_id": 3, "x_mm": 1.0, "y_mm": float("nan")}])

    def test_wrong_columns_are_refused(self):
        for table, said in (
            (Table({"unit_id": [1], "x": [1.0], "y": [1.0]}), "x has no unit.*call it x_mm"),
            (QTable({"unit_id": [1], "x": [1.0] * u.s}), "x: s cannot be converted to mm"),
            (Table({"x_mm": [1.0], "X_MM": [1.0]}), "two columns give x_mm"),
            (Table({"unit_id": [1], "x_mm": [[1.0, 2.0]]}), "more than one value"),
            ([{"unit_id": 1, "x": 1.0}], "x has no unit"),
            ([{"unit_id": 1, "x": 1.0 * u.s}], "x: s cannot be converted"),
            ([1, 2], "row 0 is no dict, but int"),
            ({"unit_id": 1}, "not dict"),
            (7, "not int"),
        ):
            with self.subTest(said), self.assertRaisesRegex(InvalidInput, said):
                lines(table)

    def test_other_columns_are_named(self):
        with self.assertWarnsRegex(UserWarning, "not used: ra, dec"):
            lines([{"unit_id": 1, "ra": 1.0, "dec": 2.0, "x_mm": 1.0, "y_mm": 1.0}])

    def test_texts_are_quoted_and_masked(self):
        table = Table({"unit_id": [1, 2], "x_mm": [1.0, 2.0], "y_mm": [1.0, 2.0]})
        table["target_id"] = MaskedColumn(['a "b", c', "gone"], mask=[False, True])
        self.assertEqual(lines(table)[1:], ['1,1.0,1.0,"a ""b"", c"', "2,2.0,2.0,"])

    def test_a_fits_file_reads_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "targets.fits")
            table = QTable({"UNIT_ID": [5], "X": [1500.0] * u.um, "Y": [1.0] * u.mm})
            table["TARGET_ID"] = ["galaxy"]
            table.write(path)
            expected = ["unit_id,x_mm,y_mm,target_id", "5,1.5,1.0,galaxy"]
            self.assertEqual(lines(QTable.read(path)), expected)
            self.assertEqual(lines(Table.read(path)), expected)

    def test_a_file_goes_as_it_is(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "night.csv")
            path.write_text("unit_id,x_mm,y_mm\n1,nonsense,2\n")
            self.assertEqual(targets_csv(path), (path.read_text(), "night.csv"))
            path.write_bytes(b"\xff\xfe")
            with self.assertRaisesRegex(InvalidInput, "night.csv: .*utf-8"):
                targets_csv(str(path))
            with self.assertRaisesRegex(InvalidInput, "No such file"):
                targets_csv(str(path) + "x")

    def test_no_rows(self):
        self.assertEqual(lines([]), [""])
        self.assertEqual(lines(QTable({"unit_id": [], "x": [] * u.mm})), ["unit_id,x_mm"])


class Measurements(unittest.TestCase):
    ROW = {"unit_id": 1, "status": "measured", "source": "camera", "x_mm": 1.5, "y_mm": 2.5,
           "sigma_um": 1.0, "target_id": "a", "target_x_mm": 1.5, "target_y_mm": None,
           "error_um": 3.0, "moved_since": False, "orientation": None,
           "at": "2026-11-26T15:18:49.123456Z"}  # fmt: skip

    def test_columns_have_units(self):
        table = table_of([measurement_of(self.ROW)], {"exposure": 12})
        self.assertEqual(table.meta["exposure"], 12)
        self.assertAlmostEqual(table["x_mm"].to_value(u.um)[0], 1500)
        self.assertEqual([table[c].unit for c in ("y_mm", "error_um", "alpha_deg", "var_x_mm2")],
                         [u.mm, u.um, u.deg, u.mm**2])
        self.assertEqual(table["measured_utc"][0].isot, "2026-11-26T15:18:49.123")
        self.assertEqual(len(table_of([], {})), 0)

    def test_what_is_not_known_is_no_zero(self):
        unseen = measurement_of(self.ROW | {"sigma_um": 0, "x_mm": 0, "y_mm": 0, "error_um": None})
        moved = measurement_of(self.ROW | {"moved_since": True})
        for row in (unseen, moved):
            self.assertTrue(np.isnan([row.x_mm, row.y_mm, row.sigma_um, row.error_um]).all())
        self.assertEqual(moved.status, "moved_since")
        self.assertTrue(np.isnan([unseen.target_y_mm, unseen.alpha_deg, unseen.var_x_mm2]).all())


if __name__ == "__main__":
    warnings.simplefilter("error")
    unittest.main()
