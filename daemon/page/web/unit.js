// One unit: where it is, what is known and by whom, and what it did, newest first.

import {kOutcomes, kPhases} from "/page/frames.js";
import {clock, find, make, micrometres, setText} from "/page/dom.js";

const kRowsOfPage = 10;
const kRefresh_ms = 2000;

function degrees(axis) {
  if (axis.low_deg === null) return "not known";
  const place = axis.low_deg === axis.high_deg ? `${axis.low_deg.toFixed(3)}°`
    : `${axis.low_deg.toFixed(2)}° … ${axis.high_deg.toFixed(2)}°`;
  return `${place} (${axis.witness})`;
}

function point(x, y) {
  return x === null || y === null ? "–" : `${x.toFixed(3)}, ${y.toFixed(3)} mm`;
}

export class UnitPanel {
  /** `onView()`: the view moves; `onSelect(place)`: another unit, or -1. */
  constructor(api, plate, onView, onSelect) {
    Object.assign(this, {api, plate, onView, onSelect});
    this.place = -1;
    this.list = make("dl");
    this.history = make("div");
    this.asked = 0;
    find("find").addEventListener("submit", (event) => {
      event.preventDefault();
      this.showId(Number(find("find-id").value));
    });
    find("worst").addEventListener("click", () => this.showWorst());
    setInterval(() => {
      if (!document.hidden && this.place >= 0) this.refresh();
    }, kRefresh_ms);
  }

  showId(id) {
    const place = this.plate.fleet.placeOf.get(id);
    setText(find("find-trouble"), place === undefined ? `There is no unit ${id}.` : "");
    if (place === undefined) return;
    this.plate.view.showUnit(place);
    this.onView();
    this.select(place);
  }

  /** The unit that stands farthest from its target. */
  showWorst() {
    const [worst] = this.plate.worst(1);
    if (worst === undefined) setText(find("find-trouble"), "No unit stands off its target.");
    else this.showId(this.plate.fleet.id[worst]);
  }

  select(place) {
    this.onSelect(place);
    if (place !== this.place) this.history.replaceChildren();
    this.place = place;
    this.plate.selected = place;
    this.plate.dirty = true;
    find("unit-hint").hidden = place >= 0;
    find("unit").replaceChildren(...(place >= 0 ? [this.list, this.history] : []));
    if (place < 0) return;
    find("find-id").value = String(this.plate.fleet.id[place]);
    this.list.replaceChildren();
    this.refresh();
    this.page(null);
  }

  async refresh() {
    const asked = ++this.asked;
    const {fleet} = this.plate;
    const u = this.place;
    try {
      const unit = await this.api.ask("unit", {unit_id: fleet.id[u]});
      if (asked === this.asked) this.show(unit);
    } catch (error) {
      if (asked !== this.asked) return;
      this.rows([["state", kPhases[fleet.phase[u]]], ["target", kOutcomes[fleet.outcome[u]]],
        ["more", `not known: ${error.message}`]]);
    }
  }

  rows(pairs) {
    this.list.replaceChildren(...pairs.filter(([, value]) => value !== "")
      .flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
  }

  show(unit) {
    const {fleet} = this.plate;
    this.rows([
      ["state", unit.enabled ? unit.phase : `${unit.phase}, disabled: ${unit.disabled_reason}`],
      ["fault", unit.fault === "none" ? "" : unit.fault],
      ["target", unit.outcome === "none" ? "none" :
        unit.outcome + (unit.reason ? `: ${unit.reason}` : "")],
      ["theta", degrees(unit.theta)],
      ["phi", degrees(unit.phi)],
      ["fibre", point(unit.x_mm, unit.y_mm)],
      ["target at", point(unit.target.x_mm, unit.target.y_mm)],
      ["off by", Number.isNaN(fleet.error_um[this.place]) ? "" :
        micrometres(fleet.error_um[this.place])],
      ["measured", unit.error_um === null ? "" :
        `${micrometres(unit.error_um)} off, by ${unit.measured_by}`],
      ["bus", `${unit.bus_id}, node ${unit.node_id}, rail ${unit.rail_id}`],
      ["serial", String(unit.serial)],
    ]);
  }

  /** Moves before an instant, newest first; null: the newest. */
  async page(before) {
    const u = this.place;
    const more = this.history.querySelector(".more");
    if (more) more.remove();
    try {
      const answer = await this.api.ask("history", {unit_id: this.plate.fleet.id[u],
        limit: kRowsOfPage, ...(before === null ? {} : {until_ns: before})});
      if (u === this.place) this.addMoves(answer.moves, before === null);
    } catch (error) {
      if (u === this.place)
        this.history.replaceChildren(make("p", {class: "hint"}, `No history: ${error.message}.`));
    }
  }

  addMoves(moves, first) {
    if (first) {
      this.body = make("tbody");
      this.history.replaceChildren(make("h3", {}, "Moves, newest first"), moves.length === 0
        ? make("p", {class: "hint"}, "It has not moved yet.")
        : make("table", {}, make("thead", {}, make("tr", {}, make("th", {scope: "col"}, "began, UTC"),
            make("th", {scope: "col"}, "configuration"), make("th", {scope: "col"}, "end"))), this.body));
    }
    for (const move of moves)
      this.body.append(make("tr", {}, make("td", {}, clock(move.began)),
          make("td", {}, String(move.configuration)), make("td", {}, move.end)));
    if (moves.length < kRowsOfPage) return;
    // ISO times have milliseconds; the earlier page ends there.
    const until_ns = Date.parse(moves.at(-1).began) * 1_000_000;
    this.history.append(make("button", {type: "button", class: "more",
      onclick: () => this.page(until_ns)}, "Earlier moves"));
  }
}
