// Which units reach into the patrol disc of another, by a grid over the plate.

export class Neighbours {
  constructor(fleet) {
    this.fleet = fleet;
    let most_mm = 1e-3;
    for (let u = 0; u < fleet.count; ++u) most_mm = Math.max(most_mm, this.reachOf(u));
    this.cell_mm = 2 * most_mm;
    this.cells = new Map();
    for (let u = 0; u < fleet.count; ++u) {
      const key = this.keyOf(fleet.x_mm[u], fleet.y_mm[u], 0, 0);
      if (!this.cells.has(key)) this.cells.set(key, []);
      this.cells.get(key).push(u);
    }
  }

  reachOf(u) {
    return this.fleet.patrol_max_mm[u] + this.fleet.half_width_mm[u];
  }

  keyOf(x_mm, y_mm, right, up) {
    return `${Math.floor(x_mm / this.cell_mm) + right} ${Math.floor(y_mm / this.cell_mm) + up}`;
  }

  /** Places of the units whose arms can touch those of unit `u`, the nearest first. */
  of(u) {
    const {x_mm, y_mm} = this.fleet;
    const found = [];
    for (const right of [-1, 0, 1])
      for (const up of [-1, 0, 1])
        for (const v of this.cells.get(this.keyOf(x_mm[u], y_mm[u], right, up)) ?? []) {
          const apart_mm = Math.hypot(x_mm[v] - x_mm[u], y_mm[v] - y_mm[u]);
          if (v !== u && apart_mm < this.reachOf(u) + this.reachOf(v)) found.push([apart_mm, v]);
        }
    return found.sort((a, b) => a[0] - b[0]).map(([, v]) => v);
  }
}
