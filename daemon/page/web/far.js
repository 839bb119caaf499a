// The far view: all units at once, a few pixels each, by lines into an image (raster.js).
//
// The plate is drawn in bands from top to bottom. At this scale an arm moves some hundredths of a
// pixel between two frames, so that of 20,000 units only one band a frame need be drawn anew. Each
// band keeps its turn. What concerns all units (a zoom, colours, a snapshot) is drawn at once.

import {Raster} from "/page/raster.js";

const kUnitsOfBand = 6000;  // at least: some 3 ms without a graphics card
const kBandsMost = 4;       // an arm of 5 px that turns by 1 rad/s moves 0.3 px in four frames

export class Far {
  constructor(plate) {
    this.plate = plate;
    this.raster = new Raster();
    this.unitsOfBand = kUnitsOfBand;
    this.bands = 1;
    this.next = 0;
  }

  /** The rows of the canvas that are drawn next, and the units that reach into them. */
  nextBand() {
    const {plate: {fleet, canvas, view}} = this;
    this.bands = Math.max(1, Math.min(kBandsMost, Math.floor(fleet.count / this.unitsOfBand)));
    this.next = (this.next + 1) % this.bands;
    const rowOf = (band) => Math.round(band * canvas.height / this.bands);
    return this.bandOf(rowOf(this.next), rowOf(this.next + 1), view);
  }

  wholeBand() {
    return this.bandOf(0, this.plate.canvas.height, this.plate.view);
  }

  bandOf(top, bottom, view) {
    // A dot about a base is less than a pitch wide.
    const reach_mm = view.reach_mm + this.plate.fleet.pitch_mm;
    return {top, bottom, high_mm: view.plateY(top / view.ratio) + reach_mm,
      low_mm: view.plateY(bottom / view.ratio) - reach_mm};
  }

  draw({top: first, bottom: last, high_mm, low_mm}) {
    const {raster, plate} = this;
    const {view, fleet, canvas, colours: {of32}, theme} = plate;
    const {index, state, elbow_x, elbow_y, fibre_x, fibre_y} = plate;
    raster.resize(canvas.width, canvas.height);
    raster.clip(first, last);
    raster.clear(of32.plate);
    const scale = view.scale * view.ratio;
    const left = view.plateX(0);
    const top = view.plateY(0);
    for (const {x_mm, y_mm, radius_mm} of fleet.obstacles)
      raster.dot((x_mm - left) * scale, (top - y_mm) * scale,
          Math.max(2, 0.8 * radius_mm * scale), of32.obstacle);
    const table = theme.entries.map(({colour}) => of32[colour]);
    const wide = Math.max(1.8, 2 * fleet.half_width_mm[0] * scale);
    const thin = Math.max(0.7, 0.3 * wide);
    const dot = Math.max(1, 0.09 * fleet.pitch_mm * scale);
    for (let u = 0; u < fleet.count; ++u) {
      if (fleet.y_mm[u] > high_mm || fleet.y_mm[u] < low_mm) continue;
      const x = (fleet.x_mm[u] - left) * scale;
      const y = (top - fleet.y_mm[u]) * scale;
      if (Number.isNaN(fibre_x[u])) {  // a place that is not known has no arms
        raster.dot(x, y, 1.6 * dot, table[index[u]]);
        continue;
      }
      const bend_x = (elbow_x[u] - left) * scale;
      const bend_y = (top - elbow_y[u]) * scale;
      raster.line(x, y, bend_x, bend_y, thin, of32.link);
      raster.line(bend_x, bend_y, (fibre_x[u] - left) * scale, (top - fibre_y[u]) * scale, wide,
          table[index[u]]);
      if (state[u] > 3) raster.dot(x, y, 1.2 * dot, table[index[u]]);
    }
    plate.context.putImageData(raster.image, 0, 0, 0, first, canvas.width, last - first);
  }
}
