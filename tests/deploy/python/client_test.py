"""The client against daemons that are slow, wrong, large or dead. No test asserts a time."""

import logging
import os
import signal
import stat
import tempfile
import threading
import unittest
from pathlib import Path

from fake_daemon import FakeDaemon, failure
from focalfleet import (
    Fleet,
    InvalidInput,
    NotServed,
    Refused,
    Stopped,
    TimedOut,
    Unreachable,
    control,
)

TARGETS = [{"unit_id": 1, "x_mm": 0.5, "y_mm": 1.0}]


def configuration(state, **counts):
    found = {"id": 7, "state": state, "round": 1, "targeted": 2, "arrived": 0, "unserved": []}
    return {"configuration": found | counts}


class Connections(unittest.TestCase):
    def test_no_socket(self):
        with self.assertRaisesRegex(Unreachable, "nowhere.sock: No such file.*focalfleetd running"):
            Fleet("/tmp/nowhere.sock").__enter__()

    def test_nobody_listens(self):
        with FakeDaemon({}) as daemon:
            daemon.kill()
            with self.assertRaisesRegex(Unreachable, "Connection refused"):
                Fleet(daemon.path).status()

    def test_a_socket_that_may_not_be_opened(self):
        with FakeDaemon({}) as daemon:
            os.chmod(daemon.path, 0)
            refused = self.assertRaisesRegex(Unreachable, "Permission denied")
            if os.geteuid() == 0:
                os.seteuid(65534)
            try:
                with refused:
                    Fleet(daemon.path).status()
            finally:
                if os.getuid() == 0:
                    os.seteuid(0)

    def test_the_environment_names_the_socket(self):
        with FakeDaemon({"status": {"units": 3}}) as daemon:
            os.environ["FOCALFLEET_SOCKET"] = daemon.path
            try:
                with Fleet() as fleet:
                    self.assertEqual(fleet.status(), {"units": 3})
            finally:
                del os.environ["FOCALFLEET_SOCKET"]

    def test_garbage_is_no_answer(self):
        for garbage in (
            b"hello\n",
            b"\xff\xfe\n",
            b"[" * 100_000 + b"\n",
            b"{}\n",
            b"null\n",
            b'{"id":999,"ok":true,"result":{}}\n',
            b'{"id":1,"ok":true,"result":',
        ):
            def after_garbage(request, garbage=garbage):
                return garbage

            with self.subTest(garbage[:20]), FakeDaemon({"status": after_garbage}) as daemon:
                if not garbage.endswith(b"\n"):
                    threading.Timer(0.3, daemon.kill).start()
                fleet = Fleet(daemon.path)
                with self.assertRaises(Unreachable):
                    fleet.status()
                fleet.close()

    def test_garbage_leaves_the_effect_of_a_command_open(self):
        with FakeDaemon({"apply": b"hello\n"}) as daemon, Fleet(daemon.path) as fleet:
            with self.assertRaisesRegex(Stopped, "not JSON.*whether `apply` took effect"):
                fleet.apply(TARGETS)

    def test_the_connection_is_opened_again(self):
        with FakeDaemon({"status": None}) as daemon, Fleet(daemon.path) as fleet:
            with self.assertRaisesRegex(Unreachable, "closed the connection"):
                fleet.status()
            daemon.answers["status"] = {"units": 1}
            self.assertEqual(fleet.status(), {"units": 1})

    def test_a_huge_answer_comes_whole(self):
        rows = [{"unit_id": k, "text": "x" * 1000} for k in range(32_768)]
        with FakeDaemon({"status": {"rows": rows}}) as daemon, Fleet(daemon.path) as fleet:
            self.assertEqual(fleet.status()["rows"], rows)

    def test_an_endless_answer_ends(self):
        whole, control.ANSWER_BYTES_MAX = control.ANSWER_BYTES_MAX, 1 << 20
        try:
            with FakeDaemon({"status": b"x" * (8 << 20)}) as daemon, Fleet(daemon.path) as fleet:
                with self.assertRaisesRegex(Unreachable, "longer than 1 MiB"):
                    fleet.status()
        finally:
            control.ANSWER_BYTES_MAX = whole

    def test_a_request_that_is_too_long_is_not_sent(self):
        with FakeDaemon({"apply": {}}) as daemon, Fleet(daemon.path) as fleet:
            with self.assertRaisesRegex(InvalidInput, "takes at most 2097152"):
                fleet.apply([{"unit_id": 1, "target_id": "x" * (2 << 20)}])
            self.assertEqual(daemon.requests, [])

    def test_a_silent_daemon(self):
        with FakeDaemon({"status": FakeDaemon.HANG, "apply": FakeDaemon.HANG}) as daemon:
            fleet = Fleet(daemon.path, timeout_s=0.2)
            with self.assertRaisesRegex(Unreachable, "no answer within 0.2 s"):
                fleet.status()
            with self.assertRaisesRegex(Stopped, "took effect is not known"):
                fleet.apply(TARGETS)
            fleet.close()

    def test_progress_is_passed_over(self):
        both = b'{"id":1,"progress":{}}\n{"id":1,"ok":true,"result":{"units":2}}\n'
        with FakeDaemon({"status": both}) as daemon, Fleet(daemon.path) as fleet:
            self.assertEqual(fleet.status(), {"units": 2})

    def test_threads_share_a_fleet(self):
        echo = {"unit": lambda request: {"unit_id": request["args"]["unit_id"]}}
        with FakeDaemon(echo) as daemon, Fleet(daemon.path) as fleet:
            wrong = []

            def ask(thread):
                for k in range(100):
                    unit = 1000 * thread + k
                    if fleet.unit(unit)["unit_id"] != unit:
                        wrong.append(unit)

            threads = [threading.Thread(target=ask, args=(n,)) for n in range(8)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            self.assertEqual(wrong, [])
            self.assertEqual(len(daemon.requests), 800)

    def test_a_stop_waits_for_no_other_request(self):
        planned = threading.Event()
        asked = threading.Event()

        def plan(request):
            asked.set()
            planned.wait()
            return {"configuration": 7}

        answers = {"apply": plan, "stop": {"text": "stopped"}}
        with FakeDaemon(answers) as daemon, Fleet(daemon.path) as fleet:
            applying = threading.Thread(target=fleet.apply, args=(TARGETS,))
            applying.start()
            asked.wait()
            self.assertEqual(fleet.stop(), "stopped")
            planned.set()
            applying.join()


class Waits(unittest.TestCase):
    def job(self, daemon):
        daemon.answers["apply"] = {"configuration": 7}
        fleet = Fleet(daemon.path)
        self.addCleanup(fleet.close)
        return fleet.apply(TARGETS)

    def test_all_arrive(self):
        steps = iter(
            [
                configuration("planning"),
                configuration("moving"),
                configuration("moving"),
                configuration("done", arrived=2),
            ]
        )
        with FakeDaemon({"status": lambda request: next(steps)}) as daemon:
            shown = []
            found = self.job(daemon).wait(progress=shown.append, poll_s=0)
            self.assertEqual(found["arrived"], 2)
            # Only changes are shown.
            self.assertEqual([str(p).split(": ")[1] for p in shown],
                             [f"{s} of 2 arrived" for s in ("planning, 0", "moving, 0", "done, 2")])

    def test_some_are_not_served(self):
        row = {"unit_id": 9, "outcome": "refused", "reason": "blocked", "state": "ready"}
        done = configuration("done", arrived=1, unserved=[row])
        with FakeDaemon({"status": done}) as daemon:
            with self.assertRaisesRegex(NotServed, "1 of 2.*\n  unit 9: refused: blocked") as caught:
                self.job(daemon).wait()
            self.assertEqual([u.unit_id for u in caught.exception.unserved], [9])
            self.assertEqual(caught.exception.exit_code, 3)
            self.assertEqual(self.job(daemon).wait(check=False)["arrived"], 1)

    def test_a_stop_on_the_way(self):
        for state in ("stopped", "failed"):
            with FakeDaemon({"status": configuration(state)}) as daemon:
                with self.assertRaisesRegex(Stopped, state) as caught:
                    self.job(daemon).wait()
                self.assertEqual(caught.exception.configuration["id"], 7)

    def test_another_configuration_came_after_it(self):
        later = {"status": {"configuration": {"id": 8, "state": "moving"}}}
        rows = [configuration("done", arrived=2)["configuration"]]
        with FakeDaemon(later | {"history": {"configurations": rows}}) as daemon:
            self.assertEqual(self.job(daemon).wait()["id"], 7)
            daemon.answers["history"] = {"configurations": []}
            with self.assertRaisesRegex(Stopped, "knows nothing of configuration 7"):
                self.job(daemon).wait()

    def test_the_daemon_dies(self):
        with FakeDaemon({"status": configuration("moving")}) as daemon:
            job = self.job(daemon)
            with self.assertRaisesRegex(Unreachable, "go on by themselves|focalfleetd running"):
                job.wait(progress=lambda progress: daemon.kill(), poll_s=0)

    def test_a_wait_has_an_end(self):
        with FakeDaemon({"status": configuration("moving")}) as daemon:
            with self.assertRaisesRegex(TimedOut, "7 is not over after 0.2 s; it goes on"):
                self.job(daemon).wait(timeout=0.2)
            with self.assertRaises(TimeoutError):
                daemon.answers["status"] = FakeDaemon.HANG
                self.job(daemon).wait(timeout=0.2)

    def test_an_interrupt_leaves_the_fleet_moving_and_says_so(self):
        with FakeDaemon({"status": configuration("moving")}) as daemon:
            job = self.job(daemon)
            with self.assertLogs("focalfleet", logging.WARNING) as log:
                with self.assertRaises(KeyboardInterrupt) as caught:
                    job.wait(progress=lambda progress: os.kill(os.getpid(), signal.SIGINT))
            said = "no longer waiting; configuration 7 goes on"
            self.assertIn(said, log.output[0])
            self.assertIn(said, caught.exception.__notes__[0])
            self.assertNotIn("stop", [request["verb"] for request in daemon.requests])
            # A second wait is as good as the first.
            daemon.answers["status"] = configuration("done", arrived=2)
            self.assertEqual(job.wait()["arrived"], 2)

    def test_an_interrupt_in_a_request_does_not_mix_up_answers(self):
        def interrupt(request):
            os.kill(os.getpid(), signal.SIGINT)
            return FakeDaemon.HANG

        with FakeDaemon({"apply": interrupt, "status": {"units": 1}}) as daemon:
            with Fleet(daemon.path) as fleet:
                with self.assertRaises(KeyboardInterrupt) as caught:
                    fleet.apply(TARGETS)
                self.assertIn("whether `apply` took effect is not known", caught.exception.__notes__[0])
                self.assertEqual(fleet.status(), {"units": 1})


class Answers(unittest.TestCase):
    def test_codes_become_exceptions(self):
        for code, kind, exit_code in (
            ("invalid", InvalidInput, 1),
            ("refused", Refused, 1),
            ("full", Refused, 1),
            ("newer", Refused, 1),
            ("unavailable", Stopped, 5),
            ("of a later version", Stopped, 5),
        ):
            with FakeDaemon({"apply": failure(code, "because")}) as daemon:
                with Fleet(daemon.path) as fleet, self.assertRaisesRegex(kind, "^because$") as caught:
                    fleet.apply(TARGETS)
                self.assertIs(type(caught.exception), kind)
                self.assertEqual(caught.exception.exit_code, exit_code)

    def test_an_old_daemon_has_no_preview(self):
        with FakeDaemon({"preview": failure("invalid", "there is no verb 'preview'")}) as daemon:
            with Fleet(daemon.path) as fleet, self.assertRaisesRegex(Refused, "too old for preview"):
                fleet.plan(TARGETS)

    def test_a_preview(self):
        row = {"unit_id": 9, "outcome": "refused", "reason": "blocked by unit 3"}
        preview = {"targeted": 3, "served": 2, "moving": 4, "makespan_s": 1.5, "unserved": [row]}
        with FakeDaemon({"preview": preview}) as daemon, Fleet(daemon.path) as fleet:
            plan = fleet.plan(TARGETS)
            self.assertEqual((plan.targeted, plan.served, plan.moving), (3, 2, 4))
            self.assertEqual([str(u) for u in plan.unserved], ["unit 9: refused: blocked by unit 3"])
            self.assertEqual([request["verb"] for request in daemon.requests], ["preview"])


class Watching(unittest.TestCase):
    def program(self, script):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = Path(folder.name, "focalfleet")
        path.write_text("#!/bin/bash\n" + script)
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return path

    def updates(self, script):
        return Fleet("unused").watch(program=self.program(script))

    def test_lines_become_updates(self):
        found = list(self.updates("""echo '{"fleet":{"units":3}}'; echo '{"units":[]}'"""))
        self.assertEqual(found, [{"fleet": {"units": 3}}, {"units": []}])

    def test_the_program_ends_with_the_iteration(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        number = Path(folder.name, "number")
        updates = self.updates(f"echo $$ >{number}; echo '{{}}'; exec sleep 1000")
        next(updates)
        updates.close()
        with self.assertRaises(ProcessLookupError):
            os.kill(int(number.read_text()), 0)

    def test_failures_are_reported(self):
        for script, kind, said in (
            ("echo 'no daemon publishes' >&2; exit 4", Unreachable, "no daemon publishes"),
            ("""echo '{"error":{"code":"unavailable","text":"gone"}}'; exit 5""", Stopped, "gone"),
            ("echo hello; exit 0", Stopped, "no JSON"),
            ("exit 2", Refused, "ended with 2"),
        ):
            with self.subTest(script), self.assertRaisesRegex(kind, said):
                list(self.updates(script))
        with self.assertRaisesRegex(Unreachable, "nowhere.*needs this program"):
            list(Fleet("unused").watch(program="/nowhere/focalfleet"))


if __name__ == "__main__":
    unittest.main()
