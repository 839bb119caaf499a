// The plate as frames bring it (daemon/page/plate_frame.h), as typed arrays.

export const kPhases = ["absent", "identifying", "foreign", "ready", "staging", "confirming",
  "arming", "armed", "moving", "homing", "settling", "fault", "silent"];
export const kWitnesses = ["unknown", "interval", "predicted", "reported", "measured"];
export const kOutcomes = ["none", "pending", "arrived", "refused", "failed", "stopped",
  "unmeasured"];

/** Phases in which motors turn. */
const kTurning = new Set(["moving", "homing"].map((name) => kPhases.indexOf(name)));

const kNoCode = 0xFFFF;
const kRadiansPerStep = 2 * Math.PI / 65535;
const kHeadBytes = 44;
const kWholeBytes = 14;
const kAnglesBytes = 4;

function angleOf(code) {
  return code === kNoCode ? NaN : code * kRadiansPerStep;
}

const codeOf = (angle) => Number.isNaN(angle) ? kNoCode : Math.round(angle / kRadiansPerStep);

/** The fleet as a snapshot, as the daemon would send it: for another tab. */
export function snapshotOf(fleet) {
  const facts = new TextEncoder().encode(JSON.stringify(fleet.facts));
  const bytes = new Uint8Array(kHeadBytes - 4 + facts.length + fleet.count * kWholeBytes);
  const view = new DataView(bytes.buffer);
  const at = (offset) => offset - 4;  // the length is not there
  view.setUint8(at(4), 1);
  view.setUint8(at(5), 1);
  view.setUint32(at(8), fleet.number, true);
  view.setFloat64(at(12), fleet.made_ms, true);
  view.setFloat64(at(20), fleet.status_ms, true);
  view.setUint32(at(28), fleet.count, true);
  view.setUint32(at(32), facts.length, true);
  view.setUint32(at(36), fleet.count, true);
  view.setUint32(at(40), 0, true);
  bytes.set(facts, kHeadBytes - 4);
  for (let u = 0; u < fleet.count; ++u) {
    const from = kHeadBytes - 4 + facts.length + u * kWholeBytes;
    [fleet.theta, fleet.phi, fleet.targetTheta, fleet.targetPhi].forEach((column, k) =>
      view.setUint16(from + 2 * k, codeOf(column[u]), true));
    view.setUint16(from + 8, Number.isNaN(fleet.error_um[u]) ? kNoCode
      : Math.round(2 * fleet.error_um[u]), true);
    view.setUint8(from + 10, fleet.phase[u]);
    view.setUint8(from + 11, fleet.witness[u]);
    view.setUint8(from + 12, fleet.outcome[u]);
    view.setUint8(from + 13, fleet.enabled[u] | fleet.fault[u] << 1);
  }
  return bytes;
}

export class Fleet {
  constructor(layout) {
    const n = layout.count;
    this.count = n;
    this.pitch_mm = layout.pitch_mm;
    this.obstacles = layout.obstacles;
    const column = (name) => {
      const value = layout.units[name];
      return typeof value === "number" ? new Float64Array(n).fill(value) : Float64Array.from(value);
    };
    for (const name of ["id", "x_mm", "y_mm", "arm_theta_mm", "arm_phi_mm", "half_width_mm",
      "patrol_min_mm", "patrol_max_mm", "bus", "node", "rail"]) this[name] = column(name);
    this.sector = layout.units.sector === undefined ? null : column("sector");  // of a plane alone
    this.placeOf = new Map();
    for (let u = 0; u < n; ++u) this.placeOf.set(this.id[u], u);
    // As the newest frame has them. Angles in radians; NaN: not known.
    this.theta = new Float64Array(n).fill(NaN);
    this.phi = new Float64Array(n).fill(NaN);
    this.targetTheta = new Float64Array(n).fill(NaN);
    this.targetPhi = new Float64Array(n).fill(NaN);
    this.error_um = new Float64Array(n).fill(NaN);
    this.phase = new Uint8Array(n);
    this.witness = new Uint8Array(n);
    this.outcome = new Uint8Array(n);
    this.enabled = new Uint8Array(n).fill(1);
    this.fault = new Uint8Array(n);
    this.changed_ms = new Float64Array(n).fill(NaN);  // this browser's clock
    this.motors = new Uint8Array(n);  // that turned with the last frame that had its angles
    this.facts = null;
    this.factsText = "";
    this.number = 0;
    this.status_ms = 0;  // the daemon's clock
    this.made_ms = 0;
    this.received_ms = 0;  // this browser's monotonic clock
  }

  /**
   * Takes a frame, without its length. The result has whether it is a snapshot, and whether its
   * facts are new. Calls `turned(u)` for each unit whose arms turned, before
   * they do, and `whole(u)` for each whose state came. Throws where the frame does not go on.
   */
  take(buffer, now_ms, turned, whole) {
    const view = new DataView(buffer.buffer, buffer.byteOffset, buffer.byteLength);
    const at = (offset) => offset - 4;  // offsets of plate_frame.h, which count the length
    const snapshot = view.getUint8(at(4)) === 1;
    if (view.getUint8(at(5)) !== 1) throw new Error("the daemon speaks another version");
    const number = view.getUint32(at(8), true);
    const count = view.getUint32(at(28), true);
    if (count !== this.count) throw new Error("the plate has other units now");
    if (!snapshot && number !== this.number + 1) throw new Error("a frame is missing");
    this.number = number;
    this.made_ms = view.getFloat64(at(12), true);
    this.status_ms = view.getFloat64(at(20), true);
    this.received_ms = now_ms;
    const facts = view.getUint32(at(32), true);
    const wholes = view.getUint32(at(36), true);
    const angles = view.getUint32(at(40), true);
    let offset = kHeadBytes - 4;
    let isNew = false;
    if (facts > 0) {
      const text = new TextDecoder().decode(buffer.subarray(offset, offset + facts));
      isNew = text !== this.factsText;  // at rest they are the same each second
      this.factsText = text;
      if (isNew) this.facts = JSON.parse(text);
      offset += facts;
    }
    offset = this.takeGroup(view, offset, wholes, kWholeBytes, (u, from) => {
      turned(u);
      this.takeAngles(view, u, from);
      this.takeState(view, u, from);
      this.changed_ms[u] = now_ms;
      whole(u);
    });
    this.takeGroup(view, offset, angles, kAnglesBytes, (u, from) => {
      turned(u);
      this.takeAngles(view, u, from);
      this.changed_ms[u] = now_ms;
    });
    return {snapshot, facts: isNew};
  }

  takeGroup(view, offset, count, bytes, take) {
    if (count === 0) return offset;
    const all = count === this.count;
    const bits = offset;
    let from = all ? offset : offset + ((this.count + 7) >> 3);
    for (let u = 0; u < this.count; ++u) {
      if (!all && (view.getUint8(bits + (u >> 3)) >> (u & 7) & 1) === 0) continue;
      take(u, from);
      from += bytes;
    }
    return from;
  }

  takeAngles(view, u, from) {
    const theta = angleOf(view.getUint16(from, true));
    const phi = angleOf(view.getUint16(from + 2, true));
    // An angle that was not known, or is no longer, has not turned: it differs from nothing.
    this.motors[u] = (Math.abs(theta - this.theta[u]) > 0) + (Math.abs(phi - this.phi[u]) > 0);
    this.theta[u] = theta;
    this.phi[u] = phi;
  }

  /** How many motors of the unit turned with the newest frame, where it is on its way. */
  motorsOf(u) {
    return kTurning.has(this.phase[u]) && this.changed_ms[u] === this.received_ms ? this.motors[u] : 0;
  }

  takeState(view, u, from) {
    this.targetTheta[u] = angleOf(view.getUint16(from + 4, true));
    this.targetPhi[u] = angleOf(view.getUint16(from + 6, true));
    const error = view.getUint16(from + 8, true);
    this.error_um[u] = error === kNoCode ? NaN : error / 2;
    this.phase[u] = view.getUint8(from + 10);
    this.witness[u] = view.getUint8(from + 11);
    this.outcome[u] = view.getUint8(from + 12);
    const flags = view.getUint8(from + 13);
    this.enabled[u] = flags & 1;
    this.fault[u] = flags >> 1;
  }

  /** The age of the data that are shown, as seen here. Units: ms. */
  age_ms(now_ms) {
    if (this.status_ms === 0) return Infinity;
    return Math.max(0, this.made_ms - this.status_ms) + Math.max(0, now_ms - this.received_ms);
  }
}
