// What one unit did and was: its moves with the error measured after each, newest first and page by
// page; its parameters, and who gave them; its alarms and changes. The latter two are asked for
// while they are open alone.

import {justBefore} from "/page/api.js";
import {dayAndClock, make, micrometres} from "/page/dom.js";
import {eventLine} from "/page/events.js";

const kMovesOfPage = 10;
const kEventsOfPage = 10;
const kInUse = ["counter1", "repeat", "subdivision"];

/** What was measured after a move and before the next one of the same configuration, as a text. */
function errorAfter(move, next, measured) {
  const until_ms = next?.configuration === move.configuration ? Date.parse(next.began) : Infinity;
  const began_ms = Date.parse(move.began);
  const found = measured.findLast(({configuration, at}) => configuration === move.configuration &&
      Date.parse(at) >= began_ms && Date.parse(at) < until_ms);
  if (!found) return "–";
  return found.error_um === null ? found.status.replaceAll("_", " ") : micrometres(found.error_um);
}

const headOf = (...texts) => make("thead", {}, make("tr", {}, ...texts.map((text) =>
  make("th", {scope: "col"}, text))));

const hint = (text) => make("p", {class: "hint"}, text);

/** A part that is filled by `fill(body)` when it is opened, or when its unit is another one. */
class Folded {
  constructor(title, fill) {
    this.fill = fill;
    this.body = make("div");
    this.element = make("details", {ontoggle: () => this.renew()},
        make("summary", {}, make("h3", {}, title)), this.body);
  }

  renew() {
    this.body.replaceChildren();
    if (this.element.open) this.fill(this.body);
  }
}

export class UnitHistory {
  constructor(api) {
    this.api = api;
    this.id = null;
    this.key = "";
    this.moves = make("div");
    this.parameters = new Folded("Parameters", (body) => this.fillParameters(body));
    this.events = new Folded("Alarms and changes", (body) => this.fillEvents(body, null));
    this.elements = [this.moves, this.parameters.element, this.events.element];
  }

  show(id) {
    if (id !== this.id) this.moves.replaceChildren();
    this.id = id;
    this.page(null);
    this.parameters.renew();
    this.events.renew();
  }

  /** The newest state of the fleet: a unit that is shown may have moved. */
  note({configuration: c, busy}) {
    const key = `${c.id} ${c.state} ${c.measured.length} ${busy}`;
    if (key === this.key) return;
    this.key = key;
    if (this.id !== null && this.moves.isConnected) this.page(null);
  }

  /** Asks about the unit that is shown; null: it failed, as `body` says, or another is shown now. */
  async ask(body, verb, args) {
    const {id} = this;
    try {
      const answer = await this.api.ask(verb, args);
      return id === this.id ? answer : null;
    } catch (error) {
      if (id === this.id) body.replaceChildren(hint(`Not known: ${error.message}.`));
      return null;
    }
  }

  /** Moves before an instant; null: the newest. */
  async page(before) {
    const answer = await this.ask(this.moves, "history", {unit_id: this.id, limit: kMovesOfPage,
      ...(before === null ? {} : {until_ns: before})});
    if (answer) this.addMoves(answer, before === null);
  }

  addMoves({moves, measured}, isFirst) {
    this.moves.querySelector(".more")?.remove();
    if (isFirst) {
      this.rows = make("tbody");
      this.later = null;  // the move after those that come next
      this.moves.replaceChildren(make("h3", {}, "Moves, newest first"), moves.length === 0
        ? hint("It has not moved yet.")
        : make("table", {}, headOf("began, UTC", "conf.", "end", "off by"), this.rows));
    }
    for (const move of moves) {
      this.rows.append(make("tr", {}, make("td", {title: move.began}, dayAndClock(move.began)),
          make("td", {}, String(move.configuration)), make("td", {}, move.end.replaceAll("_", " ")),
          make("td", {}, errorAfter(move, this.later, measured))));
      this.later = move;
    }
    if (moves.length < kMovesOfPage) return;
    // ISO times have milliseconds; the earlier page ends there.
    const until_ns = Date.parse(moves.at(-1).began) * 1_000_000;
    this.moves.append(make("button", {type: "button", class: "more",
      onclick: () => this.page(until_ns)}, "Earlier moves"));
  }

  /** What its drive goes by, and what was written to it. */
  async fillParameters(body) {
    const answer = await this.ask(body, "params", {unit_id: this.id});
    if (!answer) return;
    const {drive, parameters} = answer;
    const rowOf = (axis, name, value, written) => make("tr", {}, make("td", {}, axis),
        make("td", {}, name.replaceAll("_", " ")), make("td", {}, String(value)),
        make("td", {}, written ? `${written.origin}, ${written.at.slice(0, 10)}` : "default"));
    const rows = [];
    for (const axis of ["theta", "phi"]) {
      for (const name of kInUse)
        rows.push(rowOf(axis, name, drive[`${axis}_${name}`], parameters.find((one) =>
          one.axis === axis && one.parameter === name)));
      for (const one of parameters)
        if (one.axis === axis && !kInUse.includes(one.parameter))
          rows.push(rowOf(axis, one.parameter, one.value, one));
    }
    body.replaceChildren(make("table", {}, headOf("axis", "parameter", "value", "origin"),
        make("tbody", {}, ...rows)), hint(`Waves: ${drive.mode}, at ${drive.v_bus_V} V.`));
  }

  /** Events before an instant; null: the newest. */
  async fillEvents(body, before) {
    const answer = await this.ask(body, "events", {unit_ids: [this.id], limit: kEventsOfPage,
      ...(before === null ? {} : {until_ns: before})});
    if (!answer) return;
    const events = answer.events.reverse();
    body.querySelector(".more")?.remove();
    if (before === null) body.replaceChildren(...(events.length === 0 ? [hint("None is known.")] : []));
    body.append(...events.map(eventLine));
    if (events.length === kEventsOfPage)
      body.append(make("button", {type: "button", class: "more",
        onclick: () => this.fillEvents(body, justBefore(events.at(-1).at_ns))}, "Earlier"));
  }
}
