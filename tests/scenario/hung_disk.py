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

from simulated_daemon import PATIENCE_S, Refused, answer_on, ask_once, connect, make_folder, send, wait_until, wait_until_ready

WATCHDOG_S = 4  # a service manager would kill the daemon before its disk counts as hanging, 10 s


class ServiceManager:
    """Counts the daemon's signs of life."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(path)
        self.signs = 0
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        while True:
            self.signs += "WATCHDOG=1" in self.socket.recv(4096).decode()


class Disk:
    """Answers no more while its flag is there."""

    def __init__(self, flag):
        self.flag = flag

    def hang(self):
        open(self.flag, "w").close()

    def answer(self):
        if os.path.exists(self.flag):
            os.remove(self.flag)


def begin(path, verb, **arguments):
    """A connection on which the answer was not read."""
    end = connect(path)
    send(end, verb, **arguments)
    return end


def expect_refused(what, why):
    try:
        what()
    except Refused as refused:
        assert why in str(refused), refused
        return
    raise AssertionError(f"not refused: {why}")


def run(daemon, path, disk, manager):
    targets = {"targets_csv": "unit_id,theta_deg,phi_deg\n2,10,90\n", "source": "a trial"}
    wait_until_ready(path, daemon)
    disk.hang()
    late = begin(path, "disable", unit_ids=[1], reason="a trial")
    wait_until("the status says that the store fails", lambda: ask_once(path, "status")["store"]["failing"], daemon)
    assert "the disk does not answer" in json.dumps(ask_once(path, "alarms"))
    expect_refused(lambda: ask_once(path, "apply", **targets), "the store cannot be written")
    expect_refused(lambda: answer_on(late), "NOT stored")
    # Two more: the first may be of a question from before the disk hung.
    signs = manager.signs
    wait_until("signs of life go on while the disk hangs", lambda: manager.signs >= signs + 2, daemon)
    assert ask_once(path, "status")["store"]["failing"]
    disk.answer()
    wait_until("the store is well again", lambda: not ask_once(path, "status")["store"]["failing"], daemon)
    assert not ask_once(path, "unit", unit_id=1)["enabled"]
    ask_once(path, "apply", wait=True, **targets)
    disk.hang()
    late = begin(path, "enable", unit_ids=[1])
    wait_until("the enabling waits for the store", lambda: ask_once(path, "status")["store"]["waiting"] > 0
               or ask_once(path, "unit", unit_id=1)["enabled"], daemon)
    daemon.send_signal(signal.SIGTERM)
    begun_s = time.monotonic()
    code = daemon.wait(PATIENCE_S)
    print(f"ended {time.monotonic() - begun_s:.1f} s after SIGTERM with {code}")
    assert code == 1, code
    try:
        answer_on(late)
        raise AssertionError("acknowledged without being stored")
    except (Refused, RuntimeError, OSError):
        pass


def main():
    programs, shim = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        command, path = make_folder(programs, folder, 12, "info")
        disk = Disk(f"{folder}/hung")
        manager = ServiceManager(f"{folder}/notify")
        log = f"{folder}/log"
        with open(log, "w") as errors:
            daemon = subprocess.Popen(command, stderr=errors, stdout=errors,
                                      env=dict(os.environ, LD_PRELOAD=shim, HUNG_DISK=disk.flag, NOTIFY_SOCKET=f"{folder}/notify",
                                               WATCHDOG_USEC=str(1_000_000 * WATCHDOG_S)))
        try:
            run(daemon, path, disk, manager)
            text = open(log).read()
            for line in ("the disk does not answer", "the disk answers again", "ended with rows that could not be stored"):
                assert line in text, line
        except BaseException:
            print(open(log).read())
            raise
        finally:
            disk.answer()
            daemon.kill()
            daemon.wait()
    print("a disk that does not answer is named, refused and left behind")


if __name__ == "__main__":
    main()
