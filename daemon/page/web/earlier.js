// Configurations that are over, newest first, page by page, and the replay of each.

import {State} from "/page/colours.js";
import {clock, counted, duration, find, make, micrometres} from "/page/dom.js";
import {addRows, Film} from "/page/film.js";
import {motionsIn} from "/page/motion.js";

const kRowsOfPage = 10;
const kAlarmsShown = 8;
const kPagesMax = 64;  // of moves: 64 x 4096
const kNear_rad = 0.02 * Math.PI / 180;
const kRadians = Math.PI / 180;
/** The state of a unit whose move ended so. */
const kStateOf = {arrived: State.arrived, homed: State.arrived, stopped: State.unserved,
  fault: State.fault, never_began: State.unserved, interrupted: State.silent, open: State.silent};

const isClose = (a, b) => Math.abs(a - b) < kNear_rad;

/** Moves of the store's columns: {u, began_s, ended_s, end, from, to, ended} in radians. */
function movesOf(columns, placeOf) {
  const {unit_id: ids} = columns;
  const pair = (name, k) => [columns[`theta_${name}_deg`][k], columns[`phi_${name}_deg`][k]]
    .map((deg) => deg === null ? NaN : deg * kRadians);
  return ids.map((id, k) => ({u: placeOf.get(id), began_s: columns.round_began_s[k],
    ended_s: columns.ended_s[k], end: columns.end[k], from: pair("from", k), to: pair("to", k),
    ended: pair("end", k)})).filter(({u}) => u !== undefined);
}

/** The planned move that this one carried out; null: its rows are not kept. */
function plannedOf(move, motions) {
  for (const [index, motion] of motions.entries()) {
    const planned = motion.units.get(move.u);
    if (planned && [0, 1].every((a) => isClose(planned.begin[a], move.from[a]) &&
        isClose(planned.end[a], move.to[a]))) return {index, planned};
  }
  return null;
}

/**
 * The film of a configuration, as far as the store and the kept plans know it: moves that ended as
 * planned go by the plan's rows, all others evenly from where they began to where they ended.
 */
export function filmOfReplay(fleet, moves, motions, errors) {
  const film = new Film(fleet.count);
  film.state.fill(State.ready);
  // A disabled unit does not move: it most likely stood where it stands now. Units that took part are
  // drawn over this.
  for (let u = 0; u < fleet.count; ++u)
    if (!fleet.enabled[u]) film.stand(u, fleet.theta[u], fleet.phi[u], State.disabled);
  // The start signal came before the first unit was heard at its planned end.
  const starts = motions.map(() => Infinity);
  for (const move of moves) {
    move.plan = plannedOf(move, motions);
    if (move.plan && move.end === "arrived" && move.ended_s !== null)
      starts[move.plan.index] = Math.min(starts[move.plan.index],
          move.ended_s - move.plan.planned.end_s);
  }
  const counts = {byPlan: 0, even: 0, still: 0, open: 0, ends: new Map(),
    disabled: fleet.count - fleet.enabled.reduce((sum, is) => sum + is, 0)};
  for (const move of moves) {
    const {u, end, from, to} = move;
    if (film.restState[u] === State.disabled) {  // it took part, and was disabled later
      film.stand(u, NaN, NaN, State.ready);
      --counts.disabled;
    }
    counts.ends.set(end, (counts.ends.get(end) ?? 0) + 1);
    [film.targetTheta[u], film.targetPhi[u]] = to;
    const start_s = move.plan ? starts[move.plan.index] : Infinity;
    const ended_s = move.ended_s ?? move.began_s;
    if (end === "arrived" && Number.isFinite(start_s)) {
      ++counts.byPlan;
      addRows(film, u, move.plan.planned, start_s);
      film.span(u, start_s, start_s + move.plan.planned.end_s, kStateOf[end]);
      continue;
    }
    const began_s = Math.min(ended_s, Number.isFinite(start_s) ? start_s : move.began_s);
    const last = [0, 1].map((a) => Number.isNaN(move.ended[a]) ? from[a] : move.ended[a]);
    const moved = [0, 1].some((a) => !isClose(last[a], from[a]));
    ++counts[move.ended_s === null ? "open" : moved ? "even" : "still"];
    for (const a of [0, 1]) film.turn(u, a, began_s, ended_s, from[a], last[a] - from[a]);
    film.span(u, began_s, ended_s, kStateOf[end] ?? State.silent);
  }
  errors.unit_id.forEach((id, k) => {
    const u = fleet.placeOf.get(id);
    if (u !== undefined) film.error_um[u] = errors.error_um[k] ?? NaN;
  });
  return {film: film.finish(), counts};
}

/** Which of the two is shown. */
export function noteOf({byPlan, even, still, open, disabled}) {
  const rest = (still > 0 ? ` ${counted(still, "unit")} did not move.` : "") + (open > 0
    ? ` The end of ${counted(open, "move")} is not known, or not yet: shown where it began.` : "") +
      (disabled > 0 ? ` ${counted(disabled, "unit")} took no part, disabled now: shown as now.` : "");
  if (byPlan === 0 && even === 0) return `${open > 0 ? "" : "Nothing moved."}${rest}`.trim();
  if (byPlan === 0) return "Even motion between the recorded beginning and end of each move: " +
      `the rows of the plan are not kept.${rest}`;
  if (even === 0) return `By the rows of its plan.${rest}`;
  return `By the rows of its plan; ${counted(even, "move")} that ended otherwise or whose rows are ` +
      `not kept: even motion from beginning to end.${rest}`;
}

export class Earlier {
  constructor(api, access, plate, player) {
    Object.assign(this, {api, access, plate, player});
    this.key = "";
    this.asked = 0;      // for replays
    this.askedList = 0;
    find("earlier").addEventListener("toggle", () => {
      if (find("earlier").open) this.page(null);
    });
  }

  note(facts) {
    const {configuration: c} = facts;
    const key = `${c.id} ${c.state} ${facts.busy}`;
    if (key === this.key) return;
    this.key = key;
    if (find("earlier").open) this.page(null);
  }

  /** Configurations whose last change was before an instant; null: the newest. */
  async page(before) {
    const body = find("earlier-list");
    const asked = ++this.askedList;
    try {
      const {configurations} = await this.api.ask("history",
          {limit: kRowsOfPage, ...(before === null ? {} : {until_ns: before})});
      if (asked !== this.askedList) return;  // a later question has a newer answer
      body.querySelector(".more")?.remove();
      if (before === null) body.replaceChildren();
      body.append(...configurations.map((row) => this.rowOf(row)));
      if (configurations.length === 0 && before === null)
        body.append(make("p", {class: "hint"}, "There was none yet."));
      if (configurations.length === kRowsOfPage)
        body.append(make("button", {type: "button", class: "more", onclick: () =>
          this.page(Date.parse(configurations.at(-1).changed) * 1_000_000)}, "Earlier ones"));
    } catch (error) {
      if (asked === this.askedList) body.replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }

  rowOf(row) {
    const took = row.makespan_s > 0 ? `, ${duration(row.makespan_s)}` : "";
    return make("div", {class: "earlier-row"}, make("div", {}, make("b", {}, `${row.id} `),
        row.source || "without a file", make("br"), make("span", {class: "hint"},
            `${clock(row.began)} UTC, ${row.state}: ${row.arrived} of ${row.targeted} arrived${took}`)),
    make("button", {type: "button", "aria-label": `Replay configuration ${row.id}`,
      onclick: () => this.replay(row.id)}, "Replay"));
  }

  async replay(id) {
    const asked = ++this.asked;
    const say = (text, cls = "hint") => find("replay-trouble").replaceChildren(
        make("p", {class: cls}, text));
    say(`Configuration ${id} is being read …`);
    try {
      const [{first, moves, isCut}, motions] = await Promise.all([this.read(id), this.motions(id)]);
      if (asked !== this.asked) return;
      say("");
      const {film, counts} = filmOfReplay(this.plate.fleet, moves, motions, first.errors);
      const lastOf = new Map(moves.map((move) => [move.u, move]));
      this.player.open(film, {name: "replay", title: `Replay of configuration ${id}, not live.`,
        note: noteOf(counts) + (isCut ? " It is too long to be shown whole." : ""),
        describe: (u) => this.describe(film, lastOf.get(u), u),
        closed: () => find("replay-trouble").replaceChildren()});
      this.showEnds(first, counts);
    } catch (error) {
      if (asked === this.asked) say(`No replay: ${error.message}.`, "trouble");
    }
  }

  /** All pages of the store about it. */
  async read(id) {
    const first = await this.api.ask("replay", {configuration: id});
    const moves = movesOf(first.moves, this.plate.fleet.placeOf);
    let {next} = first;
    for (let page = 1; next !== null && page < kPagesMax; ++page) {
      const more = await this.api.ask("replay", {configuration: id, after: next});
      moves.push(...movesOf(more.moves, this.plate.fleet.placeOf));
      ({next} = more);
    }
    return {first, moves, isCut: next !== null};
  }

  async motions(id) {
    const bytes = await this.api.bytes(`/motion?configuration=${id}`);
    return bytes ? motionsIn(bytes) : [];
  }

  describe(film, move, u) {
    const name = `Unit ${this.plate.fleet.id[u]}: `;
    if (!move) return `${name}it took no part.` + (film.restState[u] === State.disabled
      ? " It is disabled now, and shown where it stands now." : "");
    const at = move.ended_s === null ? "" : ` ${duration(move.ended_s)} after it was applied`;
    const off = Number.isNaN(film.error_um[u]) ? ""
      : `; measured ${micrometres(film.error_um[u])} from its target`;
    return `${name}${move.end.replace("_", " ")}${at}${off}.`;
  }

  showEnds(first, counts) {
    const ends = [...counts.ends].sort((a, b) => b[1] - a[1])
      .map(([end, count]) => `${count.toLocaleString("en")} ${end.replace("_", " ")}`).join(", ");
    find("replay-trouble").replaceChildren(make("p", {}, `Moves: ${ends || "none"}.`),
        make("ul", {}, ...first.alarms.slice(0, kAlarmsShown).map(({text, at}) =>
          make("li", {class: "event warning"}, `${clock(at)} UTC ${text}`))),
        first.alarms.length > kAlarmsShown
          ? make("p", {}, `and ${counted(first.alarms.length - kAlarmsShown, "alarm")} more`) : "");
  }
}
