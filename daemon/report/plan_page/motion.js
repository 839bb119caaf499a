"use strict";

// Motion holds the plan as typed arrays, and the position of everything at a time. Axis 2u is theta
// of the unit in place u of the layout, 2u + 1 its phi. Names carry their units, as in the program.

const kDegree = Math.PI / 180;

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
}

/** A column that pack.h has packed, as a Float64Array of `count` numbers. */
function unpackColumn(packed, count) {
  const values = new Float64Array(bytesOf(packed.values).buffer);
  if (packed.indices) {
    const bytes = bytesOf(packed.indices);
    const indices = values.length > 256 ? new Uint16Array(bytes.buffer) : bytes;
    return Float64Array.from(indices, (i) => values[i]);
  }
  return values.length === count ? values : new Float64Array(count).fill(values[0]);
}

function unpackColumns(packed, count) {
  const columns = {};
  for (const name of Object.keys(packed)) columns[name] = unpackColumn(packed[name], count);
  return columns;
}

/** The number of entries of an ascending array that are <= x, from `begin` to `end`. */
function upperBound(array, x, begin = 0, end = array.length) {
  let low = begin;
  let high = end;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (array[middle] <= x) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** The states of a unit, in the order of the legend. */
const State = {
  moving: 0, waiting: 1, arrived: 2, stands: 3, unserved: 4, disabled: 5, unknown: 6,
};
const kStates = [
  {name: "moving", text: "moving"},
  {name: "waiting", text: "will move"},
  {name: "arrived", text: "has moved"},
  {name: "stands", text: "stands all the time"},
  {name: "unserved", text: "target not served"},
  {name: "disabled", text: "disabled: an obstacle"},
  {name: "unknown", text: "place not known"},
];

/** The reasons why a unit is not served, as fleet/plan/plan.h numbers them, from 1. */
const kUnservedWhy = [
  "", "disabled", "its place is not known", "no way that is clear was found",
  "the target collides with what cannot move",
];

class Motion {
  constructor(data) {
    this.count = data.units_count;
    this.units = unpackColumns(data.units, this.count);
    this.rows = unpackColumns(data.rows, data.rows_count);
    this.obstacles = data.obstacles;
    this.pitch_mm = data.pitch_mm;
    this.clearance_mm = data.clearance_mm;
    this.placeOf = new Map();
    for (let u = 0; u < this.count; ++u) this.placeOf.set(this.units.id[u], u);
    this.joinRows(data.rows_count);
    this.findBlockers();

    // The state at `t_s`, as setTime leaves it.
    this.t_s = NaN;
    this.theta_deg = new Float64Array(this.count).fill(NaN);
    this.phi_deg = new Float64Array(this.count).fill(NaN);
    this.elbow_x = new Float64Array(this.count).fill(NaN);  // NaN: not known
    this.elbow_y = new Float64Array(this.count).fill(NaN);
    this.fibre_x = new Float64Array(this.count).fill(NaN);
    this.fibre_y = new Float64Array(this.count).fill(NaN);
    this.state = new Uint8Array(this.count);
    this.inState = new Uint32Array(kStates.length);
    this.setTime(0);
  }

  // Finds the rows of each axis. A row begins where the previous one ended, the first where the
  // axis stood.
  joinRows(rows_count) {
    const {units, rows} = this;
    rows.from_deg = new Float64Array(rows_count);
    this.rowBegin = new Uint32Array(2 * this.count + 1);
    this.begins_s = new Float64Array(this.count).fill(Infinity);
    this.ends_s = new Float64Array(this.count).fill(-Infinity);
    this.makespan_s = 0;
    let k = 0;
    for (let axis = 0; axis < 2 * this.count; ++axis) {
      const u = axis >> 1;
      const isPhi = axis & 1;
      let at_deg = (isPhi ? units.start_phi_deg : units.start_theta_deg)[u];
      const end = k + (isPhi ? units.phi_rows : units.theta_rows)[u];
      for (; k < end; ++k) {
        rows.from_deg[k] = at_deg;
        at_deg = rows.to_deg[k];
        this.begins_s[u] = Math.min(this.begins_s[u], rows.t0_s[k]);
        this.ends_s[u] = Math.max(this.ends_s[u], rows.t1_s[k]);
        this.makespan_s = Math.max(this.makespan_s, rows.t1_s[k]);
      }
      this.rowBegin[axis + 1] = k;
    }
  }

  // Finds the units that are named as being in the way of another.
  findBlockers() {
    this.isBlocker = new Uint8Array(this.count);
    for (let u = 0; u < this.count; ++u) {
      const by = this.units.by[u];
      if (by > 0) this.isBlocker[by - 1] = 1;
    }
  }

  /** The last row of an axis that has begun, or -1. */
  rowBegun(axis, t_s) {
    const begin = this.rowBegin[axis];
    const k = upperBound(this.rows.t0_s, t_s, begin, this.rowBegin[axis + 1]) - 1;
    return k >= begin ? k : -1;
  }

  /** The row that runs on an axis, or -1. */
  rowAt(axis, t_s) {
    const k = this.rowBegun(axis, t_s);
    return k >= 0 && t_s < this.rows.t1_s[k] ? k : -1;
  }

  /** The angle is linear within a row; before, between and after its rows an axis stands. */
  angleAt(axis, t_s, k = this.rowBegun(axis, t_s)) {
    const {units, rows} = this;
    if (k < 0) return (axis & 1 ? units.start_phi_deg : units.start_theta_deg)[axis >> 1];
    const from = rows.from_deg[k];
    const to = rows.to_deg[k];
    if (t_s >= rows.t1_s[k]) return to;
    return from + (to - from) * (t_s - rows.t0_s[k]) / (rows.t1_s[k] - rows.t0_s[k]);
  }

  powerAt(u, t_s) {
    let power_W = 0;
    for (const axis of [2 * u, 2 * u + 1]) {
      const k = this.rowAt(axis, t_s);
      if (k >= 0) power_W += this.rows.power_W[k];
    }
    return power_W;
  }

  /** Computes the position of everything at a time. */
  setTime(t_s) {
    if (t_s === this.t_s) return;
    this.t_s = t_s;
    this.inState.fill(0);
    const {t1_s} = this.rows;
    for (let u = 0; u < this.count; ++u) {
      const thetaRow = this.rowBegun(2 * u, t_s);
      const phiRow = this.rowBegun(2 * u + 1, t_s);
      const theta_deg = this.angleAt(2 * u, t_s, thetaRow);
      const phi_deg = this.angleAt(2 * u + 1, t_s, phiRow);
      if (theta_deg !== this.theta_deg[u] || phi_deg !== this.phi_deg[u]) {
        this.theta_deg[u] = theta_deg;
        this.phi_deg[u] = phi_deg;
        this.placeArm(u);
      }
      const moves = (thetaRow >= 0 && t_s < t1_s[thetaRow]) || (phiRow >= 0 && t_s < t1_s[phiRow]);
      this.state[u] = moves ? State.moving : this.stateAtRest(u);
      ++this.inState[this.state[u]];
    }
  }

  /** Computes elbow and fibre from the angles, as docs/files.md defines them. */
  placeArm(u) {
    const {units} = this;
    const t = this.theta_deg[u] + units.theta_zero_deg[u];
    const p = this.phi_deg[u] + units.phi_zero_deg[u];
    const x = units.base_x_mm[u] + units.arm_theta_mm[u] * Math.cos(t * kDegree);
    const y = units.base_y_mm[u] + units.arm_theta_mm[u] * Math.sin(t * kDegree);
    this.elbow_x[u] = x;
    this.elbow_y[u] = y;
    this.fibre_x[u] = x + units.arm_phi_mm[u] * Math.cos((t + p) * kDegree);
    this.fibre_y[u] = y + units.arm_phi_mm[u] * Math.sin((t + p) * kDegree);
  }

  stateAtRest(u) {
    if (!this.units.enabled[u]) return State.disabled;
    if (Number.isNaN(this.units.start_theta_deg[u])) return State.unknown;
    if (this.units.unserved[u]) return State.unserved;
    if (this.ends_s[u] < 0) return State.stands;
    return this.t_s >= this.ends_s[u] ? State.arrived : State.waiting;
  }

  /** The points where the arms of two units are nearest to each other now: [x, y] of each. */
  nearestPoints(a, b) {
    const armOf = (u) => [
      [this.elbow_x[u], this.elbow_y[u]], [this.fibre_x[u], this.fibre_y[u]]];
    const nearestOn = ([x, y], [p, q]) => {
      const dx = q[0] - p[0];
      const dy = q[1] - p[1];
      const along = ((x - p[0]) * dx + (y - p[1]) * dy) / (dx * dx + dy * dy);
      const f = Math.min(1, Math.max(0, along));
      return [p[0] + f * dx, p[1] + f * dy];
    };
    const armA = armOf(a);
    const armB = armOf(b);
    const candidates = [
      ...armA.map((point) => [point, nearestOn(point, armB)]),
      ...armB.map((point) => [nearestOn(point, armA), point])];
    const length = ([p, q]) => Math.hypot(p[0] - q[0], p[1] - q[1]);
    return candidates.reduce((best, next) => (length(next) < length(best) ? next : best));
  }
}
