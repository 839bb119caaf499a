#!/usr/bin/python3
"""answers_fit_schemas.py BIN SCHEMAS [--all] [--keep DIR]: every answer of --json fits its schema.

The real programs work on a simulated fleet of 19 units. Each command that runs has a schema
(`layout hex`: layout-hex.json), is asked at least once, and its answer is validated. Each schema is
used. --all also asks the slow commands. --keep writes the answers into DIR, one file a command.
"""
import argparse
import csv
import json
import math
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

import jsonschema

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "daemon" / "observatory"))
import make_files  # noqa: E402

WAIT_S = 120  # limit of every wait; a loaded machine needs far less
UNITS = 19  # a whole hexagon: a simulated campaign has the same places
SLOW = {"reproduce"}  # half a minute of a core

CONFIGURATION = """
[fleet]
units = "units.csv"
[control]
socket = "control.sock"
[http]
port = {port}
tokens = "tokens.csv"
[dds]
domain = {domain}
[log]
file = "daemon.log"
[bus]
port = "unix"
unix_directory = "sockets"
[clock]
speed = 20.0
[camera]
directory = "camera"
fiducials = "fiducials.csv"
"""

CANDUMP = """(1.000000) can0 0D000808#
(1.000100) can0 00100000#
(1.000200) can0 123#00
(1.000300) can0 00000007#
garbage
"""


class Schemas:
    """The schemas of the folder; parts.json has what several of them share."""

    def __init__(self, folder):
        self.files = {}
        for path in sorted(pathlib.Path(folder).glob("*.json")):
            schema = json.loads(path.read_text())
            jsonschema.Draft202012Validator.check_schema(schema)
            self.files[path.stem] = schema
        self.store = {schema["$id"]: schema for schema in self.files.values()}
        self.used = {"parts"}
        self.wrong = []

    def validate(self, name, answer, what):
        if name not in self.files:
            self.wrong.append(f"{what}: there is no schema {name}.json")
            return
        self.used.add(name)
        schema = self.files[name]
        resolver = jsonschema.RefResolver(schema["$id"], schema, store=self.store)
        validator = jsonschema.Draft202012Validator(schema, resolver=resolver)
        for error in validator.iter_errors(answer):
            at = "/".join(str(part) for part in error.absolute_path)
            self.wrong.append(f"{what}: {name}.json: at /{at}: {error.message[:300]}")


class Session:
    """One folder with a simulated fleet, its daemon, and the commands that are asked."""

    def __init__(self, programs, schemas, keep):
        self.programs, self.schemas, self.keep = programs, schemas, keep
        self.asked = set()
        self.processes = []

    def program(self, name):
        return str(self.programs / name)

    def record(self, name, text):
        if self.keep:
            with open(self.keep / f"{name}.jsonl", "a", encoding="utf-8") as file:
                file.write(text)

    def take(self, name, text, what, exits=(0,)):
        """Validates each line; an error has the schema error.json."""
        if not text.strip():
            self.schemas.wrong.append(f"{what}: no answer")
        for line in text.splitlines():
            answer = json.loads(line)
            schema = "error" if set(answer) == {"schema", "error", "exit"} else name
            if schema == "error" and exits == (0,):
                self.schemas.wrong.append(f"{what}: {answer['error']['text']}")
            self.schemas.validate(schema, answer, what)
            self.record(schema, line + "\n")

    def ask(self, line, *more, exits=(0,), command=None, stdin=""):
        """`focalfleet LINE MORE --json`. `command`: the words of the line that name it."""
        words = line.split() + list(more)
        command = command or words[0]
        self.asked.add(command)
        ran = subprocess.run([self.program("focalfleet"), *words, "--json"], input=stdin,
                             capture_output=True, text=True, timeout=600, check=False)
        what = "focalfleet " + " ".join(words)
        if ran.returncode not in exits:
            self.schemas.wrong.append(f"{what}: ends with {ran.returncode}: {ran.stderr.strip()}")
        self.take(command.replace(" ", "-"), ran.stdout, what, exits)
        return [json.loads(answer) for answer in ran.stdout.splitlines()]

    def simulation(self, *words):
        ran = subprocess.run([self.program("focalfleet-sim"), *words, "--control", "sim.sock"],
                             capture_output=True, text=True, timeout=WAIT_S, check=True)
        return ran.stdout

    def start(self, name, *words, **streams):
        process = subprocess.Popen([self.program(name), *words], **streams)
        self.processes.append(process)
        return process

    def end(self):
        for process in reversed(self.processes):
            process.terminate()
        for process in self.processes:
            process.wait(timeout=WAIT_S)

    def until(self, condition, what):
        end = time.monotonic() + WAIT_S
        while not condition():
            if time.monotonic() > end:
                raise SystemExit(f"waited in vain: {what}")
            time.sleep(0.05)

    def seen(self, *words):
        """The answer of a question, {} where there is none."""
        ran = subprocess.run([self.program("focalfleet"), *words, "--json"], text=True,
                             capture_output=True, check=False)
        return json.loads(ran.stdout) if ran.returncode == 0 else {}

    def ready(self):
        return self.seen("status").get("phases", {}).get("ready") == UNITS

    def moving(self):
        return self.seen("status").get("phases", {}).get("moving", 0) > 0

    def phase(self, unit):
        return self.seen("unit", str(unit)).get("phase")


def renumber(campaign, layout):
    """The units of a simulated campaign get the numbers that the layout has at their places."""
    def rows(path):
        with open(path, encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    def place(unit):
        return round(float(unit["base_x_mm"]), 2) + 0.0, round(float(unit["base_y_mm"]), 2) + 0.0
    number = {place(unit): unit["unit_id"] for unit in rows(layout)}
    units = rows(f"{campaign}/units.csv")
    new = {unit["unit_id"]: number[place(unit)] for unit in units}
    for name in ("units", "moves"):
        table = rows(f"{campaign}/{name}.csv")
        with open(f"{campaign}/{name}.csv", "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, table[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows({**row, "unit_id": new[row["unit_id"]]} for row in table)


def prepare(s):
    """The commands without a daemon."""
    s.ask("layout hex --count 19 --units-per-bus 10 --out units.csv", command="layout hex")
    s.ask("layout hex --count 2 --fiducials 4 --fiducials-out few.csv --out two.csv",
          command="layout hex")
    # Fiducials of the layout would take places of its hexagon.
    around = "".join(f"{100 + n},{90 * math.cos(n)},{90 * math.sin(n)}\n" for n in range(8))
    pathlib.Path("fiducials.csv").write_text("fiducial_id,x_mm,y_mm\n" + around)
    s.ask("targets --units units.csv --seed 1 --as state --out state.csv")
    s.ask("targets --units units.csv --seed 2 --from state.csv --out targets.csv")
    s.ask("targets --units units.csv --seed 3 --from state.csv --out other.csv")
    fleet = "--units units.csv --targets targets.csv --from state.csv"
    s.ask(f"plan {fleet} --out plan.csv --plot plan.html", exits=(0, 3))
    s.ask(f"plan {fleet} --out plan.csv --least-energy --rail-limit-w 0.4", exits=(0, 3))
    s.ask(f"estimate {fleet} --out curve.csv", exits=(0, 3))
    for project, layout in (("desi", "desi/calib.csv"),
                            ("sdss", "sdss/positionerTable.csv sdss/wokCoords.csv"),
                            ("pfs", "pfs/SC01.xml"), ("moons", "moons/positioners.cfg")):
        os.mkdir(project)
        make_files.make(project, project, 19)
        s.ask(f"import {project} --layout {layout} --out {project}/plate", command=f"import {project}")
        s.ask(f"export {project} --import {project}/plate --out {project}/out", command=f"export {project}")
    s.ask("simulate campaign --units 19 --moves 60 --effect backlash:theta=0.3 --out campaign",
          command="simulate campaign")
    renumber("campaign", "units.csv")
    s.ask("diagnose campaign --out report")
    pathlib.Path("report.json").write_bytes(pathlib.Path("report/report.json").read_bytes())
    report = json.loads(pathlib.Path("report.json").read_text())
    s.schemas.validate("report", report, "report.json of diagnose")
    s.record("report", json.dumps(report) + "\n")
    s.ask("diagnose campaign --model report/model.toml --against report/model.toml")
    s.ask("simulate drive --turns 1 --repeat 20 --out drive", command="simulate drive")
    s.ask("tune")
    s.ask("tune --units two.csv --out tuned.csv", exits=(0, 3))
    s.ask("completion bash")
    s.ask("can decode", command="can decode", stdin=CANDUMP, exits=(0, 1))
    s.ask("campaign make --units units.csv --kind survey --moves 2 --out moves.csv",
          command="campaign make")
    s.ask("plan --units nowhere.csv --targets t --from s --out p", exits=(1,))
    s.ask("hexagon", exits=(2,))


def turned(x, y, z):
    """Rx(x) Ry(y) Rz(z), angles in degrees."""
    def rotation(axis, degrees):
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        i, j = [k for k in range(3) if k != axis]
        if axis == 1:
            s = -s
        m = [[float(a == b) for b in range(3)] for a in range(3)]
        m[i][i], m[i][j], m[j][i], m[j][j] = c, -s, s, c
        return m
    def product(a, b):
        return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return product(product(rotation(0, x), rotation(1, y)), rotation(2, z))


def field_T(theta, phi):
    """The harmonic model of docs/hall.md, angles in radians."""
    return 0.05 * math.sin(theta) ** 4 * math.cos(4 * phi)


def write_hall_tables(poses):
    """A field map, poses and voltages of the eight default sensors of docs/hall.md."""
    with open("field.csv", "w", encoding="utf-8") as file:
        file.write("theta_deg,phi_deg,b_T\n")
        for theta in range(0, 181, 6):
            for phi in range(0, 360, 6):
                b = field_T(math.radians(theta), math.radians(phi))
                file.write(f"{theta},{phi},{b}\n")
    a, b, c = (math.radians(angle) for angle in (11.25, 75, 15))
    x, y = (1, 0, 0), (0, 1, 0)
    sensors = [(math.cos(a), math.sin(a), 0), (math.cos(a), -math.sin(a), 0),
               (math.sin(b), 0, math.cos(b)), (math.sin(b), 0, -math.cos(b)),
               (0, math.cos(c), math.sin(c)), (0, math.cos(c), -math.sin(c)), x, y]
    with open("poses.csv", "w", encoding="utf-8") as file:
        names = ",".join(f"v{n + 1}_V" for n in range(8))
        file.write(f"alpha_deg,beta_deg,gamma_deg,{names}\n")
        for pose in poses:
            m = turned(*pose)
            volts = []
            for p in sensors:
                q = [sum(m[k][i] * p[k] for k in range(3)) for i in range(3)]
                theta, phi = math.acos(max(-1, min(1, q[2]))), math.atan2(q[1], q[0])
                volts.append(f"{2.5 + 25 * field_T(theta, phi):.6f}")
            file.write(",".join([*map(str, pose), *volts]) + "\n")


def hall(s):
    write_hall_tables([(7 * math.sin(n), 9 * math.cos(3 * n), 11 * math.sin(5 * n))
                       for n in range(40)])
    s.ask("hall fit --data field.csv --kind harmonic --out hall.toml", command="hall fit")
    s.ask("hall orient --model hall.toml --data poses.csv --out orientations.csv",
          command="hall orient", exits=(0, 3))
    s.ask("hall calibrate --model hall.toml --data poses.csv --out sensors.csv",
          command="hall calibrate", exits=(0, 3))
    s.ask("hall diagnose --model hall.toml --data poses.csv --out hall-report",
          command="hall diagnose")
    s.ask("hall reproduce --out hall-claims", command="hall reproduce")


def retarget(s):
    """A new target for a unit while the others move. On a busy machine a motion may be over first."""
    for targets in ("other.csv", "targets.csv") * 5:
        s.ask(f"apply {targets}")
        s.until(lambda: s.moving() or s.ready(), "the motion begins")
        s.ask("status --buses")
        s.ask("wait --timeout 0.01", exits=(0, 1, 3))
        answer = s.ask("retarget 5 10 90 --angles", exits=(0, 1, 3))
        if "goes" in answer[0]:
            return
        s.until(s.ready, "the motion is over")


def operate(s):
    """The commands of a daemon, and what goes wrong on the way."""
    s.ask("status")
    s.ask("unit 3")
    s.ask("store check focalfleet.db", command="store check")
    s.ask("store backup focalfleet.db backup.db", command="store backup")
    s.ask("store restore backup.db restored.db", command="store restore")
    s.ask("model show", command="model show")
    s.ask("measurements", exits=(0, 1))
    watch = s.start("focalfleet", "watch", "--json", "--domain", s.domain,
                    stdout=open("watch.jsonl", "w", encoding="utf-8"), stderr=subprocess.DEVNULL)
    s.ask("watch --once --domain", s.domain)
    s.ask("doctor --config focalfleet.toml", exits=(0, 1, 3))
    s.ask("incident --config focalfleet.toml --out incident.tar.gz", command="incident", exits=(0, 3))
    s.ask("wait")
    s.ask("apply targets.csv --dry-run", exits=(0, 3))
    s.ask("apply targets.csv --wait --correct 1", exits=(0, 3))
    retarget(s)
    s.ask("stop", exits=(0, 3))
    s.until(s.ready, "all units at rest after the stop")
    s.ask("measure --wait")
    s.ask("measurements")
    s.ask("measure")
    s.ask("wait", exits=(0, 3))
    s.ask("apply other.csv")
    s.ask("wait", exits=(0, 3))
    s.ask("state --out now.csv")
    s.ask("history")
    s.ask("history 3")
    s.ask("history 3-4,99", exits=(3,))
    s.ask("history --since 1h --state done")
    s.ask("events --since 1h")
    s.ask("unit 3,7-8")
    s.ask("params 3-4")
    s.ask("unit 3")
    s.ask("disable 5 --reason test")
    s.ask("enable 5")
    s.ask("params 5")
    s.ask("params 5 set theta repeat 100")
    s.ask("params 3-4 set theta repeat 100")
    s.ask("params 5")
    s.ask("home 5 --wait")
    s.ask("home 5")
    s.ask("wait", exits=(0, 3))
    s.ask("campaign run moves.csv --units units.csv --out measured", command="campaign run",
          exits=(0, 3))
    s.ask("model load report/model.toml --yes", command="model load")
    s.ask("model show", command="model show")
    s.ask("model unload", command="model unload")
    s.ask("model rollback", command="model rollback")
    s.ask("model show", command="model show")
    s.ask("stop --direct --config focalfleet.toml", exits=(0, 3))
    watch.send_signal(signal.SIGINT)
    watch.wait(timeout=WAIT_S)
    s.take("watch", pathlib.Path("watch.jsonl").read_text(encoding="utf-8"), "focalfleet watch")


def fail(s):
    """Other hardware, lost power, lost buses: fields that are empty on a good day."""
    s.simulation("misbehave", "--units", "6", "--foreign", "77")
    s.simulation("power-cut", "--units", "6", "--seconds", "1")
    s.until(lambda: s.phase(6) == "foreign", "other hardware is noticed")
    s.ask("adopt 6 --yes")
    s.ask("adopt 5-6 --yes", exits=(1,))
    s.ask("apply targets.csv")
    s.simulation("power-cut", "--units", "2")
    s.simulation("fault", "--units", "4", "--code", "over_current")
    s.simulation("kill-bus", "--buses", "1")
    s.ask("status --buses")
    s.ask("apply targets.csv --dry-run", exits=(0, 1, 3))
    s.ask("stop", exits=(0, 3, 5))
    for unit in ("2", "4", "8"):
        s.ask(f"unit {unit}")
    s.ask("state --allow-unknown --out some.csv", exits=(0, 1, 3))
    s.ask("history")
    s.ask("apply targets.csv --wait", exits=(0, 1, 3, 5))
    s.ask("apply targets.csv --dry-run", exits=(0, 1, 3))
    s.until(lambda: s.seen("alarms").get("open", 0) > 0, "alarms are open")
    s.ask("access")
    s.ask("page")
    s.ask("audit --limit 5")
    s.ask("audit --verify")
    tokens = ("--file", "tokens.csv")
    s.ask("token add page --role viewer --days 30", *tokens, command="token add")
    s.ask("token revoke page", *tokens, command="token revoke")
    s.ask("token list", *tokens, command="token list")
    s.ask("alarms mute UnitSilent --for 2h --reason test", command="alarms mute")
    s.ask("alarms --all")
    s.ask("alarms unmute UnitSilent", command="alarms unmute")
    s.ask("alarms")
    s.ask("alarms ack " + str(s.seen("alarms")["alarms"][0]["id"]), command="alarms ack")
    s.ask("alarms --all --since 1h --severity warning")
    s.ask("status")
    s.ask("events")
    s.ask("doctor --config focalfleet.toml", exits=(0, 1, 3))


def follow(s):
    """The events as they come, an object a line."""
    path = pathlib.Path("events.jsonl")
    with open(path, "w", encoding="utf-8") as file:
        events = s.start("focalfleet", "events", "-f", "--json", stdout=file)
    s.until(lambda: path.read_text(encoding="utf-8").count("\n") > 2, "events are printed")
    events.terminate()
    events.wait(timeout=WAIT_S)
    whole = path.read_text(encoding="utf-8").rpartition("\n")[0]
    s.take("events", whole, "focalfleet events -f")


def simulation_answers(s):
    for line in ("truth --json", "status"):
        name = "sim-" + line.split()[0]
        s.take(name, s.simulation(*line.split()), "focalfleet-sim " + line)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def run(s, slow):
    domain = os.getpid() % 200 + 20
    s.domain = str(domain)
    prepare(s)
    hall(s)
    if slow:
        s.ask("reproduce --out claims")
    pathlib.Path("focalfleet.toml").write_text(CONFIGURATION.format(domain=domain, port=free_port()))
    s.ask("token add first --role viewer --days 30", "--file", "tokens.csv", command="token add")
    os.makedirs("sockets")
    os.makedirs("camera")
    os.environ["FOCALFLEET_SOCKET"] = "control.sock"
    s.ask("status", exits=(4,))
    simulator = s.start("focalfleet-sim", "--units", "units.csv", "--state", "state.csv",
                        "--unix-directory", "sockets", "--control", "sim.sock", "--speed", "20",
                        "--camera", "camera", "--fiducials", "fiducials.csv",
                        stdout=subprocess.PIPE, text=True)
    assert simulator.stdout.readline().strip() == "ready"
    s.start("focalfleetd", "--config", "focalfleet.toml")
    s.until(s.ready, "all units ready")
    operate(s)
    fail(s)
    follow(s)
    simulation_answers(s)


def commands_of(s):
    """All commands that run, by the program's own word."""
    ran = subprocess.run([s.program("focalfleet"), "help", "--json"], capture_output=True,
                         text=True, check=True)
    s.take("help", ran.stdout, "focalfleet help")
    s.asked.add("help")
    tree = json.loads(ran.stdout)["commands"]
    return {c["command"].removeprefix("focalfleet ") for c in tree if c["runs"]}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("schemas", type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--keep", type=lambda p: pathlib.Path(p).resolve())
    options = parser.parse_args()
    schemas = Schemas(options.schemas)
    session = Session(options.programs, schemas, options.keep)
    commands = commands_of(session)
    with tempfile.TemporaryDirectory(prefix="schemas.") as folder:
        os.chdir(folder)
        try:
            run(session, options.all)
        finally:
            session.end()
            os.chdir("/")
    not_asked = commands - session.asked - (set() if options.all else SLOW)
    schemas.wrong += [f"{command}: no step of this test asks it" for command in sorted(not_asked)]
    schemas.wrong += [f"{command}: docs/schemas/{command.replace(' ', '-')}.json is missing"
                      for command in sorted(commands)
                      if command.replace(" ", "-") not in schemas.files]
    unused = set(schemas.files) - schemas.used - (set() if options.all else SLOW)
    schemas.wrong += [f"{name}.json: no answer uses it" for name in sorted(unused)]
    for wrong in schemas.wrong:
        print(wrong, file=sys.stderr)
    return 1 if schemas.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
