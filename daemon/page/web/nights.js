// Nights side by side, from noon to noon UTC, by the configurations that the store has of them.

import {duration, find, make} from "/page/dom.js";

const kConfigurations = 1000;
const kNights = 14;
const kHalfDay_ms = 12 * 3600 * 1000;

const median = (values) => {
  const sorted = values.filter((value) => value > 0).sort((a, b) => a - b);
  return sorted.length === 0 ? NaN : sorted[Math.floor((sorted.length - 1) / 2)];
};

/** The evening's date of the night in which an instant lies. */
export function nightOf(iso) {
  return new Date(Date.parse(iso) - kHalfDay_ms).toISOString().slice(0, 10);
}

function summaryOf(rows) {
  const done = rows.filter(({state}) => state === "done");  // others ended early
  const sum = (name) => rows.reduce((total, row) => total + row[name], 0);
  return {configurations: rows.length, targeted: sum("targeted"), arrived: sum("arrived"),
    lost: sum("refused") + sum("failed") + sum("unmeasured"),
    unitsStopped: sum("stopped"),
    stopped: rows.filter(({state}) => state === "stopped").length,
    makespan_s: median(done.map(({makespan_s}) => makespan_s ?? 0)),
    behind_s: median(done.map((row) => (row.makespan_s ?? 0) - (row.makespan_predicted_s ?? 0)))};
}

export class Nights {
  /** `isShown()`: whether somebody looks at the table. */
  constructor(api, isShown) {
    Object.assign(this, {api, isShown});
    this.key = "";
    this.asked = 0;
  }

  /** The newest state of the fleet: a configuration may have begun, or ended. */
  note({configuration: c, busy}) {
    const key = `${c.id} ${c.state} ${busy}`;
    if (key === this.key) return;
    this.key = key;
    if (this.isShown()) this.show();
  }

  async show() {
    const body = find("nights-table");
    const asked = ++this.asked;
    try {
      const {configurations} = await this.api.ask("history", {limit: kConfigurations});
      if (asked !== this.asked) return;  // a later question has a newer answer
      const nights = new Map();
      for (const row of configurations) {
        const night = nightOf(row.began);
        if (!nights.has(night)) nights.set(night, []);
        nights.get(night).push(row);
      }
      body.replaceChildren(this.tableOf([...nights].slice(0, kNights)), make("p", {class: "hint"},
          configurations.length === kConfigurations
            ? `The newest ${kConfigurations} configurations alone: the last night may be cut.` : ""));
    } catch (error) {
      if (asked === this.asked) body.replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }

  tableOf(nights) {
    if (nights.length === 0) return make("p", {class: "hint"}, "There was no configuration yet.");
    const heads = ["night of", "configurations", "of them stopped", "targets", "arrived", "units stopped",
      "units not served", "makespan, median", "behind plan"];
    const share = ({arrived, targeted}) => targeted === 0 ? "–"
      : `${(Math.floor(1000 * arrived / targeted) / 10).toFixed(1)} %`;
    return make("table", {class: "wide"}, make("caption", {}, "Nights, newest first"),
        make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", {scope: "col"}, text)))),
        make("tbody", {}, ...nights.map(([night, rows]) => {
          const s = summaryOf(rows);
          return make("tr", {}, make("th", {scope: "row"}, night), ...[s.configurations, s.stopped,
            s.targeted.toLocaleString("en"), share(s), s.unitsStopped, s.lost,
            duration(s.makespan_s), duration(s.behind_s)].map((value) => make("td", {}, String(value))));
        })));
  }
}
