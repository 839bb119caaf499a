// Turning shows arms between two frames of the daemon. A unit turns evenly from where it is shown
// to where the newest frame has it. The time for that is twice the usual gap between frames: the
// next frame comes before the arm has arrived, and sends it on from where it is then. Arms so move
// without standing and without jumps, however unevenly frames come, and are shown up to two gaps
// late. A unit that gets no more frames turns to its end.

const kFullCircle = 2 * Math.PI;
const kGapsOfTurn = 2;
const kGapLongest_ms = 700;  // after a longer one arms are shown where they are
const kGapsKept = 9;

/** The shortest way from one angle to another. */
export function turnBetween(from, to) {
  const turn = (to - from) % kFullCircle;
  if (turn > Math.PI) return turn - kFullCircle;
  return turn < -Math.PI ? turn + kFullCircle : turn;
}

export class Turning {
  constructor(fleet) {
    const n = fleet.count;
    this.fleet = fleet;
    this.fromTheta = new Float64Array(n);
    this.fromPhi = new Float64Array(n);
    this.byTheta = new Float64Array(n);
    this.byPhi = new Float64Array(n);
    this.began_ms = new Float64Array(n);
    this.until_ms = new Float64Array(n);
    this.turns = new Uint8Array(n);  // the unit is in the list
    this.units = new Int32Array(n);
    this.size = 0;
    this.noted = new Int32Array(n);  // by the frame that is being read
    this.notedSize = 0;
    this.frameAt_ms = 0;
    this.gaps_ms = [100];
    this.turn_ms = kGapsOfTurn * 100;
  }

  /** A frame begins. */
  begin(now_ms) {
    const gap_ms = now_ms - this.frameAt_ms;
    this.frameAt_ms = now_ms;
    this.notedSize = 0;
    if (gap_ms > kGapLongest_ms) {
      this.turn_ms = 1;
      return;
    }
    this.gaps_ms.push(gap_ms);
    if (this.gaps_ms.length > kGapsKept) this.gaps_ms.shift();
    const sorted = this.gaps_ms.slice().sort((a, b) => a - b);
    this.turn_ms = kGapsOfTurn * sorted[sorted.length >> 1];
  }

  /** The frame turns the unit; its old angles are still there. */
  note(u) {
    const {fleet} = this;
    if (this.turns[u]) {
      const share = this.shareOf(u, this.frameAt_ms);
      this.fromTheta[u] += share * this.byTheta[u];
      this.fromPhi[u] += share * this.byPhi[u];
    } else {
      this.fromTheta[u] = fleet.theta[u];
      this.fromPhi[u] = fleet.phi[u];
    }
    this.noted[this.notedSize++] = u;
  }

  /** The frame is read. Units whose places were not known, or are no longer, do not turn. */
  end() {
    const {fleet, fromTheta, fromPhi} = this;
    for (let k = 0; k < this.notedSize; ++k) {
      const u = this.noted[k];
      const byTheta = turnBetween(fromTheta[u], fleet.theta[u]);
      const byPhi = turnBetween(fromPhi[u], fleet.phi[u]);
      const isKnown = !Number.isNaN(byTheta + byPhi);
      if (!isKnown) {
        fromTheta[u] = fleet.theta[u];
        fromPhi[u] = fleet.phi[u];
      }
      this.byTheta[u] = isKnown ? byTheta : 0;
      this.byPhi[u] = isKnown ? byPhi : 0;
      this.began_ms[u] = this.frameAt_ms;
      this.until_ms[u] = this.frameAt_ms + this.turn_ms;
      if (this.turns[u]) continue;
      this.turns[u] = 1;
      this.units[this.size++] = u;
    }
    this.notedSize = 0;
  }

  shareOf(u, now_ms) {
    return Math.min(1, Math.max(0, (now_ms - this.began_ms[u]) /
        (this.until_ms[u] - this.began_ms[u])));
  }

  /**
   * Calls `place(u, theta, phi)` for the units that turn and whose bases lie between `low_mm` and
   * `high_mm` along y. Those of them that have arrived leave.
   */
  show(now_ms, {low_mm, high_mm}, place) {
    const {fleet, units} = this;
    let kept = 0;
    for (let k = 0; k < this.size; ++k) {
      const u = units[k];
      if (fleet.y_mm[u] > high_mm || fleet.y_mm[u] < low_mm) {
        units[kept++] = u;
        continue;
      }
      const share = this.shareOf(u, now_ms);
      if (share < 1) {
        place(u, this.fromTheta[u] + share * this.byTheta[u],
            this.fromPhi[u] + share * this.byPhi[u]);
        units[kept++] = u;
      } else {
        this.turns[u] = 0;
        place(u, fleet.theta[u], fleet.phi[u]);
      }
    }
    this.size = kept;
  }

  clear() {
    for (let k = 0; k < this.size; ++k) this.turns[this.units[k]] = 0;
    this.size = 0;
  }
}
