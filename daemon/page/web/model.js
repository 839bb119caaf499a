// The model that blind commands go through: which one is in force, what its campaign promises, what
// the exposures since then show, and its changes.

import {clock, find, make, micrometres, setText} from "/page/dom.js";

const kModelBytesMax = 12 << 20;

const medianOf = (values) => {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted.length === 0 ? NaN : sorted[Math.floor((sorted.length - 1) / 2)];
};

/** Medians of the first exposure of each configuration, before and since an instant. */
export function achieved(exposures, since_ms) {
  const seen = new Set();
  const sides = {before: [], since: []};
  exposures.configuration.forEach((configuration, k) => {
    if (seen.has(configuration)) return;  // later exposures of it follow corrections
    seen.add(configuration);
    if (exposures.median_um[k] === null) return;
    sides[exposures.at_ms[k] < since_ms ? "before" : "since"].push(exposures.median_um[k]);
  });
  return {before_um: medianOf(sides.before), before: sides.before.length,
    since_um: medianOf(sides.since), since: sides.since.length};
}

export class Model {
  constructor(api, access) {
    Object.assign(this, {api, access});
    find("model-file").addEventListener("change", () => {
      const [file] = find("model-file").files;
      find("model-file").value = "";
      if (file) this.load(file);
    });
  }

  async show() {
    const body = find("model");
    try {
      const [model, {exposures}] = await Promise.all([this.api.ask("model"), this.api.get("/curves")]);
      body.replaceChildren(...this.partsOf(model, exposures));
    } catch (error) {
      body.replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }

  partsOf(model, exposures) {
    const {changes, in_force: held} = model;
    const [newest] = changes;
    const isIn = held !== null;
    return [
      make("p", {}, isIn ? make("b", {}, held.name) : "No model is in force: commands are nominal.",
          isIn && newest ? ` is in force since ${clock(newest.at)} UTC.` : ""),
      ...(isIn && newest ? [this.gainOf(newest, exposures)] : []),
      make("p", {class: "buttons"},
          this.access.guard(make("button", {type: "button", onclick: () => find("model-file").click()},
              "Load a model"), "model_load"),
          this.access.guard(make("button", {type: "button", onclick: () =>
            this.change("model_rollback", "Go back to the model before it?")}, "Roll back"),
          "model_rollback"),
          this.access.guard(make("button", {type: "button", onclick: () =>
            this.change("model_unload", "Command without a model?")}, "Unload"), "model_unload")),
      make("p", {id: "model-trouble", class: "trouble", role: "alert"}),
      make("h3", {}, "Changes, newest first"),
      changes.length === 0 ? make("p", {class: "hint"}, "There was none yet.")
        : make("table", {}, make("thead", {}, make("tr", {}, ...["since", "model", "campaign"].map((text) =>
            make("th", {scope: "col"}, text)))), make("tbody", {}, ...changes.slice(0, 20).map((change) => make("tr", {},
            make("td", {}, `${clock(change.at)} UTC`),
            make("td", {}, change.name || "no model"),
            make("td", {}, change.campaign || "–"))))),
    ];
  }

  /** The gain that the campaign promises, and the one that exposures show. */
  gainOf(newest, exposures) {
    const since_ms = Date.parse(newest.at);
    const {before_um, before, since_um, since} = achieved(exposures, since_ms);
    const known = (um, count) => count === 0 ? "no exposure known"
      : `${micrometres(um)} (${count} ${count === 1 ? "configuration" : "configurations"})`;
    return make("dl", {class: "gain"}, make("dt", {}, "predicted"), make("dd", {},
        `${micrometres(newest.rms_before_um ?? NaN)} → ` +
        `${micrometres(newest.rms_after_um ?? NaN)} rms, by campaign ${newest.campaign || "–"}`),
    make("dt", {}, "achieved"), make("dd", {}, `before ${known(before_um, before)}, since ` +
        `${known(since_um, since)}; medians of blind moves`));
  }

  async load(file) {
    if (file.size > kModelBytesMax)
      return setText(find("model-trouble"), `${file.name} is larger than 12 MB.`);
    await this.send("model_load", {model_toml: await file.text(), source: file.name});
  }

  /** A change asks once, with its meaning: it cannot be seen on the plate. */
  async change(verb, question) {
    const buttons = make("p", {class: "buttons", role: "group"}, question, " ",
        make("button", {type: "button", class: "main", onclick: () => this.send(verb, {})}, "Yes"),
        make("button", {type: "button", onclick: () => this.show()}, "No"));
    find("model-trouble").replaceChildren(buttons);
  }

  async send(verb, args) {
    try {
      await this.api.ask(verb, args);
      await this.show();
    } catch (error) {
      setText(find("model-trouble"), error.message);
    }
  }
}
