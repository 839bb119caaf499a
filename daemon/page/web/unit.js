// One unit: where it is, what is known and by whom, who is beside it, and what it did.

import {kStates} from "/page/colours.js";
import {kOutcomes, kPhases, kWitnesses} from "/page/frames.js";
import {counted, find, make, micrometres, setText} from "/page/dom.js";
import {UnitHistory} from "/page/unit_history.js";

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
  /**
   * `onView()`: the view moves; `onSelect(place)`: another unit, or -1. `player` shows a film at times,
   * which is not what the panel says of the unit.
   */
  constructor(api, access, plate, player, onView, onSelect) {
    Object.assign(this, {api, access, plate, player, onView, onSelect});
    this.place = -1;
    this.film = make("div", {id: "unit-film"});
    this.list = make("dl");
    this.beside = make("p", {id: "beside"});
    this.history = new UnitHistory(api);
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
    if (worst === undefined) setText(find("find-trouble"), this.whyNoneIsWorst());
    else this.showId(this.plate.fleet.id[worst]);
  }

  /** No unit is known to stand off its target: what is known instead. */
  whyNoneIsWorst() {
    const {outcome, witness} = this.plate.fleet;
    const count = (list, is) => list.reduce((sum, value) => sum + (is(value) ? 1 : 0), 0);
    const targeted = count(outcome, (value) => value !== kOutcomes.indexOf("none"));
    const arrived = count(outcome, (value) => value === kOutcomes.indexOf("arrived"));
    const measured = count(witness, (value) => value === kWitnesses.indexOf("measured"));
    if (targeted === 0) return "No unit has a target.";
    const who = arrived === targeted ? `All ${counted(arrived, "unit")} arrived`
      : `${arrived} of ${counted(targeted, "unit")} arrived`;
    return measured === 0 ? `${who}; errors not measured.` : `${who}; none stands off its target.`;
  }

  select(place) {
    this.onSelect(place);
    this.place = place;
    this.plate.selected = place;
    this.plate.dirty = true;
    find("unit-hint").hidden = place >= 0;
    find("unit").replaceChildren(...(place >= 0
      ? [this.film, this.list, this.beside, ...(this.access.has("history") ? this.history.elements : [])] : []));
    if (place < 0) return;
    find("find-id").value = String(this.plate.fleet.id[place]);
    this.list.replaceChildren();
    this.showFilm();
    this.showBeside();
    this.refresh();
    if (this.access.has("history")) this.history.show(this.plate.fleet.id[place]);
  }

  /** What the unit does in the film, where the plate shows one; what stands below is live. */
  showFilm() {
    const {film, name} = this.player;
    this.film.replaceChildren(...(!film || this.place < 0 ? [] : [make("h3", {}, `In the ${name}`),
      make("p", {}, this.player.describe(this.place)), make("h3", {}, "Live now")]));
  }

  /** Units whose arms can touch this one's. */
  showBeside() {
    const {fleet, neighbours, state} = this.plate;
    this.beside.replaceChildren(make("span", {class: "hint"}, "Neighbours: "),
        ...neighbours.of(this.place).flatMap((v) => [make("button", {type: "button",
          class: "row-button", title: kStates[state[v]].text, onclick: () => this.showId(fleet.id[v])},
        String(fleet.id[v])), " "]));
  }

  async refresh() {
    const asked = ++this.asked;
    const {fleet} = this.plate;
    const u = this.place;
    if (!this.access.has("unit")) return this.showFromPlate(u);
    try {
      const unit = await this.api.ask("unit", {unit_id: fleet.id[u]});
      if (asked === this.asked) this.show(unit);
    } catch (error) {
      if (asked !== this.asked) return;
      this.rows([["state", kPhases[fleet.phase[u]]], ["target", kOutcomes[fleet.outcome[u]]],
        ["more", `not known: ${error.message}`]]);
    }
  }

  /** What the plate has of a unit, where its own daemon alone has more. */
  showFromPlate(u) {
    const {fleet} = this.plate;
    const angle = (radians) => Number.isNaN(radians) ? "not known"
      : `${(radians * 180 / Math.PI).toFixed(2)}° on the plate`;
    this.rows([["state", kPhases[fleet.phase[u]] + (fleet.enabled[u] ? "" : ", disabled")],
      ["target", kOutcomes[fleet.outcome[u]]],
      ["place", kWitnesses[fleet.witness[u]]],
      ["theta", angle(fleet.theta[u])],
      ["off by", Number.isNaN(fleet.error_um[u]) ? "" : micrometres(fleet.error_um[u])],
      ["sector", fleet.sector ? `${fleet.sector[u]}, whose daemon has the history` : ""],
      ["bus", `${fleet.bus[u]}, node ${fleet.node[u]}, rail ${fleet.rail[u]}`]]);
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
}
