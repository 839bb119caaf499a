"""WebFleet is a simulated fleet whose daemon has the HTTP door and its page."""

import pathlib
import socket
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "deploy" / "python"))
from simulated_fleet import WAIT_S, SimulatedFleet  # noqa: E402,F401


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class WebFleet(SimulatedFleet):
    """`http`: more keys of [http], as TOML."""

    def __init__(self, programs, count, *, http="", **more):
        super().__init__(programs, count, **more)
        self.http = http
        self.port = free_port()
        self.tokens = {}

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}"

    def _prepare(self):
        super()._prepare()
        for role in ("viewer", "operator", "engineer"):
            made = self.cli("token", "add", f"{role}-page", "--role", role, "--days", 1, "--file", "tokens.csv", "--json")
            self.tokens[role] = token_in(made)
        config = self.folder / "focalfleet.toml"
        config.write_text(
            config.read_text() + f'[http]\nport = {self.port}\ntokens = "tokens.csv"\n{self.http}')  # fmt: skip

    def stop_daemon(self):
        self.daemon.terminate()
        self.daemon.wait(timeout=60)

    def sim(self, *arguments):
        """A fault is planted in the simulated fleet."""
        subprocess.run([self.programs / "focalfleet-sim", *map(str, arguments), "--control", "sim.sock"],
                       cwd=self.folder, check=True, capture_output=True)  # fmt: skip


def token_in(text):
    import json

    return json.loads(text)["token"]
