"""SimulatedFleet runs focalfleet-sim and focalfleetd in a folder of their own."""

import fcntl
import json
import os
import pathlib
import subprocess
import tempfile
import time

WAIT_S = 240  # generous: a loaded machine must not fail a test


def free_domain():
    """A DDS domain that no other test of this machine uses, as tests/daemon/dds/own_domain.h."""
    for domain in range(20, 100):
        lock = open(f"/tmp/focalfleet_dds_domain_{domain}.lock", "w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        return domain, lock
    raise AssertionError("no free DDS domain")


class SimulatedFleet:
    """`count` units at their start places. Use it as a context manager.

    `awaited`: the units are ready, or only heard: on a loaded machine some of many fall silent.
    `secured`: DDS Security, with credentials for each role in `keys()`.
    """

    layout_options = ()  # of `focalfleet layout hex`

    def __init__(self, programs, count, *, speed=10, camera=False, dds=False, awaited="ready", secured=False):
        self.programs = pathlib.Path(programs).resolve()
        self.count = count
        self.speed = speed
        self.camera = camera
        self.awaited = awaited
        self.secured = secured
        self.domain, self._lock = free_domain() if dds else (None, None)
        self._folder = tempfile.TemporaryDirectory(prefix="focalfleet-")
        self.folder = pathlib.Path(self._folder.name)
        self.socket = self.folder / "control.sock"
        self._simulator = None
        self.daemon = None

    def __enter__(self):
        try:
            self._prepare()
            self._start_simulator()
            self.start_daemon(self.awaited)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *error):
        for process in (self.daemon, self._simulator):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
        if self._simulator is not None:
            self._simulator.stdout.close()
        if any(error):
            for log in self.folder.glob("*.err"):
                print(f"--- {log.name}", *log.read_text().splitlines()[-15:], sep="\n")
        self._folder.cleanup()

    def keys(self, role):
        """The folder of credentials for a role."""
        return self.folder / "keys" / role

    def cli(self, *arguments):
        """What the command-line tool prints."""
        done = subprocess.run(
            [self.programs / "focalfleet", *map(str, arguments)],
            cwd=self.folder, capture_output=True, text=True,
            env=os.environ | {"FOCALFLEET_SOCKET": str(self.socket)})  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    def _prepare(self):
        (self.folder / "bus").mkdir()
        fiducials = ["--fiducials", 40, "--fiducials-out", "fiducials.csv"] if self.camera else []
        self.cli("layout", "hex", "--count", self.count, "--out", "units.csv", "--quiet", *self.layout_options, *fiducials)
        start = ["targets", "--units", "units.csv", "--quiet"]
        self.cli(*start, "--seed", 1, "--as", "state", "--out", "state.csv")
        self.cli(*start, "--seed", 2, "--from", "state.csv", "--as", "targets", "--out", "targets.csv")
        dds = f"enabled = true\ndomain = {self.domain}" if self.domain else "enabled = false"
        if self.secured:
            make_keys = pathlib.Path(__file__).resolve().parents[3] / "deploy/dds-security/make-keys"
            subprocess.run([make_keys, self.folder / "keys", "--domain", str(self.domain)],
                           check=True, capture_output=True)  # fmt: skip
            dds += f'\nsecurity = "{self.keys("daemon")}"'
        camera = '[camera]\ndirectory = "camera"\nfiducials = "fiducials.csv"\n'
        (self.folder / "focalfleet.toml").write_text(
            '[fleet]\nunits = "units.csv"\n[control]\nsocket = "control.sock"\n'
            f'[dds]\n{dds}\n[bus]\nport = "unix"\nunix_directory = "bus"\n'
            f"[clock]\nspeed = {float(self.speed)}\n" + (camera if self.camera else ""))  # fmt: skip

    def _start_simulator(self):
        camera = ["--camera", "camera", "--fiducials", "fiducials.csv"] if self.camera else []
        with open(self.folder / "simulator.err", "w") as log:
            self._simulator = subprocess.Popen(
                [self.programs / "focalfleet-sim", "--units", "units.csv", "--state", "state.csv",
                 "--unix-directory", "bus", "--control", "sim.sock", "--speed", str(self.speed),
                 "--seed", "4", *camera],
                cwd=self.folder, stdout=subprocess.PIPE, stderr=log)  # fmt: skip
        assert self._simulator.stdout.readline() == b"ready\n", "the simulated fleet did not start"

    def start_daemon(self, awaited="ready"):
        """Starts the daemon, and returns when all units are ready, or have been `heard`."""
        with open(self.folder / "daemon.err", "a") as log:
            self.daemon = subprocess.Popen(
                [self.programs / "focalfleetd", "--config", "focalfleet.toml"],
                cwd=self.folder, stdout=log, stderr=log)  # fmt: skip
        until = time.monotonic() + WAIT_S
        count = 0
        while count < self.count:
            assert time.monotonic() < until, f"only {count} of {self.count} units: {awaited}"
            assert self.daemon.poll() is None, "the daemon ended"
            time.sleep(0.1)
            try:
                phases = json.loads(self.cli("status", "--json"))["phases"]
            except AssertionError:
                continue  # not listening yet
            unheard = phases.get("absent", 0) + phases.get("identifying", 0)
            count = phases.get("ready", 0) if awaited == "ready" else self.count - unheard
