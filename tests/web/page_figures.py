"""Figures of docs/page.md: what the page costs browser and daemon.

  page_figures.py PROGRAMS NODE_FOLDER frames COUNT...     a browser while all units move
  page_figures.py PROGRAMS NODE_FOLDER viewers COUNT N...  the daemon with N viewers; "stuck": one that reads nothing
"""

import http.client
import json
import os
import pathlib
import socket
import subprocess
import sys
import threading
import time

from web_fleet import WebFleet

HERE = pathlib.Path(__file__).resolve().parent


def cpu_s(pid):
    """The CPU of each thread that lives, by its number: (name, seconds)."""
    used = {}
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        head, _, tail = (task / "stat").read_text().rpartition(")")
        fields = tail.split()
        used[task.name] = (head.partition("(")[2], (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"))
    return used


def cpu_by_name(before, after):
    """The planner's work differs from one file of targets to the next, so names stand apart."""
    names = {}
    for task, (name, seconds) in after.items():
        names[name] = names.get(name, 0) + seconds - before.get(task, ("", 0))[1]
    return {name: round(seconds, 2) for name, seconds in sorted(names.items()) if seconds >= 0.01}


class Viewer(threading.Thread):
    """Reads the stream, and counts its bytes."""

    def __init__(self, fleet, reads=True):
        super().__init__(daemon=True)
        connection = http.client.HTTPConnection("127.0.0.1", fleet.port)
        connection.connect()
        self.socket = connection.sock
        connection.request("GET", "/stream", headers={"Authorization": f"Bearer {fleet.tokens['viewer']}"})
        self.answer = connection.getresponse()
        assert self.answer.status == 200
        self.bytes = 0
        self.reads = reads
        self.start()

    def run(self):
        while self.reads:
            try:
                part = self.answer.read1(65536)
            except (OSError, AttributeError, ValueError, http.client.HTTPException):
                return
            if not part:
                return
            self.bytes += len(part)


def viewers_figures(fleet, viewers_wanted):
    for index, wanted in enumerate(viewers_wanted):
        stuck = wanted == "stuck"
        viewers = [Viewer(fleet, reads=not stuck) for _ in range(1 if stuck else int(wanted))]
        (fleet.folder / "now.csv").write_text(fleet.cli("state"))
        fleet.cli("targets", "--units", "units.csv", "--from", "now.csv", "--seed", 10 + index, "--as", "targets",
                  "--out", "targets.csv", "--quiet")  # fmt: skip
        bytes_before = sum(viewer.bytes for viewer in viewers)
        cpu_before, begun = cpu_s(fleet.daemon.pid), time.monotonic()
        result = json.loads(fleet.cli("apply", "targets.csv", "--wait", "--json"))
        took_s = time.monotonic() - begun
        used = cpu_by_name(cpu_before, cpu_s(fleet.daemon.pid))
        each = (sum(viewer.bytes for viewer in viewers) - bytes_before) / max(1, len(viewers))
        print(json.dumps({"units": fleet.count, "viewers": wanted, "cpu_s": used,
                          "took_s": round(took_s, 1), "makespan_s": result["makespan_s"],
                          "predicted_s": result["makespan_predicted_s"],
                          "kB_per_s_each": round(each / took_s / 1000, 1)}), flush=True)  # fmt: skip
        for viewer in viewers:
            viewer.socket.shutdown(socket.SHUT_RDWR)


def main():
    programs, node_folder, what, count, *more = sys.argv[1:]
    if what == "frames":
        for units in [count, *more]:
            with WebFleet(programs, int(units), speed=1, awaited="heard") as fleet:
                given = {"url": fleet.url, "tokens": fleet.tokens, "targets": str(fleet.folder / "targets.csv"),
                         "nodeFolder": str(pathlib.Path(node_folder).resolve()), "count": fleet.count}  # fmt: skip
                subprocess.run(["node", HERE / "page_figures.mjs", json.dumps(given)], check=True)
        return
    with WebFleet(programs, int(count), speed=1, http="viewers_max = 64\n", awaited="heard") as fleet:
        viewers_figures(fleet, more)


if __name__ == "__main__":
    main()
