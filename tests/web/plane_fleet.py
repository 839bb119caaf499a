"""WebPlane is a simulated fleet with a plane of daemons: a coordinator, which has the page, and sectors."""

import json
import subprocess
import time

from web_fleet import WAIT_S, WebFleet


class WebPlane(WebFleet):
    """`sectors` daemons, each with buses of its own. `daemon` is the coordinator."""

    layout_options = ("--units-per-bus", 15)

    def __init__(self, programs, count, *, sectors=2, **more):
        super().__init__(programs, count, dds=True, **more)
        self.sectors = sectors
        self._others = {}

    def _prepare(self):
        super()._prepare()
        units = (self.folder / "units.csv").read_text().splitlines()
        bus = units[0].split(",").index("bus_id")
        buses = sorted({int(row.split(",")[bus]) for row in units[1:]})
        share = len(buses) // self.sectors
        ranges = [f"{buses[n * share]}-{buses[(n + 1) * share - 1]}" for n in range(self.sectors)]
        config = self.folder / "focalfleet.toml"
        whole = config.read_text()
        common, http = whole[: whole.index("[http]")], whole[whole.index("[http]") :]
        daemon = common[: common.index("[camera]")] if self.camera else common
        for n, buses_of in enumerate(ranges):
            text = daemon.replace("control.sock", f"sector{n}.sock")
            text += f'[store]\npath = "sector{n}.db"\n[sector]\nnumber = {n}\nbuses = "{buses_of}"\n'
            (self.folder / f"sector{n}.toml").write_text(text)
        listed = ", ".join(f'"{buses_of}"' for buses_of in ranges)
        config.write_text(f'{common}[store]\npath = "plane.json"\n[plane]\nsectors = [{listed}]\n{http}')

    def start_sector(self, number):
        with open(self.folder / f"sector{number}.err", "a") as log:
            self._others[number] = subprocess.Popen(
                [self.programs / "focalfleetd", "--config", f"sector{number}.toml"],
                cwd=self.folder, stdout=log, stderr=log)  # fmt: skip

    def stop_sector(self, number):
        self._others[number].terminate()
        self._others[number].wait(timeout=60)

    def start_daemon(self, awaited="ready"):
        """Returns when the coordinator has all units ready, and every sector takes part."""
        for number in range(self.sectors):
            self.start_sector(number)
        with open(self.folder / "daemon.err", "a") as log:
            self.daemon = subprocess.Popen(
                [self.programs / "focalfleetd", "--config", "focalfleet.toml"],
                cwd=self.folder, stdout=log, stderr=log)  # fmt: skip
        until = time.monotonic() + WAIT_S
        ready = False
        while not ready:
            assert time.monotonic() < until, "the plane does not stand"
            assert self.daemon.poll() is None, "the coordinator ended"
            time.sleep(0.2)
            try:
                plane = json.loads(self.cli("status", "--json"))["plane"]
                rows = json.loads(self.cli("state", "--json"))["rows"]
            except AssertionError:
                continue  # not listening yet
            stands = plane["phase"] == "idle" and all(sector["trouble"] == "" for sector in plane["sectors"])
            ready = stands and sum(row["phase"] == "ready" for row in rows) == self.count

    def __exit__(self, *error):
        for process in self._others.values():
            if process.poll() is None:
                process.kill()
                process.wait()
        super().__exit__(*error)
