// What a unit's colour says. Each theme maps every unit to an index of its table, and the legend
// shows the table. Colours differ in lightness, too, so that they are told apart without hue; in the
// near view shapes say the same (near.js).

import {kPhases, kWitnesses} from "/page/frames.js";

const P = Object.fromEntries(kPhases.map((name, code) => [name, code]));

/** The states of a unit as the legend has them. Later ones are drawn on top. */
export const kStates = [
  {name: "ready", text: "standing"},
  {name: "arrived", text: "at target"},
  {name: "preparing", text: "being made ready"},
  {name: "moving", text: "moving"},
  {name: "unserved", text: "stopped or not served"},
  {name: "lost", text: "place not known"},
  {name: "silent", text: "not heard"},
  {name: "fault", text: "in fault"},
  {name: "disabled", text: "disabled: an obstacle"},
];
export const State = Object.fromEntries(kStates.map((state, index) => [state.name, index]));

export function stateOf(fleet, u) {
  if (!fleet.enabled[u]) return State.disabled;
  const phase = fleet.phase[u];
  if (phase === P.fault) return State.fault;
  if (phase === P.absent || phase === P.silent || phase === P.foreign) return State.silent;
  if (phase === P.moving || phase === P.homing || phase === P.settling) return State.moving;
  if (phase >= P.staging && phase <= P.armed) return State.preparing;
  if (fleet.witness[u] <= 1) return State.lost;
  if (phase === P.identifying) return State.silent;
  const outcome = fleet.outcome[u];  // frames.js, kOutcomes
  if (outcome >= 3) return State.unserved;
  return outcome === 2 ? State.arrived : State.ready;
}

const kErrorLimits_um = [5, 10, 20, 50, 100];
const kAgeLimits_s = [1, 5, 30, 120, 600];

function classOf(value, limits) {
  let index = 0;
  while (index < limits.length && value > limits[index]) ++index;
  return index;
}

function classTexts(limits, unit) {
  return [...limits.map((limit) => `up to ${limit} ${unit}`), `above ${limits.at(-1)} ${unit}`];
}

/** Colours that many groups share. */
const kSeries = ["s0", "s1", "s2", "s3", "s4", "s5", "s6"];

/** For each group a colour that no group beside it has, as far as there are enough of them. */
function coloursOfGroups(beside) {
  const chosen = [];
  const uses = kSeries.map(() => 0);
  beside.forEach((others, index) => {
    const taken = new Set([...others].map((other) => chosen[other]));
    const free = kSeries.map((_, k) => k).filter((k) => !taken.has(k));
    chosen[index] = free.length === 0 ? index % kSeries.length
      : free.reduce((best, k) => uses[k] < uses[best] ? k : best);
    ++uses[chosen[index]];
  });
  return chosen.map((k) => kSeries[k]);
}

function groups(neighbours, column, noun) {
  const values = [...new Set(column)].sort((a, b) => a - b);
  const indexOf = new Map(values.map((value, index) => [value, index]));
  const beside = values.map(() => new Set());
  column.forEach((value, u) => {
    for (const v of neighbours.of(u))
      if (column[v] !== value) beside[indexOf.get(value)].add(indexOf.get(column[v]));
  });
  const colours = coloursOfGroups(beside);
  return {
    entries: values.map((value, index) => ({colour: colours[index], text: `${noun} ${value}`})),
    indexOf: (u) => indexOf.get(column[u]),
  };
}

/** A unit draws power by its motors that turn. */
const kMotors = {title: "Power: motors that turn", entries: [{colour: "none", text: "none turns"},
  {colour: "q2", text: "one turns"}, {colour: "q4", text: "both turn"}]};

/**
 * The themes, by name: {title, entries: [{colour, text}], indexOf(u)}; `followsFrames`: each frame
 * may change the index of any unit.
 */
export function makeThemes(fleet, neighbours, now_ms) {
  const scale = (limits, unit, of, none) => ({
    entries: [...classTexts(limits, unit).map((text, k) => ({colour: `q${k}`, text})),
      {colour: "none", text: none}],
    indexOf: (u) => {
      const value = of(u);
      return Number.isNaN(value) ? limits.length + 1 : classOf(value, limits);
    },
  });
  return {
    state: {title: "State", entries: kStates.map(({name, text}) => ({colour: name, text})),
      indexOf: (u) => stateOf(fleet, u)},
    error: {title: "Distance from target",
      ...scale(kErrorLimits_um, "µm", (u) => fleet.error_um[u], "no target, or it moves")},
    known: {title: "How its place is known",
      entries: kWitnesses.map((text, k) => ({colour: ["none", "q4", "q2", "q1", "q0"][k], text})),
      indexOf: (u) => fleet.witness[u]},
    age: {title: "Last change",
      ...scale(kAgeLimits_s, "s ago", (u) => (now_ms() - fleet.changed_ms[u]) / 1000,
          "not since this page began")},
    power: {...kMotors, indexOf: (u) => fleet.motorsOf(u), followsFrames: true},
    ...(fleet.sector ? {sector: {title: "Sector", ...groups(neighbours, fleet.sector, "sector")}} : {}),
    bus: {title: "Bus", ...groups(neighbours, fleet.bus, "bus")},
    rail: {title: "Power rail", ...groups(neighbours, fleet.rail, "rail")},
  };
}

/** The themes of a film, which says nothing of knowledge and age. */
export function makeFilmThemes(film, themes) {
  return {
    state: {...themes.state, indexOf: (u) => film.state[u]},
    error: {...themes.error, title: "Measured distance from target", indexOf: (u) => {
      const value = film.error_um[u];
      return Number.isNaN(value) ? kErrorLimits_um.length + 1 : classOf(value, kErrorLimits_um);
    }},
    power: {...kMotors, indexOf: (u) => film.motorsOf(u)},
    ...(themes.sector ? {sector: themes.sector} : {}),
    bus: themes.bus,
    rail: themes.rail,
  };
}

const kNames = ["paper", "plate", "ink", "muted", "grid", "link", "obstacle", "pair", "none",
  ...kStates.map(({name}) => name), ...kSeries, "q0", "q1", "q2", "q3", "q4", "q5"];

/** Colours by name from the style sheet, which follow light and dark; `of32` for an ImageData. */
export function readColours(element) {
  const style = getComputedStyle(element);
  const colours = {};
  const of32 = {};
  for (const name of kNames) {
    const text = style.getPropertyValue(`--${name}`).trim();
    const hex = text.length === 4 ? text.replace(/[0-9a-f]/gi, "$&$&") : text;
    const value = parseInt(hex.slice(1), 16);
    colours[name] = hex;
    of32[name] = (0xFF000000 | (value & 0xFF) << 16 | (value & 0xFF00) | value >> 16) >>> 0;
  }
  return {...colours, of32};
}
