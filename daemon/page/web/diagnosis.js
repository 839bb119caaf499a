// A diagnosis: a campaign is given, the daemon has it diagnosed in a process of its own, and its
// report is shown here. The verdict comes first, as a sentence.

import {clock, duration, find, make, setText} from "/page/dom.js";

const kBytesMax = 15 << 20;  // of a request
const kPeriod_ms = 2000;

const kVerdicts = {
  consistent: "The simulation is right within the noise: nothing is to be corrected.",
  explained: "The causes below explain what the simulation gets wrong.",
  ambiguous: "The causes below explain it, but others would do as well: see their rivals.",
  unknown: "The simulation is wrong in a way that no known cause explains in full.",
  insufficient: "The campaign is not enough for a verdict.",
};

const number = (value, digits = 3) => value === null || value === undefined ? "–"
  : Number(value.toPrecision(digits)).toLocaleString("en");

export class Diagnosis {
  constructor(api, access, isShown, onModel) {
    Object.assign(this, {api, access, isShown, onModel});
    this.reportOf = "";
    find("campaign-files").addEventListener("change", () => {
      const files = [...find("campaign-files").files];
      find("campaign-files").value = "";
      this.begin(files);
    });
    find("choose-campaign").addEventListener("click", () => find("campaign-files").click());
    setInterval(() => {
      if (!document.hidden && this.isShown() && this.state === "running") this.show();
    }, kPeriod_ms);
  }

  say(text) {
    setText(find("diagnosis-trouble"), text);
  }

  async begin(files) {
    const of = (name) => files.find((file) => file.name.endsWith(name));
    const [moves, units] = [of("moves.csv"), of("units.csv")];
    if (!moves || !units) return this.say("A campaign is two files: moves.csv and units.csv. Choose both.");
    if (moves.size + units.size > kBytesMax)
      return this.say("These files are larger than 15 MB: use focalfleet diagnose at the host.");
    const folder = moves.webkitRelativePath?.split("/").at(-2);
    const name = (folder || moves.name.replace(/-?moves\.csv$/, "") || "campaign").slice(0, 80);
    this.say("");
    try {
      this.showState(await this.api.post("/diagnosis",
          {name, moves_csv: await moves.text(), units_csv: await units.text()}));
    } catch (error) {
      this.say(`Not begun: ${error.message}.`);
    }
  }

  async show() {
    this.access.guard(find("choose-campaign"), "diagnose");
    try {
      this.showState(await this.api.get("/diagnosis"));
    } catch (error) {
      this.say(`Not known: ${error.message}.`);
    }
  }

  async showState(now) {
    this.state = now.state;
    const body = find("diagnosis");
    if (now.state === "none") return body.replaceChildren(make("p", {class: "hint"}, "There was none yet."));
    const what = make("p", {}, make("b", {}, now.name), ` by ${now.by}, begun ` +
        `${clock(new Date(now.began_ms).toISOString())} UTC: `);
    if (now.state === "running") {
      const share = /(\d+) %/.exec(now.stage);
      what.append(`runs since ${duration(now.took_s)}.`);
      return body.replaceChildren(what, make("progress", {max: 1,
        value: share ? Number(share[1]) / 100 : 0, "aria-label": "Progress of the diagnosis"}),
      make("p", {class: "hint"}, now.stage), make("p", {class: "buttons"}, this.access.guard(
          make("button", {type: "button", id: "cancel-diagnosis", onclick: () => this.cancel()}, "Cancel"),
          "diagnose")));
    }
    if (now.state !== "done") {
      what.append(now.state === "cancelled" ? "it was cancelled."
        : `it failed after ${duration(now.took_s)}. ${[now.why, now.stage].filter(Boolean).join("; ")}`);
      return body.replaceChildren(what);
    }
    what.append(`it took ${duration(now.took_s)}.`);
    const key = `${now.name} ${now.began_ms} ${this.access.role}`;
    if (key === this.reportOf && body.childElementCount > 0) return;
    this.reportOf = key;
    body.replaceChildren(what, ...this.reportParts(await this.api.get("/diagnosis-report")));
  }

  reportParts(report) {
    const {causes, gain, unknown, data} = report;
    const verdict = kVerdicts[report.verdict] ?? `Verdict: ${report.verdict.replaceAll("_", " ")}.`;
    const rows = causes.map((cause) => make("tr", {}, make("td", {}, cause.cause.replaceAll("_", " ")),
        ...[cause.axis || "–", cause.scope,
          `${number(cause.amplitude)} ${cause.amplitude_unit ?? ""}`, `${number(cause.rms_um)} µm`,
          (cause.candidates ?? []).filter((name) => name !== cause.cause).join(", ").replaceAll("_", " ")
            || "–"].map((text) => make("td", {}, text))));
    return [make("p", {class: "verdict"}, report.missing ? `${verdict} ${report.missing}.` : verdict),
      this.gainLine(gain),
      ...(rows.length === 0 ? [] : [make("table", {class: "wide"}, make("thead", {}, make("tr", {},
          ...["cause", "axis", "scope", "amplitude", "error it makes", "rivals"].map((text) =>
            make("th", {scope: "col"}, text)))), make("tbody", {}, ...rows))]),
      ...(unknown.length === 0 ? [] : [make("p", {}, `${unknown.length} findings without a known cause; ` +
          "the report has them.")]),
      make("p", {class: "hint"}, `${data.rows.toLocaleString("en")} rows of ` +
          `${data.units.toLocaleString("en")} units.`),
      make("ul", {}, ...report.remarks.map((remark) => make("li", {class: "hint"}, remark))),
      make("p", {class: "buttons"},
          make("button", {type: "button", onclick: () => this.keep("/diagnosis-page", "report.html")},
              "Keep the report"),
          make("button", {type: "button", onclick: () => this.keep("/diagnosis-model", "model.toml")},
              "Keep the model"),
          this.access.guard(make("button", {type: "button", onclick: () => this.load(report)},
              "Load the model"), "model_load"))];
  }

  gainLine(gain) {
    const before = gain?.rms_before_um;
    const after = gain?.rms_after_um;
    return make("p", {}, before === null || before === undefined ? ""
      : `On moves that no fit has seen: ${number(before)} µm rms before, ${number(after)} µm with the model.`);
  }

  /** A file of the report goes to the browser's downloads. */
  async keep(path, name) {
    try {
      const url = URL.createObjectURL(new Blob([await this.api.bytes(path)]));
      make("a", {href: url, download: name}).click();
      setTimeout(() => URL.revokeObjectURL(url), 10_000);
    } catch (error) {
      this.say(`Not there: ${error.message}.`);
    }
  }

  async load(report) {
    try {
      const model_toml = new TextDecoder().decode(await this.api.bytes("/diagnosis-model"));
      await this.api.ask("model_load", {model_toml, source: report.model.after});
      this.onModel();
    } catch (error) {
      this.say(`Not loaded: ${error.message}.`);
    }
  }

  async cancel() {
    try {
      await this.showState(await this.api.post("/diagnosis-cancel", {}));
    } catch (error) {
      this.say(`Not cancelled: ${error.message}.`);
    }
  }
}
