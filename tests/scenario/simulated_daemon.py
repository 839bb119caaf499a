"""A real focalfleetd with a simulated fleet in it, for scenarios: its folder, and requests on its control socket."""

import json
import socket
import subprocess
import time

PATIENCE_S = 120
CONFIG = """
[fleet]
units = "units.csv"
[dds]
enabled = false
[bus]
port = "simulated"
[log]
level = "{level}"
"""


class Refused(Exception):
    """The daemon answered with an error."""


def make_folder(programs, folder, units, level):
    """Returns the command that starts the daemon there, and the path of its control socket."""
    subprocess.run([f"{programs}/focalfleet", "-q", "layout", "hex", "--count", str(units), "--out", f"{folder}/units.csv"], check=True)
    with open(f"{folder}/focalfleet.toml", "w") as config:
        config.write(CONFIG.format(level=level))
    return [f"{programs}/focalfleetd", "--config", f"{folder}/focalfleet.toml"], f"{folder}/control.sock"


def connect(path):
    end = socket.socket(socket.AF_UNIX)
    end.connect(path)
    end.settimeout(PATIENCE_S)  # from here on: with one, a full backlog would be an error
    return end


def send(end, verb, **arguments):
    end.sendall(json.dumps({"id": 1, "verb": verb, "args": arguments}).encode() + b"\n")


def answer_on(end):
    """The last answer to the one request that is open; progress before it is passed over."""
    answer = b""
    while True:
        while not answer.endswith(b"\n"):
            piece = end.recv(1 << 20)
            if not piece:
                raise RuntimeError("hung up")
            answer += piece
        last = json.loads(answer.splitlines()[-1])
        if "ok" in last:
            break
        answer = b""
    if not last["ok"]:
        raise Refused(last["error"]["text"])
    return last["result"]


def ask(end, verb, **arguments):
    send(end, verb, **arguments)
    return answer_on(end)


def ask_once(path, verb, **arguments):
    with connect(path) as end:
        return ask(end, verb, **arguments)


def wait_until(what, is_so, daemon):
    """Returns when it is so. Raises RuntimeError where the daemon has ended or the patience has."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until and daemon.poll() is None:
        try:
            if is_so():
                return
        except OSError:
            pass
        time.sleep(0.1)
    raise RuntimeError(f"never: {what}")


def wait_until_ready(path, daemon):
    def is_ready():
        status = ask_once(path, "status")
        return status["phases"].get("ready") == status["units"]

    wait_until("the fleet is ready", is_ready, daemon)
