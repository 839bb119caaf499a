// View is the part of the plate that the canvas shows, seen from the sky side: x to the right, y
// upwards.

const kZoomMax_px_per_mm = 2000;

export class View {
  constructor(fleet) {
    this.fleet = fleet;
    this.width = 1;  // CSS pixels
    this.height = 1;
    this.ratio = 1;  // device pixels a CSS pixel
    this.centre_x = 0;  // mm
    this.centre_y = 0;
    this.scale = 1;     // CSS pixels per mm
    this.scaleAll = 1;
    this.isAll = true;  // it follows the size of the canvas
    this.reach_mm = 0;
    this.box = [Infinity, -Infinity, Infinity, -Infinity];
    for (let u = 0; u < fleet.count; ++u) {
      const reach = fleet.arm_theta_mm[u] + fleet.arm_phi_mm[u] + fleet.half_width_mm[u];
      this.reach_mm = Math.max(this.reach_mm, reach);
      this.widen(fleet.x_mm[u], fleet.y_mm[u], reach);
    }
    for (const {x_mm, y_mm, radius_mm} of fleet.obstacles) this.widen(x_mm, y_mm, radius_mm);
  }

  widen(x, y, reach) {
    const {box} = this;
    box[0] = Math.min(box[0], x - reach);
    box[1] = Math.max(box[1], x + reach);
    box[2] = Math.min(box[2], y - reach);
    box[3] = Math.max(box[3], y + reach);
  }

  get pitch_px() { return this.fleet.pitch_mm * this.scale; }
  screenX(x_mm) { return this.width / 2 + (x_mm - this.centre_x) * this.scale; }
  screenY(y_mm) { return this.height / 2 - (y_mm - this.centre_y) * this.scale; }
  plateX(x_px) { return this.centre_x + (x_px - this.width / 2) / this.scale; }
  plateY(y_px) { return this.centre_y - (y_px - this.height / 2) / this.scale; }

  resize(width, height, ratio) {
    Object.assign(this, {width, height, ratio});
    const {box} = this;
    if (box[0] > box[1]) return;
    this.scaleAll = 0.97 * Math.min(width / (box[1] - box[0]), height / (box[3] - box[2]));
    if (this.isAll) this.showAll();
  }

  showAll() {
    this.centre_x = (this.box[0] + this.box[1]) / 2;
    this.centre_y = (this.box[2] + this.box[3]) / 2;
    this.scale = this.scaleAll;
    this.isAll = true;
  }

  /** Zooms; the point under (x, y) stays there. Units: px. */
  zoom(factor, x_px = this.width / 2, y_px = this.height / 2) {
    const x = this.plateX(x_px);
    const y = this.plateY(y_px);
    this.scale = Math.min(kZoomMax_px_per_mm, Math.max(this.scaleAll / 3, this.scale * factor));
    this.centre_x = x - (x_px - this.width / 2) / this.scale;
    this.centre_y = y + (y_px - this.height / 2) / this.scale;
    this.isAll = false;
  }

  pan(dx_px, dy_px) {
    this.centre_x -= dx_px / this.scale;
    this.centre_y += dy_px / this.scale;
    this.isAll = false;
  }

  showUnit(u) {
    this.centre_x = this.fleet.x_mm[u];
    this.centre_y = this.fleet.y_mm[u];
    this.scale = Math.min(kZoomMax_px_per_mm,
        0.47 * Math.min(this.width, this.height) / (3.5 * Math.max(this.fleet.pitch_mm, 1e-3)));
    this.isAll = false;
  }

  /** The places of units that may be in view. */
  visible() {
    const left = this.plateX(0) - this.reach_mm;
    const right = this.plateX(this.width) + this.reach_mm;
    const top = this.plateY(0) + this.reach_mm;
    const bottom = this.plateY(this.height) - this.reach_mm;
    const {x_mm, y_mm, count} = this.fleet;
    const list = [];
    for (let u = 0; u < count; ++u)
      if (x_mm[u] >= left && x_mm[u] <= right && y_mm[u] >= bottom && y_mm[u] <= top) list.push(u);
    return list;
  }
}
