// A diagnosis: a campaign is given, the daemon has it diagnosed in a process of its own, and its
// report is shown here, as report.html has it.

import {clock, counted, duration, find, make, setText} from "/page/dom.js";

const kBytesMax = 15 << 20;  // of a request
const kPeriod_ms = 2000;
const kHalfDay_ms = 43_200_000;
const kRecordingsShown = 40;

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
    await this.ask({name, moves_csv: await moves.text(), units_csv: await units.text()});
  }

  /** What the daemon's store has: the moves of a list, or the configurations of a night. */
  async showRecordings() {
    const body = find("recordings");
    try {
      const {recordings} = await this.api.get("/recordings");
      if (recordings.length === 0) return body.replaceChildren();
      const nameOf = ({name, night, began_ms}) => night
        ? `Night of ${new Date(began_ms - kHalfDay_ms).toISOString().slice(0, 10)}` : name;
      const select = make("select", {"aria-label": "A campaign of the daemon"},
          ...recordings.slice(0, kRecordingsShown).map((one, k) => make("option", {value: k},
              `${nameOf(one)}: ${counted(one.configurations, "configuration")} from ${one.first} on`)));
      body.replaceChildren(this.access.guard(make("button", {type: "button", id: "diagnose-recording",
        onclick: () => {
          const {first, last} = recordings[select.value];
          this.ask({name: nameOf(recordings[select.value]).slice(0, 80), recorded: {first, last}});
        }}, "Diagnose what the daemon measured"), "diagnose"), select);
    } catch (error) {
      body.replaceChildren(make("span", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }

  async ask(campaign) {
    this.say("");
    try {
      this.showState(await this.api.post("/diagnosis", campaign));
    } catch (error) {
      this.say(`Not begun: ${error.message}.`);
    }
  }

  /** The sheet comes into view. */
  async open() {
    await Promise.all([this.show(), this.showRecordings()]);
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
    if (now.state !== "done") {
      this.reportOf = "";
      find("diagnosis-report").replaceChildren();
    }
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
    if (key === this.reportOf && body.childElementCount > 1) return;
    this.reportOf = key;
    const [report, page] = await Promise.all([this.api.get("/diagnosis-report"),
      this.api.bytes("/diagnosis-page")]);
    body.replaceChildren(what, make("p", {class: "buttons"},
        make("button", {type: "button", onclick: () => this.keep("/diagnosis-page", "report.html")},
            "Keep the report"),
        make("button", {type: "button", onclick: () => this.keep("/diagnosis-model", "model.toml")},
            "Keep the model"),
        this.access.guard(make("button", {type: "button", onclick: () => this.load(report)},
            "Load the model"), "model_load")));
    find("diagnosis-report").replaceChildren(...this.partsOf(new TextDecoder().decode(page)));
  }

  /** What is inside the body of a report, but for its title. */
  partsOf(html) {
    const inside = html.slice(html.indexOf(">", html.indexOf("<body")) + 1, html.indexOf("</body>"));
    const parsed = new DOMParser().parseFromString(inside, "text/html");
    parsed.querySelector("h1")?.remove();
    return parsed.body.childNodes;
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
