// A film is the motion of many units over a time that is past, or only planned: pieces of even
// turning for each axis, and the state of each unit from instant to instant. The plate shows a film
// in place of the live fleet.

import {State} from "/page/colours.js";

/** Lists of each unit, flattened into columns. */
class Columns {
  constructor(lists, width) {
    this.first = new Int32Array(lists.length + 1);
    for (let u = 0; u < lists.length; ++u)
      this.first[u + 1] = this.first[u] + (lists[u] ? lists[u].length / width : 0);
    this.values = new Float64Array(this.first[lists.length] * width);
    for (let u = 0; u < lists.length; ++u)
      if (lists[u]) this.values.set(lists[u], this.first[u] * width);
    this.width = width;
  }

  /** The offset of the last entry of the unit that has begun at the instant, or -1. */
  lastBegun(u, t_s) {
    let found = -1;
    for (let k = this.first[u]; k < this.first[u + 1]; ++k) {
      if (this.values[k * this.width] > t_s) break;
      found = k * this.width;
    }
    return found;
  }
}

export class Film {
  /** `count` units; those that get no piece have no arms, unless `stand` puts them somewhere. */
  constructor(count) {
    this.count = count;
    this.pieces = [new Array(count), new Array(count)];
    this.spans = new Array(count);
    this.theta = new Float64Array(count).fill(NaN);
    this.phi = new Float64Array(count).fill(NaN);
    this.targetTheta = new Float64Array(count).fill(NaN);
    this.targetPhi = new Float64Array(count).fill(NaN);
    this.error_um = new Float64Array(count).fill(NaN);
    this.state = new Uint8Array(count).fill(State.ready);
    this.restState = new Uint8Array(count).fill(State.ready);
    this.begin_s = Infinity;
    this.end_s = -Infinity;
  }

  /** A unit that does not move. */
  stand(u, theta, phi, state) {
    this.theta[u] = theta;
    this.phi[u] = phi;
    this.restState[u] = this.state[u] = state;
  }

  /** The axis turns evenly. Pieces of a unit come in the order of time. */
  turn(u, axis, begin_s, end_s, from, turn) {
    (this.pieces[axis][u] ??= []).push(begin_s, end_s, from, turn);
    this.begin_s = Math.min(this.begin_s, begin_s);
    this.end_s = Math.max(this.end_s, end_s);
  }

  /** The unit moves meanwhile, and is in `state` then. */
  span(u, begin_s, end_s, state) {
    (this.spans[u] ??= []).push(begin_s, end_s, state);
    this.begin_s = Math.min(this.begin_s, begin_s);
    this.end_s = Math.max(this.end_s, end_s);
  }

  /** All pieces are there. */
  finish() {
    this.pieces = this.pieces.map((lists) => new Columns(lists, 4));
    this.spans = new Columns(this.spans, 3);
    if (!(this.end_s > this.begin_s)) [this.begin_s, this.end_s] = [0, 1];
    this.seek(this.begin_s);
    return this;
  }

  angleAt(axis, u, t_s) {
    const columns = this.pieces[axis];
    const begun = columns.lastBegun(u, t_s);
    const at = begun >= 0 ? begun : columns.first[u] * 4;
    const {values} = columns;
    if (begun < 0) return values[at + 2];
    const share = values[at + 1] > values[at]
      ? Math.min(1, (t_s - values[at]) / (values[at + 1] - values[at])) : 1;
    return values[at + 2] + share * values[at + 3];
  }

  /** How many motors of the unit turn at the instant. */
  motorsOf(u) {
    let motors = 0;
    for (const columns of this.pieces) {
      const at = columns.lastBegun(u, this.t_s);
      if (at >= 0 && this.t_s < columns.values[at + 1] && columns.values[at + 3] !== 0) ++motors;
    }
    return motors;
  }

  /** Angles and states are those of the instant. */
  seek(t_s) {
    this.t_s = t_s;
    for (let u = 0; u < this.count; ++u) this.update(u);
  }

  /** The unit's angles and state are those of `t_s`. */
  update(u) {
    const {t_s} = this;
    if (this.pieces[0].first[u + 1] > this.pieces[0].first[u]) {
      this.theta[u] = this.angleAt(0, u, t_s);
      this.phi[u] = this.angleAt(1, u, t_s);
    }
    const at = this.spans.lastBegun(u, t_s);
    this.state[u] = at < 0 ? this.restState[u]
      : t_s < this.spans.values[at + 1] ? State.moving : this.spans.values[at + 2];
  }
}

/** The rows of a planned move, begun at an instant. Both axes get a piece, also where one rests. */
export function addRows(film, u, move, begin_s) {
  for (const axis of [0, 1]) {
    let angle = move.begin[axis];
    if (move.rows[axis].length === 0) film.turn(u, axis, begin_s, begin_s, angle, 0);
    for (const [from_s, to_s, turn] of move.rows[axis]) {
      film.turn(u, axis, begin_s + from_s, begin_s + to_s, angle, turn);
      angle += turn;
    }
  }
}

/** The film of a plan from the places where the units stand now. */
export function filmOfPreview(fleet, motion, unserved, stateNow) {
  const film = new Film(fleet.count);
  for (let u = 0; u < fleet.count; ++u)
    film.stand(u, fleet.theta[u], fleet.phi[u], unserved.has(u) ? State.unserved : stateNow(u));
  for (const [u, move] of motion.units) {
    addRows(film, u, move, 0);
    film.span(u, 0, move.end_s, State.ready);
    [film.targetTheta[u], film.targetPhi[u]] = move.end;
  }
  return film.finish();
}
