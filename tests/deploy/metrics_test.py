#!/usr/bin/env python3
"""Tests of the metrics as their users meet them: the page of a real daemon, rules, runbook and dashboard.

    metrics_test.py page ROOT BIN        the page by promtool, and docs/metrics.md against it
    metrics_test.py rules ROOT           rules, examples and runbook, without a daemon
    metrics_test.py dashboard ROOT BIN   every query against a real Prometheus that scrapes a simulated fleet
"""
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request

PATIENCE_S = 120  # limit for a hang; nothing is timed


def fail(text):
    sys.exit(f"metrics_test: {text}")


def await_that(what, done):
    """Polls `done` until it returns something true, which is returned."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        result = done()
        if result:
            return result
        time.sleep(0.1)
    fail(f"waited in vain: {what}")


def free_port():
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def get(url):
    """The text of a page; None where there is no answer, or another one than 200."""
    try:
        with urllib.request.urlopen(url, timeout=10) as answer:
            return answer.read().decode()
    except (urllib.error.URLError, OSError):
        return None


def run(arguments, text=None):
    done = subprocess.run(arguments, input=text, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        fail(f"{' '.join(arguments)} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


class Fleet:
    """A daemon with a simulated fleet in a folder of its own, and other programs that end with it."""

    def __init__(self, bin_folder, units=60, units_per_bus=20, units_per_rail=30):
        self.folder = tempfile.mkdtemp(prefix="metrics-test.")
        self.bin = os.path.abspath(bin_folder)
        self.port = free_port()
        self.processes = []
        self.focalfleet("layout", "hex", "--count", str(units), "--units-per-bus", str(units_per_bus),
                        "--units-per-rail", str(units_per_rail), "--out", self.path("units.csv"), "--quiet")
        with open(self.path("f.toml"), "w", encoding="utf-8") as file:
            file.write(f"[dds]\nenabled = false\n[bus]\nport = \"simulated\"\n[clock]\nspeed = 20.0\n"
                       f"[metrics]\nport = {self.port}\n")

    def __enter__(self):
        self.start("focalfleetd", [f"{self.bin}/focalfleetd", "--config", self.path("f.toml")])
        return self

    def __exit__(self, kind, value, trace):
        for process in reversed(self.processes):
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if kind is None:
            shutil.rmtree(self.folder)
        else:
            for name in sorted(os.listdir(self.folder)):
                if name.endswith(".log"):
                    with open(self.path(name), encoding="utf-8", errors="replace") as log:
                        print(f"--- {name}\n{log.read()[-3000:]}", file=sys.stderr)
            print(f"metrics_test: all files are kept in {self.folder}", file=sys.stderr)

    def path(self, name):
        return f"{self.folder}/{name}"

    def start(self, name, arguments):
        with open(self.path(name + ".log"), "w", encoding="utf-8") as log:
            self.processes.append(subprocess.Popen(arguments, stdout=log, stderr=log))

    def focalfleet(self, *arguments):
        return run([f"{self.bin}/focalfleet", *arguments])

    def page(self):
        return get(f"http://127.0.0.1:{self.port}/metrics")

    def ready_page(self):
        """The page once every unit is ready."""
        def done():
            text = self.page()
            return text if text and not re.search(r'focalfleet_units\{state="(?!ready)\w+"\} [1-9]', text) else None
        return await_that("all units are ready", done)

    def apply(self, theta_deg, phi_deg):
        with open(self.path("units.csv"), encoding="utf-8") as file:
            ids = [line.split(",")[0] for line in file if line[0].isdigit()]
        with open(self.path("targets.csv"), "w", encoding="utf-8") as file:
            file.write("unit_id,theta_deg,phi_deg\n")
            file.writelines(f"{unit},{theta_deg},{phi_deg}\n" for unit in ids)
        self.focalfleet("apply", self.path("targets.csv"), "--wait", "--socket", self.path("control.sock"))


# ---- texts

def families_of(text):
    """{name: type} of the page."""
    return dict(re.findall(r"^# TYPE (\S+) (\S+)$", text, re.MULTILINE))


def series_of(text):
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def value_of(text, series):
    found = re.search("^" + re.escape(series) + r" (\S+)$", text, re.MULTILINE)
    return float(found.group(1)) if found else None


def documented(root):
    """{name: type} of the tables of docs/metrics.md."""
    with open(f"{root}/docs/metrics.md", encoding="utf-8") as file:
        return dict(re.findall(r"^\| `([a-z_]+)` \| (gauge|counter|histogram) \|", file.read(), re.MULTILINE))


def anchors_of(path):
    """Anchors of a page's headings, as renderers make them."""
    anchors = set()
    with open(path, encoding="utf-8") as file:
        for heading in re.findall(r"^#+ (.+)$", file.read(), re.MULTILINE):
            anchors.add(re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-"))
    return anchors


def entries_of(root):
    """{anchor: text} of the entries of docs/runbook.md."""
    with open(f"{root}/docs/runbook.md", encoding="utf-8") as file:
        parts = re.split(r"^### (\w+)$", file.read(), flags=re.MULTILINE)
    return {name.lower(): " ".join(text.split()) for name, text in zip(parts[1::2], parts[2::2])}


def severity_in(entry):
    """The severity of the alert: `(critical)`, or `(error; as an alert warning; ...` in the entry of an alarm."""
    found = re.search(r"\((?:\w+; as an alert )?(critical|warning|info)(?:\)|; open)", entry)
    return found.group(1) if found else "nothing"


def rules_of(root):
    """[(name, lines of the rule)] of the file of rules."""
    with open(f"{root}/deploy/prometheus/focalfleet.rules.yml", encoding="utf-8") as file:
        parts = re.split(r"^ +- alert: (\w+)\n", file.read(), flags=re.MULTILINE)
    return list(zip(parts[1::2], parts[2::2]))


def queries_of(dashboard):
    return [(panel["title"], target["expr"]) for panel in dashboard["panels"] for target in panel.get("targets", [])]


# ---- tests

def check_page(root, bin_folder):
    with Fleet(bin_folder) as fleet:
        before = fleet.ready_page()
        run(["promtool", "check", "metrics"], before)
        fleet.apply(10, 170)

        def ended():
            text = fleet.page()
            return text if value_of(text, 'focalfleet_configurations_ended_total{state="done"}') == 1 else None
        after = await_that("the configuration is over", ended)
        run(["promtool", "check", "metrics"], after)

        def expect(series, value):
            if value_of(after, series) != value:
                fail(f"{series} is {value_of(after, series)}, not {value}")
        expect('focalfleet_units{state="ready"}', 60)
        expect('focalfleet_configuration_units{outcome="targeted"}', 60)
        expect('focalfleet_configuration_units{outcome="arrived"}', 60)
        expect('focalfleet_configuration_state{state="done"}', 1)
        expect("focalfleet_configuration_in_progress", 0)
        expect("focalfleet_planner_seconds_count", 1)
        expect("focalfleet_configuration_retries_count", 1)
        answering = re.findall(r'^focalfleet_bus_units_answering\{bus="(\d+)"\} (\d+)$', after, re.MULTILINE)
        if len(answering) < 3 or sum(int(count) for _, count in answering) != 60:
            fail(f"units that answer, by bus: {answering}")
        for bus, _ in answering:
            expect(f'focalfleet_bus_state{{bus="{bus}",state="up"}}', 1)
        began = value_of(after, "focalfleet_configuration_began_timestamp_seconds")
        over = value_of(after, "focalfleet_configuration_ended_timestamp_seconds")
        if not time.time() - 3600 < began <= over < time.time() + 60:
            fail(f"the configuration lasted from {began} to {over}")
        for series in ('focalfleet_rail_power_predicted_watts{rail="0"}', "focalfleet_power_predicted_watts",
                       "focalfleet_store_commit_seconds_count", "focalfleet_store_rows_total",
                       "focalfleet_store_size_bytes", "process_resident_memory_bytes", "process_cpu_seconds_total",
                       "focalfleet_configuration_makespan_seconds"):
            if not value_of(after, series) > 0:
                fail(f"{series} is {value_of(after, series)}")
        names = [re.sub(r" \S+$", "", line) for line in series_of(before)]
        if len(set(names)) != len(names):
            fail("a series comes twice")
        if names != [re.sub(r" \S+$", "", line) for line in series_of(after)]:
            fail("series came or went with a configuration")
        if get(f"http://127.0.0.1:{fleet.port}/healthz") != "ok\n":
            fail("/healthz is not ok")
        served, pages = families_of(after), documented(root)
        if served != pages:
            fail(f"docs/metrics.md and the page differ: {sorted(set(served.items()) ^ set(pages.items()))}")


def check_rules(root):
    prometheus = f"{root}/deploy/prometheus"
    run(["promtool", "check", "rules", f"{prometheus}/focalfleet.rules.yml"])
    run(["promtool", "check", "config", f"{prometheus}/prometheus.example.yml"])
    run(["promtool", "test", "rules", f"{root}/tests/deploy/alert_rules_test.yml"])
    run(["amtool", "check-config", f"{prometheus}/alertmanager.example.yml"])
    with open(f"{root}/tests/deploy/alert_rules_test.yml", encoding="utf-8") as file:
        tested = set(re.findall(r'alertname="(\w+)"', file.read()))
    anchors = anchors_of(f"{root}/docs/runbook.md")
    entries = entries_of(root)
    names, pointed_at = set(), set()
    for name, rule in rules_of(root):
        names.add(name)
        if not re.fullmatch(r"Focalfleet([A-Z][a-z]+)+", name):
            fail(f"{name} is not CamelCase behind Focalfleet")
        for field in ("severity: (critical|warning|info)", "summary: .*[.]", "description: .*", "dashboard_url: /d/focalfleet"):
            if not re.search(rf"^ +{field}$", rule, re.MULTILINE):
                fail(f"{name} has no {field}")
        if ("for:" in rule) != (name != "FocalfleetMotionStopped"):
            fail(f"{name}: every alert waits but the one of a stop")
        anchor = re.search(r"runbook_url: docs/runbook[.]md#(\S+)$", rule, re.MULTILINE)
        if not anchor or anchor.group(1) not in anchors:
            fail(f"{name} has no entry in docs/runbook.md")
        if anchor.group(1) not in (name.lower(), name.removeprefix("Focalfleet").lower()):
            fail(f"{name} points at the entry {anchor.group(1)}")
        pointed_at.add(anchor.group(1))
        severity = re.search(r"severity: (\w+)", rule).group(1)
        if severity_in(entries[anchor.group(1)]) != severity:
            fail(f"{name} is {severity}, and its entry in docs/runbook.md says {severity_in(entries[anchor.group(1)])}")
    if names != tested:
        fail(f"alerts and their tests differ: {sorted(names ^ tested)}")
    orphans = {anchor for anchor in anchors if anchor.startswith("focalfleet") and " " not in anchor} - pointed_at
    if orphans:
        fail(f"docs/runbook.md explains alerts that there are not: {sorted(orphans)}")
    with open(f"{prometheus}/alertmanager.example.yml", encoding="utf-8") as file:
        for words in re.findall(r"Focalfleet\(([\w|.+]+)\)", file.read()):
            for word in words.split("|"):
                if not any(re.fullmatch("Focalfleet" + word, name) for name in names):
                    fail(f"the Alertmanager's example inhibits Focalfleet{word}, which there is not")


def check_dashboard(root, bin_folder):
    with open(f"{root}/deploy/grafana/focalfleet.json", encoding="utf-8") as file:
        text = file.read()
    dashboard = json.loads(text)
    if dashboard["uid"] != "focalfleet" or "id" in dashboard:
        fail("the dashboard's uid is focalfleet, and it has no id of one Grafana")
    if set(re.findall(r'"uid": "([^"]+)"', text)) != {"focalfleet", "${DS}"}:
        fail("a panel names another source than ${DS}")
    rows = [panel["title"] for panel in dashboard["panels"] if panel["type"] == "row"]
    if rows != ["Night", "Plate", "Power against limits", "Buses", "Host"]:
        fail(f"rows: {rows}")
    ids = [panel["id"] for panel in dashboard["panels"]]
    if len(set(ids)) != len(ids):
        fail("two panels have one id")
    with Fleet(bin_folder) as fleet:
        port = free_port()
        with open(fleet.path("prometheus.yml"), "w", encoding="utf-8") as file:
            file.write(f"global: {{scrape_interval: 1s, evaluation_interval: 1s}}\n"
                       f"rule_files: [{root}/deploy/prometheus/focalfleet.rules.yml]\n"
                       f"scrape_configs:\n  - job_name: focalfleet\n    static_configs:\n"
                       f"      - targets: ['127.0.0.1:{fleet.port}']\n")
        fleet.start("prometheus", ["prometheus", f"--config.file={fleet.path('prometheus.yml')}",
                                   f"--storage.tsdb.path={fleet.path('data')}",
                                   f"--web.listen-address=127.0.0.1:{port}"])

        def ask(path, **query):
            answer = get(f"http://127.0.0.1:{port}/api/v1/{path}?{urllib.parse.urlencode(query)}")
            return json.loads(answer)["data"] if answer else None

        def series(expression):
            expression = expression.replace("$instance", ".+").replace("$__rate_interval", "1m")
            return (ask("query", query=expression) or {"result": []})["result"]
        fleet.ready_page()
        await_that("Prometheus has scraped", lambda: series('up{job="focalfleet"} == 1'))
        fleet.apply(10, 170)
        for title, expression in queries_of(dashboard):
            if not re.search(r"\$instance", expression):
                fail(f"'{title}' is not limited to the chosen daemon")
            await_that(f"'{title}' shows something: {expression}", lambda e=expression: series(e))
        annotation = dashboard["annotations"]["list"][0]["expr"]
        await_that("the annotation shows the configuration", lambda: series(annotation))
        groups = await_that("rules are there", lambda: ask("rules"))["groups"]
        rules = [rule for group in groups for rule in group["rules"]]
        if len(rules) != len(rules_of(root)):
            fail(f"Prometheus has {len(rules)} rules")
        def evaluated():
            healths = [rule["health"] for group in ask("rules")["groups"] for rule in group["rules"]]
            return "unknown" not in healths and healths
        if set(await_that("rules are evaluated", evaluated)) != {"ok"}:
            fail("a rule cannot be evaluated")
        # A sound fleet raises no alert, and each series that a rule asks for is there.
        for alert in ask("alerts")["alerts"]:
            fail(f"{alert['labels']['alertname']} is {alert['state']} for a sound fleet: {alert}")
        known = set(ask("label/__name__/values"))
        for rule in rules:
            for name in re.findall(r"\b(?:focalfleet|process)_\w+", rule["query"]):
                if name not in known:
                    fail(f"{rule['name']} asks for {name}, which there is not")


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    root = os.path.abspath(sys.argv[2])
    if sys.argv[1] == "page":
        check_page(root, sys.argv[3])
    elif sys.argv[1] == "rules":
        check_rules(root)
    elif sys.argv[1] == "dashboard":
        check_dashboard(root, sys.argv[3])
    else:
        sys.exit(__doc__)
    print(f"metrics_test: {sys.argv[1]} is as promised")


main()
