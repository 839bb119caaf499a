#!/usr/bin/python3
"""hung_disk.py BIN SHIM: a real focalfleetd with a simulated fleet, whose disk stops answering (SHIM, hung_disk.c). The daemon has to say so
in its status, its alarms and its log, and to refuse what it could not store. When the disk answers again, what was commanded is stored.
When it does not, SIGTERM ends the daemon all the same, and the exit code says that rows were lost. The exit code is 1 where any of that
failed."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

PATIENCE_S = 60
END_WITHIN_S = 30  # the daemon waits 10 s for the disk
WATCHDOG_S = 4  # a service manager kills a daemon that gives no sign of life for so long
CONFIG = """
[fleet]
units = "units.csv"
[dds]
enabled = false
[bus]
port = "simulated"
"""


class Refused(Exception):
    pass


def send(path, verb, **arguments):
    """The connection, on which no answer was read."""
    end = socket.socket(socket.AF_UNIX)
    end.settimeout(PATIENCE_S)
    end.connect(path)
    end.sendall(json.dumps({"id": 1, "verb": verb, "args": arguments}).encode() + b"\n")
    return end


def answer_on(end):
    with end, end.makefile() as lines:
        while "ok" not in (answer := json.loads(lines.readline())):
            pass  # progress
    if not answer["ok"]:
        raise Refused(answer["error"]["text"])
    return answer["result"]


def ask(path, verb, **arguments):
    return answer_on(send(path, verb, **arguments))


def wait_until(what, is_so):
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        try:
            if is_so():
                return
        except OSError:
            pass
        time.sleep(0.1)
    raise AssertionError(f"not so within {PATIENCE_S} s: {what}")


class ServiceManager:
    """Measures the longest time between two signs of life of the daemon."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(path)
        self.last_s = None
        self.longest_s = 0
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        while True:
            if "WATCHDOG=1" in self.socket.recv(4096).decode():
                now_s = time.monotonic()
                if self.last_s is not None:
                    self.longest_s = max(self.longest_s, now_s - self.last_s)
                self.last_s = now_s


def unit_is_enabled(path):
    return ask(path, "unit", unit_id=1)["enabled"]


def run(daemon, path, flag, manager):
    wait_until("the fleet is ready", lambda: ask(path, "status")["phases"].get("ready") == 12)
    open(flag, "w").close()
    late = send(path, "disable", unit_ids=[1], reason="a trial")
    wait_until("the status says that the store fails", lambda: ask(path, "status")["store"]["failing"])
    alarms = json.dumps(ask(path, "alarms"))
    assert "the disk does not answer" in alarms, alarms
    # A configuration begins with rows in the store.
    targets = "unit_id,theta_deg,phi_deg\n2,10,90\n"
    try:
        ask(path, "apply", targets_csv=targets, source="trial")
        raise AssertionError("a configuration was taken that cannot be stored")
    except Refused as refused:
        assert "the disk does not answer" in str(refused) or "store" in str(refused), refused
    os.remove(flag)
    try:
        answer_on(late)
        raise AssertionError("acknowledged without being stored")
    except Refused as refused:
        assert "NOT stored" in str(refused), refused
    wait_until("the store is well again", lambda: not ask(path, "status")["store"]["failing"])
    assert not unit_is_enabled(path)
    assert manager.last_s is not None and manager.longest_s < WATCHDOG_S, manager.longest_s
    print(f"signs of life were at most {manager.longest_s:.1f} s apart, {WATCHDOG_S} s are allowed")
    ask(path, "apply", targets_csv=targets, source="trial", wait=True)
    open(flag, "w").close()
    late = send(path, "enable", unit_ids=[1])
    time.sleep(0.5)
    daemon.send_signal(signal.SIGTERM)
    begin = time.monotonic()
    code = daemon.wait(END_WITHIN_S)
    print(f"ended {time.monotonic() - begin:.1f} s after SIGTERM with {code}")
    assert code != 0
    try:
        answer_on(late)
        raise AssertionError("acknowledged without being stored")
    except (Refused, ValueError, OSError):
        pass


def main():
    folder_of_programs, shim = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        path, flag, log = f"{folder}/control.sock", f"{folder}/hung", f"{folder}/log"
        subprocess.run([f"{folder_of_programs}/focalfleet", "-q", "layout", "hex", "--count", "12", "--out", f"{folder}/units.csv"], check=True)
        with open(f"{folder}/focalfleet.toml", "w") as config:
            config.write(CONFIG)
        manager = ServiceManager(f"{folder}/notify")
        with open(log, "w") as errors:
            daemon = subprocess.Popen([f"{folder_of_programs}/focalfleetd", "--config", f"{folder}/focalfleet.toml"],
                                      env=dict(os.environ, LD_PRELOAD=shim, HUNG_DISK=flag, NOTIFY_SOCKET=f"{folder}/notify",
                                               WATCHDOG_USEC=str(1_000_000 * WATCHDOG_S)), stderr=errors, stdout=errors)
        try:
            run(daemon, path, flag, manager)
            text = open(log).read()
            assert text.count("the disk does not answer") >= 2, text
        except BaseException:
            print(open(log).read())
            raise
        finally:
            if os.path.exists(flag):
                os.remove(flag)
            daemon.kill()
            daemon.wait()
    print("a disk that does not answer is named, refused and left behind")


if __name__ == "__main__":
    main()
