// The ways of the configuration under way, by the rows of its plan: where each fibre will go. They
// are asked for once a round, by any tab that comes while units move, also after a restart of the
// daemon. Near enough the plate shows them (near.js).

import {motionsIn} from "/page/motion.js";

const kPoints = 49;  // of a way; its pieces are then a few degrees

/** The angle of an axis at an instant of its plan. */
function angleAt(begin, rows, t_s) {
  let angle = begin;
  for (const [from_s, to_s, turn] of rows) {
    if (t_s <= from_s) break;
    angle += turn * Math.min(1, (t_s - from_s) / Math.max(to_s - from_s, 1e-9));
  }
  return angle;
}

export class Ways {
  constructor(api, plate) {
    Object.assign(this, {api, plate});
    this.key = "";
    this.units = new Map();  // moves of the plan by place
    this.made = new Map();   // ways that were asked for
  }

  async note({busy, configuration: c}) {
    const key = busy && c.state === "moving" ? `${c.id} ${c.round}` : "";
    if (key === this.key) return;
    this.key = key;
    this.units = new Map();
    this.made.clear();
    if (key === "") return;
    try {
      const bytes = await this.api.bytes(`/motion?configuration=${c.id}`);
      const motion = bytes ? motionsIn(bytes).at(-1) : null;
      if (key === this.key && motion) this.units = motion.units;
      this.plate.dirty = true;
    } catch {
      // Its rows are not kept: there are no ways to show.
    }
  }

  /** Places of the fibre on the plate, x and y in turn; null: its way is not known. */
  of(u) {
    const move = this.units.get(u);
    if (!move) return null;
    let way = this.made.get(u);
    if (!way) this.made.set(u, way = this.make(u, move));
    return way;
  }

  make(u, {begin, rows, end_s}) {
    const {fleet} = this.plate;
    const way = new Float64Array(2 * kPoints);
    for (let k = 0; k < kPoints; ++k) {
      const t_s = end_s * k / (kPoints - 1);
      const theta = angleAt(begin[0], rows[0], t_s);
      const both = theta + angleAt(begin[1], rows[1], t_s);
      way[2 * k] = fleet.x_mm[u] + fleet.arm_theta_mm[u] * Math.cos(theta) +
          fleet.arm_phi_mm[u] * Math.cos(both);
      way[2 * k + 1] = fleet.y_mm[u] + fleet.arm_theta_mm[u] * Math.sin(theta) +
          fleet.arm_phi_mm[u] * Math.sin(both);
    }
    return way;
  }
}
