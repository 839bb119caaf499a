"""The client, and the examples of docs/python.md, against the daemon and a simulated fleet.

    live_test.py PROGRAMS
"""

import doctest
import os
import pathlib
import signal
import sys
import threading
import unittest

from astropy.table import QTable
from focalfleet import Fleet, InvalidInput, NotServed, Refused, Stopped, TimedOut, Unreachable
from simulated_fleet import SimulatedFleet

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAMS = pathlib.Path(sys.argv.pop(1)).resolve()


class Examples(unittest.TestCase):
    def test_the_page_is_true(self):
        with SimulatedFleet(PROGRAMS, 100, camera=True) as simulated:
            before = os.environ.get("FOCALFLEET_SOCKET")
            os.environ["FOCALFLEET_SOCKET"] = str(simulated.socket)
            os.chdir(simulated.folder)
            try:
                failed, tried = doctest.testfile(
                    str(ROOT / "docs/python.md"),
                    module_relative=False,
                    optionflags=doctest.ELLIPSIS,
                )
            finally:
                os.chdir("/")
                del os.environ["FOCALFLEET_SOCKET"]
            self.assertIsNone(before)
            self.assertEqual(failed, 0)
            self.assertGreater(tried, 12)


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # Slow enough that a motion lasts for several looks at the status.
        simulated = SimulatedFleet(PROGRAMS, 100, speed=5, dds=True)
        cls.simulated = cls.enterClassContext(simulated)
        cls.targets = QTable.read(simulated.folder / "targets.csv", format="csv")
        cls.start = QTable.read(simulated.folder / "state.csv", format="csv")

    def setUp(self):
        self.fleet = self.enterContext(Fleet(self.simulated.socket))

    def elsewhere(self):
        """Targets far from where the units stand."""
        row = next(row for row in self.start if row["unit_id"] == 1)
        is_at_start = abs(self.fleet.unit(1)["theta"]["low_deg"] - row["theta_deg"]) < 1
        return self.targets if is_at_start else self.start["unit_id", "theta_deg", "phi_deg"]

    def test_questions(self):
        self.assertEqual(self.fleet.status()["units"], 100)
        self.assertEqual(self.fleet.unit(7)["unit_id"], 7)
        with self.assertRaisesRegex(InvalidInput, "there is no unit 70000"):
            self.fleet.unit(70_000)
        self.assertIn("configurations", self.fleet.history())
        self.assertIn("moves", self.fleet.history(7, limit=3))

    def test_the_daemon_refuses_by_the_rows_of_the_table(self):
        table = self.targets.copy()
        table["unit_id"][41] = 70_000
        with self.assertRaisesRegex(InvalidInput, "table:43: unit 70000"):
            self.fleet.apply(table)
        with self.assertRaisesRegex(InvalidInput, "table:1"):
            self.fleet.apply(table["x_mm", "y_mm"])
        self.assertFalse(self.fleet.status()["busy"])

    def test_masked_rows_have_no_target(self):
        table = QTable(self.targets, masked=True)
        table["x_mm"].mask[3:] = table["y_mm"].mask[3:] = True
        self.assertEqual(self.fleet.apply(table).wait(check=False)["targeted"], 3)

    def test_an_interrupted_wait_and_a_second_one(self):
        job = self.fleet.apply(self.elsewhere())

        def interrupt(progress):
            if progress.state == "moving":
                os.kill(os.getpid(), signal.SIGINT)

        with self.assertLogs("focalfleet"), self.assertRaises(KeyboardInterrupt):
            job.wait(progress=interrupt)
        with self.assertRaises(TimedOut):
            job.wait(timeout=0)
        self.assertTrue(self.fleet.status()["busy"])
        with self.assertRaisesRegex(Refused, "under way"):
            self.fleet.apply(self.targets)
        self.assertEqual(job.wait()["arrived"], 100)

    def test_a_stop_from_another_thread(self):
        job = self.fleet.apply(self.elsewhere())
        stops = []

        def stop(progress):
            if progress.state == "moving" and not stops:
                stops.append(threading.Thread(target=self.fleet.stop))
                stops[0].start()

        with self.assertRaisesRegex(Stopped, "stopped") as caught:
            job.wait(progress=stop)
        stops[0].join()
        self.assertEqual(caught.exception.configuration["state"], "stopped")
        # A stop leaves units anywhere; they are known when they rest.
        self.fleet.apply(self.targets).wait(check=False)

    def test_a_unit_that_is_not_served(self):
        self.simulated.cli("disable", 5, "--reason", "test")
        try:
            with self.assertRaises(NotServed) as caught:
                self.fleet.apply(self.elsewhere()).wait()
        finally:
            self.simulated.cli("enable", 5)
        self.assertIn(5, [unit.unit_id for unit in caught.exception.unserved])

    def place(self, number):
        unit = self.fleet.unit(number)
        return unit["theta"], unit["phi"]

    def test_a_preview_moves_nothing(self):
        before = self.fleet.status()["configuration"]["id"]
        places = [self.place(number) for number in (1, 50, 100)]
        plan = self.fleet.plan(self.targets)
        self.assertEqual((plan.targeted, plan.served + len(plan.unserved)), (100, 100))
        self.assertEqual(self.fleet.status()["configuration"]["id"], before)
        self.assertEqual([self.place(number) for number in (1, 50, 100)], places)

    def test_alarms_are_listed_by_name(self):
        answer = self.fleet.alarms()
        self.assertEqual(answer["open"], len([a for a in answer["alarms"] if a["state"] == "open"]))

    def test_watch(self):
        program = PROGRAMS / "focalfleet"
        watched = self.fleet.watch(domain=self.simulated.domain, program=program, once=True, wait_s=60)
        self.assertEqual(len(next(watched)["units"]), 100)
        self.assertEqual(list(watched), [])

    # The last one by its name: the daemon starts anew.
    def test_zz_the_daemon_dies_in_a_wait_and_comes_back(self):
        job = self.fleet.apply(self.elsewhere())

        def kill(progress):
            if progress.state == "moving":
                self.simulated.daemon.kill()
                self.simulated.daemon.wait()

        with self.assertRaises(Unreachable):
            job.wait(progress=kill)
        self.simulated.start_daemon()
        # The daemon ended without the configuration's end, and its store says so.
        with self.assertRaisesRegex(Stopped, f"configuration {job.configuration}: failed"):
            job.wait()
        self.assertEqual(self.fleet.status()["units"], 100)


if __name__ == "__main__":
    unittest.main(verbosity=2)
