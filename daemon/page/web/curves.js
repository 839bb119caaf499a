// The night as curves, by uPlot. The library comes with the first look at them. The daemon keeps
// the night (daemon/page/night_curves.h), so a fresh page has all of it at once.

import {find, make, setText} from "/page/dom.js";
import {kPhases} from "/page/frames.js";

const kRefresh_ms = 10_000;
const kHeight_px = 210;

/** Phases as the curves have them, from the bottom: few groups, so that they are told apart. */
const kGroups = [
  {text: "stand", colour: "ready", phases: ["ready"]},
  {text: "are made ready", colour: "preparing", phases: ["staging", "confirming", "arming", "armed"]},
  {text: "move", colour: "moving", phases: ["moving", "homing", "settling"]},
  {text: "fault", colour: "fault", phases: ["fault"]},
  {text: "not heard", colour: "silent", phases: ["absent", "identifying", "foreign", "silent"]},
];

async function loadLibrary() {
  if (!find("uplot-style"))
    document.head.append(make("link", {id: "uplot-style", rel: "stylesheet", href: "/page/uplot.css"}));
  return (await import("/page/uplot.js")).default;
}

/** Times of day in UTC, with seconds where the ticks are close. */
function timesOfDay(ticks) {
  const isClose = ticks.length > 1 && ticks[1] - ticks[0] < 60;
  return ticks.map((s) => new Date(1000 * s).toISOString().slice(11, isClose ? 19 : 16));
}

/** The range that is shown: a minute at least, where the night has just begun. */
function shownRange(x, low, high, isTime) {
  const span = x.length > 0 ? x.at(-1) - x[0] : 0;
  if (!isTime || x.length === 0 || span >= 60) return [low, high];
  return [x[0] - (60 - span) / 2, x.at(-1) + (60 - span) / 2];
}

/** Appends the columns of `more` to those of `all`, and drops what is older than the daemon keeps. */
function join(all, more, most) {
  for (const [name, column] of Object.entries(more)) {
    if (Array.isArray(column[0]) || name === "phases") {
      all[name] ??= column.map(() => []);
      column.forEach((one, k) => all[name][k].push(...one));
      all[name].forEach((one) => one.splice(0, Math.max(0, one.length - most)));
    } else {
      all[name] = (all[name] ?? []).concat(column);
      all[name].splice(0, Math.max(0, all[name].length - most));
    }
  }
}

export class Curves {
  constructor(api, plate, isShown) {
    Object.assign(this, {api, plate, isShown});
    this.charts = new Map();
    this.clear();
    setInterval(() => {
      if (!document.hidden && this.isShown()) this.refresh();
    }, kRefresh_ms);
    new ResizeObserver(() => this.fit()).observe(find("curves"));
  }

  clear() {
    this.data = {samples: {}, exposures: {}, plans: {}, power: null};
    this.newest_ms = -1;
  }

  async show() {
    try {
      this.library ??= await loadLibrary();
      await this.refresh();
    } catch (error) {
      setText(find("curves-trouble"), `Not known: ${error.message}.`);
    }
  }

  async refresh() {
    if (!this.library || this.busy) return;
    this.busy = true;
    try {
      const since = this.newest_ms < 0 ? "" : `?since_ms=${this.newest_ms}`;
      const more = await this.api.get(`/curves${since}`);
      for (const list of ["samples", "exposures", "plans"]) {
        join(this.data[list], more[list], 10_000);
        this.newest_ms = Math.max(this.newest_ms, ...more[list].at_ms.slice(-1));
      }
      this.data.power = more.power;
      setText(find("curves-trouble"), "");
      this.draw();
    } catch (error) {
      setText(find("curves-trouble"), `Not known: ${error.message}.`);
    } finally {
      this.busy = false;
    }
  }

  /** Another style sheet, or a new size: all charts are made anew. */
  remake() {
    for (const {chart, box} of this.charts.values()) {
      chart.destroy();
      box.remove();
    }
    this.charts.clear();
    if (this.isShown() && this.library) this.draw();
  }

  fit() {
    const width = find("curves").clientWidth;
    if (width > 0)
      for (const {chart} of this.charts.values())
        if (chart.width !== width) chart.setSize({width, height: kHeight_px});
  }

  draw() {
    this.drawPower();
    this.drawLoad();
    this.drawErrors();
    this.drawStates();
  }

  drawPower() {
    const {power} = this.data;
    const parts = power.total_W.length;
    if (parts === 0) return this.none("power", "Power of the newest configuration", "There was no plan yet.");
    const x = Array.from({length: parts}, (_, k) => power.end_s * k / (parts - 1));
    const rails = Object.keys(power.rail_W);
    const flat = (value) => new Array(parts).fill(value);
    const series = [
      ...rails.map((rail, k) => ({label: `rail ${rail}`, colour: `s${k % 7}`,
        values: power.rail_W[rail], dash: k >= 7 ? [6, 3] : undefined})),
      ...(rails.length > 1 ? [{label: "all", colour: "ink", values: power.total_W}] : []),
      ...(power.rail_limit_W > 0 ? [{label: "limit of a rail", colour: "fault", dash: [8, 4],
        values: flat(power.rail_limit_W)}] : []),
      ...(power.limit_W > 0 ? [{label: "limit of all", colour: "fault", dash: [2, 4],
        values: flat(power.limit_W)}] : []),
    ];
    const limits = power.rail_limit_W > 0 || power.limit_W > 0 ? "" : " No limit is set.";
    this.chart("power", {title: `Power of configuration ${power.configuration}, by its plan`, note: `Watts over seconds after the start signal.${limits}`,
    isTime: false, unit: "W", x, series});
  }

  drawLoad() {
    const {samples} = this.data;
    this.chart("load", {title: "Load of the fullest bus", note: "Per cent of its bits, the most of " +
        "each 10 s.", isTime: true, unit: "%", x: samples.at_ms.map((ms) => ms / 1000),
    series: [{label: "load", colour: "s0",
      values: samples.bus_load_max.map((load) => load === null ? null : 100 * load)}]});
  }

  drawErrors() {
    const {exposures} = this.data;
    if (exposures.at_ms.length === 0)
      return this.none("errors", "Errors of each exposure", "Nothing was measured since the daemon " +
          "began.");
    this.chart("errors", {title: "Errors of each exposure", note: "Distance from the targets, µm.",
      isTime: true, unit: "µm", isLog: true, x: exposures.at_ms.map((ms) => ms / 1000), points: true,
      series: [{label: "median", colour: "s0", values: exposures.median_um},
        {label: "worst", colour: "s1", dash: [4, 4], values: exposures.worst_um}]});
  }

  drawStates() {
    const {samples} = this.data;
    const sums = kGroups.map(({phases}) => samples.at_ms.map((_, k) => phases.reduce((sum, name) =>
      sum + samples.phases[kPhases.indexOf(name)][k], 0)));
    this.chart("states", {title: "Units by state", note: "One line for each; they add up to the fleet. Disabled " +
        "units count in their state, too.",
      isTime: true, unit: "", x: samples.at_ms.map((ms) => ms / 1000),
      series: [...kGroups.map(({text, colour}, k) => ({label: text, colour, values: sums[k]})),
        {label: "disabled", colour: "disabled", dash: [3, 3], values: samples.disabled}]});
  }

  boxOf(key, title, note) {
    const box = make("section", {class: "chart", "aria-label": title}, make("h3", {}, title),
        make("p", {class: "hint"}, note));
    box.dataset.key = key;
    const before = [...find("curves").children].find((other) => other.dataset.key === key);
    if (before) before.replaceWith(box);
    else find("curves").append(box);
    return box;
  }

  none(key, title, note) {
    this.charts.get(key)?.chart.destroy();
    this.charts.delete(key);
    this.boxOf(key, title, note);
  }

  /** Makes or renews a chart. Its values stand in a legend that follows the pointer. */
  chart(key, {title, note, isTime, unit, x, series, points = false, isLog = false}) {
    const data = [x, ...series.map(({values}) => values)];
    const form = JSON.stringify([title, note, series.map(({label}) => label)]);
    const known = this.charts.get(key);
    if (known && known.form === form) return known.chart.setData(data);
    known?.chart.destroy();
    const {colours} = this.plate;
    const axis = {stroke: colours.muted, grid: {stroke: colours.grid, width: 1},
      ticks: {stroke: colours.grid}, font: "12px system-ui, 'DejaVu Sans', sans-serif"};
    const box = this.boxOf(key, title, note);
    const chart = new this.library({width: Math.max(200, find("curves").clientWidth),
      height: kHeight_px, legend: {live: true}, cursor: {drag: {x: true, y: false}},
      tzDate: (ts) => this.library.tzDate(new Date(ts * 1000), "Etc/UTC"),
      scales: {x: {time: isTime, range: (u, low, high) => shownRange(u.data[0], low, high, isTime)},
        y: isLog ? {distr: 3}
          : {range: (_, low, high) => [Math.min(0, low ?? 0), Math.max(1, high ?? 1) * 1.08]}},
      axes: [isTime ? {...axis, values: (_, ticks) => timesOfDay(ticks)} : axis,
        {...axis, size: 64, values: (_, ticks) => ticks.map((tick) => tick === null ? ""
          : `${Number(tick.toPrecision(3)).toLocaleString("en")} ${unit}`)}],
      series: [isTime ? {label: "UTC", value: "{YYYY}-{MM}-{DD} {HH}:{mm}:{ss}"} : {label: "s"}, ...series.map(({label, colour, dash}) => ({label,
        stroke: colours[colour], width: 1.6, dash, points: {show: points || x.length < 3 || undefined, size: 6},
        value: (_, value) => value === null || value === undefined ? "–"
          : `${Number(value.toPrecision(4)).toLocaleString("en")} ${unit}`}))]}, data, box);
    this.charts.set(key, {chart, box, form});
  }
}
