// A configuration from file to result: preview, apply, progress, and what came of it.

import {stateOf} from "/page/colours.js";
import {stopperOf} from "/page/commands.js";
import {counted, duration, find, make, micrometres, set, setText} from "/page/dom.js";
import {filmOfPreview} from "/page/film.js";
import {motionsIn} from "/page/motion.js";

const kFileBytesMax = 12 << 20;
const kUnservedShown = 8;
const kWorstShown = 8;

/** Reasons with their counts, the commonest first. */
function byReason(rows) {
  const counts = new Map();
  for (const {reason, outcome} of rows) {
    const text = (reason || outcome).replace(/ by unit \d+$/, " by another unit")
      .replace(/`focalfleet (\w+) \d+`/, "`focalfleet $1 UNIT`");
    counts.set(text, (counts.get(text) ?? 0) + 1);
  }
  return [...counts].sort((a, b) => b[1] - a[1]);
}

/** The highest power of a plan, and of its fullest rail, against their limits; 0: there is none. */
function powerText(peak_W, {limit_W, rail_limit_W, rail_W}) {
  const of = (watts, limit) => `at most ${watts.toFixed(0)} W` +
      (limit > 0 ? ` of ${limit.toFixed(0)} W` : "");
  const rails = Object.entries(rail_W).map(([rail, parts]) => [rail, Math.max(...parts)])
    .sort((a, b) => b[1] - a[1]);
  const [fullest] = rails;
  return of(peak_W, limit_W) + (rails.length > 1 || rail_limit_W > 0
    ? `; rail ${fullest[0]}, the fullest, ${of(fullest[1], rail_limit_W)}` : "") +
      (limit_W > 0 || rail_limit_W > 0 ? "" : "; no limit is set");
}

export class Configuration {
  /** `onUnit(id)`: the unit is to be shown; `onErrors()`: all units by their distance. */
  constructor(api, access, plate, player, {onUnit, onErrors}) {
    Object.assign(this, {api, access, plate, player, onUnit, onErrors});
    this.facts = null;
    this.file = null;
    this.preview = null;
    this.previewedAfter = undefined;  // the newest configuration then
    this.isShown = false;  // its plan is on the plate
    this.isApplied = false;  // it was commanded, and the daemon has not answered yet
    this.resultOf = "";  // the configuration whose result is shown
    find("choose-file").addEventListener("click", () => find("file").click());
    find("file").addEventListener("change", () => {
      const [file] = find("file").files;
      find("file").value = "";
      if (file) this.take(file);
    });
    this.acceptDrops();
  }

  acceptDrops() {
    let depth = 0;
    const show = (on) => { find("drop").hidden = !on; };
    window.addEventListener("dragenter", (event) => {
      event.preventDefault();
      show(++depth > 0);
    });
    window.addEventListener("dragleave", () => show(--depth > 0));
    window.addEventListener("dragover", (event) => event.preventDefault());
    window.addEventListener("drop", (event) => {
      event.preventDefault();
      depth = 0;
      show(false);
      const [file] = event.dataTransfer.files;
      if (file) this.take(file);
    });
  }

  say(...children) {
    find("preview").replaceChildren(...children);
  }

  clear() {
    this.file = null;
    this.preview = null;
    this.plate.marked = [];
    this.plate.showTargets(null);
    if (this.isShown) this.player.close();
    this.say();
  }

  // ---- preview

  async take(file) {
    if (!this.access.may("preview")) {
      this.say(make("p", {class: "trouble", role: "alert"},
          `A preview takes the role operator; you are ${this.access.role}.`));
      return;
    }
    if (file.size > kFileBytesMax) {
      this.say(make("p", {class: "trouble", role: "alert"}, `${file.name} is larger than 12 MB.`));
      return;
    }
    this.clear();  // of another file
    const taken = this.file = {source: file.name, targets_csv: await file.text()};
    this.say(make("p", {}, `${file.name}: a way is being planned. Nothing moves …`));
    try {
      const preview = await this.api.ask("preview", taken);
      if (taken === this.file) this.show(preview);
    } catch (error) {
      if (taken !== this.file) return;
      this.say(make("p", {class: "trouble", role: "alert"}, `${error.message}`),
          this.dismissButton());
    }
  }

  dismissButton() {
    return make("p", {class: "buttons"},
        make("button", {type: "button", onclick: () => this.clear()}, "Close"));
  }

  unitButton(id) {
    return make("button", {type: "button", class: "row-button", onclick: () => this.onUnit(id)},
        String(id));
  }

  show(preview) {
    this.preview = preview;
    this.previewedAfter = this.facts?.configuration.id;
    const {fleet} = this.plate;
    this.plate.marked = preview.unserved.map(({unit_id}) => fleet.placeOf.get(unit_id))
      .filter((u) => u !== undefined);
    this.plate.dirty = true;
    const not = preview.unserved.length;
    const corrections = make("select", {"aria-label": "Corrections by the camera"},
        ...[["not measured", ""], ["measured", "0"], ["1 correction", "1"], ["2 corrections", "2"],
          ["3 corrections", "3"]].map(([text, value]) => make("option", {value}, text)));
    const apply = this.access.guard(make("button", {type: "button", class: "main", id: "apply",
      onclick: () => this.apply(apply, corrections.value)},
    `Move ${counted(preview.moving, "unit")}`), "apply");
    const power = make("dd", {}, `at most ${preview.peak_power_W.toFixed(0)} W`);
    if (preview.moving > 0) this.addPower(power, preview);
    const play = preview.moving === 0 ? "" : make("button", {type: "button", id: "play-preview",
      onclick: () => this.playPreview(preview)}, "Play the plan");
    if (preview.moving > 0) this.addTargets(preview);
    // The buttons come first: what is known later does not move them.
    this.say(make("h3", {}, `Preview of ${this.file.source}`),
        make("p", {class: "buttons"}, apply, play,
            make("button", {type: "button", onclick: () => this.clear()}, "Discard")),
        ...(this.access.has("measure") ? [make("p", {class: "buttons"},
            make("span", {class: "hint"}, "Corrections"), corrections)] : []),
        make("p", {class: "trouble", id: "apply-trouble", role: "alert"}), make("dl", {},
            make("dt", {}, "served"), make("dd", {}, `${preview.served.toLocaleString("en")} of ` +
                counted(preview.targeted, "target")),
            make("dt", {}, "takes"), make("dd", {}, duration(preview.makespan_s)),
            make("dt", {}, "power"), power),
        ...(not === 0 ? [] : [make("p", {}, `${counted(not, "target")} not served, marked on the plate:`),
          ...this.reasonsAndUnits(preview.unserved)]));
  }

  /** Reasons with their counts, and units as buttons; the rest is counted. */
  reasonsAndUnits(rows) {
    const reasons = byReason(rows);
    const more = (count, noun) => count > 0 ? ` and ${counted(count, `more ${noun}`)}` : "";
    return [make("ul", {}, ...reasons.slice(0, kUnservedShown).map(([reason, count]) =>
      make("li", {}, `${count}: ${reason}`)), ...(reasons.length > kUnservedShown
      ? [make("li", {}, more(reasons.length - kUnservedShown, "reason").trim())] : [])),
    make("p", {}, ...rows.slice(0, kUnservedShown).flatMap(({unit_id}) =>
      [this.unitButton(unit_id), " "]), more(rows.length - kUnservedShown, "unit").trim())];
  }

  async addPower(element, preview) {
    try {
      const power = await this.api.get(`/preview-power?plan=${preview.plan}`);
      setText(element, powerText(preview.peak_power_W, power));
    } catch {
      // Another preview came since: the highest power stays alone.
    }
  }

  /** Another configuration has begun: the preview begins where units will no longer stand. */
  outdate() {
    this.preview.isOld = true;
    this.plate.showTargets(null);
    if (this.isShown) this.player.close();
    if (find("play-preview")) find("play-preview").disabled = true;
    setText(find("apply-trouble"), "Another configuration has begun since: preview the file again.");
  }

  /** The motion of the preview's plan. */
  async motionOf(preview) {
    const bytes = await this.api.bytes(`/preview-motion?plan=${preview.plan}`);
    if (!bytes) throw new Error("another preview came since; preview the file again");
    return motionsIn(bytes)[0];
  }

  /** The plate shows where the fibres are to go. */
  async addTargets(preview) {
    try {
      const {units} = preview.motion = await this.motionOf(preview);
      if (preview !== this.preview || preview.isOld) return;
      this.plate.showTargets(new Map([...units].map(([u, {end}]) => [u, end])));
    } catch {
      // Another preview came since: the plate shows its targets.
    }
  }

  /** The plan in motion, from the places where the units stand. */
  async playPreview(preview) {
    const {plate, player} = this;
    try {
      const motion = preview.motion ?? await this.motionOf(preview);
      const unserved = new Set(preview.unserved.map(({unit_id}) => plate.fleet.placeOf.get(unit_id)));
      const film = filmOfPreview(plate.fleet, motion, unserved,
          (u) => stateOf(plate.fleet, u));
      this.isShown = true;
      player.open(film, {name: "preview", title: `Preview of ${this.file.source}, not live: nothing moves.`,
        note: "By the rows of its plan.",
        describe: (u) => `Unit ${plate.fleet.id[u]}: ` + (unserved.has(u) ? "not served."
          : Number.isNaN(film.targetTheta[u]) ? "it stays." : "it moves."),
        closed: () => { this.isShown = false; }});
    } catch (error) {
      setText(find("apply-trouble"), `The plan cannot be shown: ${error.message}.`);
    }
  }

  async apply(button, corrections) {
    button.disabled = true;
    this.isApplied = true;
    const args = corrections === "" ? this.file
      : {...this.file, corrections: Number(corrections)};
    try {
      await this.api.ask("apply", args);
      this.clear();
    } catch (error) {
      setText(find("apply-trouble"), error.message);
      button.disabled = false;
    } finally {
      this.isApplied = false;
    }
  }

  // ---- progress and result

  note(facts) {
    this.facts = facts;
    const c = facts.configuration;
    const over = !facts.busy;
    this.showProgress();
    if (this.preview && !this.preview.isOld && !this.isApplied && c.id !== this.previewedAfter)
      this.outdate();
    const key = `${c.id} ${c.state} ${over}`;
    if (over && c.id > 0 && key !== this.resultOf) {
      this.resultOf = key;
      this.showResult(c);
    } else if (!over) {
      this.resultOf = "";
      this.showUnderWay(c);
    }
  }

  showProgress() {
    const {configuration: c, busy} = this.facts;
    const bar = find("progress");
    if (!busy) {
      setText(find("progress-text"), c.id === 0 ? "No configuration was applied yet."
        : `Configuration ${c.id} is ${c.state}.`);
      set(bar, "value", c.id !== 0 && c.state === "done" ? 1 : 0);
      return;
    }
    const late_s = c.makespan_s - c.makespan_predicted_s;
    let text = `Configuration ${c.id}: ${c.state}`;
    if (c.makespan_predicted_s > 0 && late_s <= 0)
      text += `, ${duration(Math.max(0, -late_s))} to its planned end`;
    else if (c.makespan_predicted_s > 0) text += `, ${duration(late_s)} behind its plan`;
    setText(find("progress-text"), text);
    const arrived = c.targeted > 0 ? c.arrived / c.targeted : 0;
    const passed = c.makespan_predicted_s > 0
      ? Math.min(0.99, c.makespan_s / c.makespan_predicted_s) : 0;
    set(bar, "value", Math.max(arrived, passed));
  }

  showUnderWay(c) {
    find("configuration").setAttribute("aria-live", "off");  // it changes several times a second
    find("configuration").replaceChildren(make("p", {}, make("b", {}, c.source || c.kind), " ",
        `is under way: ${c.arrived} of ${counted(c.targeted, "unit")} there` +
        (c.round > 1 ? `, round ${c.round}` : "") + "."),
    ...(c.waiting_for ? [make("p", {class: "hint"}, `It waits for ${c.waiting_for}.`)] : []),
    ...this.measuredRows(c));
  }

  measuredRows(c) {
    const rows = c.measured.map((round, k) => make("tr", {},
        make("td", {}, k === 0 ? "first" : `after correction ${k}`),
        make("td", {}, micrometres(round.median_um ?? NaN)),
        make("td", {}, micrometres(round.worst_um ?? NaN)),
        make("td", {}, `${round.within_tolerance} of ${round.measured}`)));
    if (rows.length === 0) return [];
    return [make("table", {}, make("thead", {}, make("tr", {},
        ...["measured", "median", "worst", "within"].map((text) =>
          make("th", {scope: "col"}, text)))), make("tbody", {}, ...rows))];
  }

  async showResult(c) {
    const parts = [["refused", c.refused], ["failed", c.failed], ["stopped", c.stopped],
      ["not confirmed", c.unmeasured]].filter(([, count]) => count > 0)
      .map(([text, count]) => `${count} ${text}`);
    const all = c.targeted > 0 && c.arrived === c.targeted;
    const element = find("configuration");
    const unserved = make("div");
    element.setAttribute("aria-live", "polite");
    element.replaceChildren(make("p", {}, make("b", {}, c.source || c.kind),
        ` (configuration ${c.id}) is ${c.state}.`),
    make("p", {class: all ? "good" : ""}, `${c.arrived} of ${counted(c.targeted, "unit")} arrived` +
        (parts.length > 0 ? `; ${parts.join(", ")}.` : ".")),
    ...(c.makespan_s > 0 ? [make("p", {class: "hint"}, `It took ${duration(c.makespan_s)}, planned ` +
        `${duration(c.makespan_predicted_s)}.`)] : []),
    ...this.measuredRows(c),
    ...(c.not_measured ? [make("p", {class: "trouble"}, `Not measured: ${c.not_measured}`)] : []),
    unserved, ...this.worstRows());
    if (c.state === "stopped") this.addStopper(element.firstElementChild, c.id);
    if (parts.length > 0) await this.addUnserved(unserved, c.id);
  }

  async addStopper(line, id) {
    try {
      const text = await stopperOf(this.api, this.access, id);
      if (text) line.append(` ${text}`);
    } catch {
      // The list of commands says why the audit cannot be read.
    }
  }

  worstRows() {
    const {fleet} = this.plate;
    const worst = this.plate.worst(kWorstShown).filter((u) => fleet.error_um[u] >= 1);
    if (worst.length === 0) return [];
    return [make("h3", {}, "Farthest from their targets"), make("table", {}, make("tbody", {},
        ...worst.map((u) => make("tr", {}, make("td", {}, this.unitButton(fleet.id[u])),
            make("td", {}, micrometres(fleet.error_um[u])))))),
    make("p", {class: "buttons"}, make("button", {type: "button", onclick: () => this.onErrors()},
        "Map of errors"))];
  }

  async addUnserved(element, id) {
    let status;
    try {
      status = await this.api.ask("status");
    } catch {
      return;
    }
    const {unserved} = status.configuration;
    if (status.configuration.id !== id || unserved.length === 0) return;
    const stopped = unserved.filter(({outcome}) => outcome === "stopped");
    const others = unserved.filter(({outcome}) => outcome !== "stopped");
    for (const [title, rows] of [["Stopped", stopped], ["Not served", others]])
      if (rows.length > 0) element.append(make("h3", {}, title), ...this.reasonsAndUnits(rows));
  }
}
