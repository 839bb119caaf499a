// Plate draws the focal plane on a canvas, seen from the sky side: x to the right, y upwards. Parts
// outside the view are not drawn, nor those too small to be seen.

const kReachOfClick_px = 14;
const kFullCircle = 2 * Math.PI;
const kZoomMax_px_per_mm = 2000;
// A path of thousands of pieces is slow to paint without a graphics card, and so is a path for each
// piece. For 5000 arms these take 35 ms and 42 ms, paths of 64 pieces 15 ms.
const kPiecesOfPath = 64;

/** Colours by name, from the style sheet: they follow light and dark. */
function readColours(element) {
  const style = getComputedStyle(element);
  const names = [
    "paper", "plate", "ink", "muted", "grid", "moving", "waiting", "arrived", "stands", "unserved",
    "disabled", "unknown", "obstacle", "pair", "link", "s0", "s1", "s2", "s3", "s4", "s5", "s6"];
  const colourOf = (name) => style.getPropertyValue(`--${name}`).trim();
  return Object.fromEntries(names.map((name) => [name, colourOf(name)]));
}

/** Makes a canvas as fine as the screen; its size in CSS pixels. */
function fitCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
  return {width, height, ratio};
}

class Plate {
  constructor(canvas, motion, pairs) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.motion = motion;
    this.pairs = pairs;
    this.selected = -1;       // place of a unit
    this.selectedPair = null;
    this.visible = new Uint32Array(motion.count);
    this.visibleCount = 0;
    // Widths are rounded to whole um, so that widths that differ by rounding alone are drawn
    // together.
    this.half_width_mm = motion.units.half_width_mm.map((mm) => Math.round(1000 * mm) / 1000);
    this.half_widths_mm = [...new Set(this.half_width_mm)];
    this.reach_mm = 0;
    for (let u = 0; u < motion.count; ++u) {
      this.reach_mm = Math.max(this.reach_mm, this.reachOf(u));
    }
    this.colours = readColours(canvas);
    this.centre_x = 0;  // of the view, mm
    this.centre_y = 0;
    this.scale = 1;     // px per mm
    this.resize();
    this.showAll();
  }

  reachOf(u) {
    const {arm_theta_mm, arm_phi_mm, half_width_mm} = this.motion.units;
    return arm_theta_mm[u] + arm_phi_mm[u] + half_width_mm[u];
  }

  // ---- the view

  resize() {
    Object.assign(this, fitCanvas(this.canvas));
  }

  screenX(x_mm) { return this.width / 2 + (x_mm - this.centre_x) * this.scale; }
  screenY(y_mm) { return this.height / 2 - (y_mm - this.centre_y) * this.scale; }
  plateX(x_px) { return this.centre_x + (x_px - this.width / 2) / this.scale; }
  plateY(y_px) { return this.centre_y - (y_px - this.height / 2) / this.scale; }

  show({x, y, radius_mm}) {
    this.centre_x = x;
    this.centre_y = y;
    this.scale = Math.min(kZoomMax_px_per_mm,
        0.47 * Math.min(this.width, this.height) / Math.max(radius_mm, 1e-3));
  }

  showAll() {
    const {base_x_mm, base_y_mm} = this.motion.units;
    const box = [Infinity, -Infinity, Infinity, -Infinity];
    const add = (x, y, reach) => {
      box[0] = Math.min(box[0], x - reach);
      box[1] = Math.max(box[1], x + reach);
      box[2] = Math.min(box[2], y - reach);
      box[3] = Math.max(box[3], y + reach);
    };
    for (let u = 0; u < this.motion.count; ++u) add(base_x_mm[u], base_y_mm[u], this.reachOf(u));
    for (const {x_mm, y_mm, radius_mm} of this.motion.obstacles) add(x_mm, y_mm, radius_mm);
    if (box[0] > box[1]) return;
    this.centre_x = (box[0] + box[1]) / 2;
    this.centre_y = (box[2] + box[3]) / 2;
    this.scale = 0.97 * Math.min(this.width / (box[1] - box[0]), this.height / (box[3] - box[2]));
    this.scaleAll = this.scale;
  }

  /** Zooms; the point under (x, y) stays there. Units: px. */
  zoom(factor, x_px = this.width / 2, y_px = this.height / 2) {
    const x = this.plateX(x_px);
    const y = this.plateY(y_px);
    this.scale = Math.min(kZoomMax_px_per_mm, Math.max(this.scaleAll / 4, this.scale * factor));
    this.centre_x = x - (x_px - this.width / 2) / this.scale;
    this.centre_y = y + (y_px - this.height / 2) / this.scale;
  }

  pan(dx_px, dy_px) {
    this.centre_x -= dx_px / this.scale;
    this.centre_y += dy_px / this.scale;
  }

  showUnit(u) {
    const {base_x_mm, base_y_mm} = this.motion.units;
    this.show({x: base_x_mm[u], y: base_y_mm[u], radius_mm: 2.5 * this.motion.pitch_mm});
  }

  showPair({a, b}) {
    const [p, q] = this.motion.nearestPoints(a, b);
    this.show({x: (p[0] + q[0]) / 2, y: (p[1] + q[1]) / 2,
      radius_mm: 0.75 * Math.max(this.reachOf(a), this.reachOf(b))});
  }

  /** The unit whose arm or base is nearest to a place of the canvas, or -1. */
  unitAt(x_px, y_px) {
    const x = this.plateX(x_px);
    const y = this.plateY(y_px);
    const {motion} = this;
    let best = -1;
    let best_mm = kReachOfClick_px / this.scale;
    const toSegment = (ax, ay, bx, by) => {
      const dx = bx - ax;
      const dy = by - ay;
      const length2 = dx * dx + dy * dy || 1;
      const f = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / length2));
      return Math.hypot(x - ax - f * dx, y - ay - f * dy);
    };
    for (let u = 0; u < motion.count; ++u) {
      const bx = motion.units.base_x_mm[u];
      const by = motion.units.base_y_mm[u];
      if (Math.hypot(x - bx, y - by) > this.reach_mm + best_mm) continue;
      let mm = Math.hypot(x - bx, y - by);
      if (!Number.isNaN(motion.fibre_x[u])) {
        const width = motion.units.half_width_mm[u];
        const onPhi = toSegment(
            motion.elbow_x[u], motion.elbow_y[u], motion.fibre_x[u], motion.fibre_y[u]) - width;
        mm = Math.min(mm, Math.max(0, onPhi),
            toSegment(bx, by, motion.elbow_x[u], motion.elbow_y[u]));
      }
      if (mm < best_mm) {
        best = u;
        best_mm = mm;
      }
    }
    return best;
  }

  // ---- drawing

  draw() {
    const {context} = this;
    context.fillStyle = this.colours.plate;
    context.fillRect(0, 0, this.width, this.height);
    this.pitch_px = this.motion.pitch_mm * this.scale;
    this.findVisible();
    this.drawPatrol();
    this.drawObstacles();
    this.drawThetaArms();
    this.drawPhiArms();
    this.drawBases();
    this.drawFibres();
    this.drawTargets();
    this.drawIds();
    this.drawPairs();
    this.drawSelected();
    this.canvas.dataset.drawn = this.visibleCount;
  }

  findVisible() {
    const {base_x_mm, base_y_mm} = this.motion.units;
    const left = this.plateX(0) - this.reach_mm;
    const right = this.plateX(this.width) + this.reach_mm;
    const top = this.plateY(0) + this.reach_mm;
    const bottom = this.plateY(this.height) - this.reach_mm;
    let n = 0;
    for (let u = 0; u < this.motion.count; ++u) {
      const x = base_x_mm[u];
      const y = base_y_mm[u];
      if (x >= left && x <= right && y >= bottom && y <= top) this.visible[n++] = u;
    }
    this.visibleCount = n;
  }

  circle(x_px, y_px, radius_px) {
    this.context.moveTo(x_px + radius_px, y_px);
    this.context.arc(x_px, y_px, radius_px, 0, kFullCircle);
  }

  /** The path of a unit's phi arm, on the screen; `aside` moves it to its left. Units: px. */
  phiArm(u, aside) {
    const {elbow_x, elbow_y, fibre_x, fibre_y} = this.motion;
    const dx = fibre_x[u] - elbow_x[u];
    const dy = fibre_y[u] - elbow_y[u];
    const f = aside / Math.hypot(dx, dy);
    this.context.moveTo(this.screenX(elbow_x[u]) - f * dy, this.screenY(elbow_y[u]) - f * dx);
    this.context.lineTo(this.screenX(fibre_x[u]) - f * dy, this.screenY(fibre_y[u]) - f * dx);
  }

  drawPatrol() {
    if (this.selected < 0) return;
    const {context} = this;
    const {units} = this.motion;
    const u = this.selected;
    const x = this.screenX(units.base_x_mm[u]);
    const y = this.screenY(units.base_y_mm[u]);
    context.beginPath();
    this.circle(x, y, units.patrol_max_mm[u] * this.scale);
    this.circle(x, y, units.patrol_min_mm[u] * this.scale);
    context.globalAlpha = 0.12;
    context.fillStyle = this.colours.ink;
    context.fill("evenodd");
    context.globalAlpha = 1;
  }

  drawObstacles() {
    const {context} = this;
    context.beginPath();
    for (const {x_mm, y_mm, radius_mm} of this.motion.obstacles) {
      this.circle(this.screenX(x_mm), this.screenY(y_mm), Math.max(3, radius_mm * this.scale));
    }
    context.fillStyle = this.colours.obstacle;
    context.fill();
    context.lineWidth = 1;
    context.strokeStyle = this.colours.ink;
    context.stroke();
  }

  /**
   * Paints (stroke or fill) a piece of path for each visible unit for which `add` returns that it
   * made one.
   */
  paintUnits(paint, add) {
    const {context} = this;
    let pieces = 0;
    context.beginPath();
    for (let k = 0; k < this.visibleCount; ++k) {
      if (!add(this.visible[k]) || ++pieces % kPiecesOfPath !== 0) continue;
      context[paint]();
      context.beginPath();
    }
    context[paint]();
  }

  drawTargets() {
    if (this.pitch_px < 18) return;
    const {context} = this;
    const {target_x_mm, target_y_mm} = this.motion.units;
    const radius = Math.min(7, Math.max(1.5, 0.05 * this.pitch_px));
    context.lineWidth = radius < 3 ? 0.8 : 1.3;
    context.strokeStyle = this.colours.ink;
    this.paintUnits("stroke", (u) => {
      if (Number.isNaN(target_x_mm[u])) return false;
      const x = this.screenX(target_x_mm[u]);
      const y = this.screenY(target_y_mm[u]);
      this.circle(x, y, radius);
      if (radius < 3) return true;
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        context.moveTo(x + dx * radius, y + dy * radius);
        context.lineTo(x + 1.7 * dx * radius, y + 1.7 * dy * radius);
      }
      return true;
    });
  }

  drawThetaArms() {
    const {context, motion} = this;
    context.lineCap = "butt";
    context.lineWidth = Math.min(4, Math.max(1 / this.ratio, 0.025 * this.pitch_px));
    context.strokeStyle = this.colours.link;
    this.paintUnits("stroke", (u) => {
      if (Number.isNaN(motion.elbow_x[u])) return false;
      context.moveTo(this.screenX(motion.units.base_x_mm[u]),
          this.screenY(motion.units.base_y_mm[u]));
      context.lineTo(this.screenX(motion.elbow_x[u]), this.screenY(motion.elbow_y[u]));
      return true;
    });
  }

  // Arms are drawn colour by colour; moving arms come last, on top. The arms of a layout have few
  // widths.
  drawPhiArms() {
    for (let state = kStates.length - 1; state >= 0; --state) {
      if (this.motion.inState[state] === 0) continue;
      this.context.strokeStyle = this.colours[kStates[state].name];
      for (const width_mm of this.half_widths_mm) this.drawArmsOf(state, width_mm);
    }
  }

  // A line of two pixels costs ten times as much as two lines of one pixel beside each other.
  drawArmsOf(state, half_width_mm) {
    const {context, motion} = this;
    const width_px = 2 * half_width_mm * this.scale;
    const pixel = 1 / this.ratio;
    const isThin = width_px < 2.5 * pixel;
    context.lineWidth = isThin ? pixel : width_px;
    context.lineCap = isThin ? "butt" : "round";
    for (const aside of isThin ? [-0.4 * pixel, 0.4 * pixel] : [0]) {
      this.paintUnits("stroke", (u) => {
        if (motion.state[u] !== state || Number.isNaN(motion.fibre_x[u])) return false;
        if (this.half_width_mm[u] !== half_width_mm) return false;
        this.phiArm(u, aside);
        return true;
      });
    }
  }

  // The shape shows the state without colour: a square is disabled, a diamond not served, an empty
  // circle not known.
  drawBases() {
    const {context, motion} = this;
    const special = Math.min(9, Math.max(2.2, 0.07 * this.pitch_px));
    const {base_x_mm, base_y_mm, unserved, enabled, start_theta_deg} = motion.units;
    const paint = (colour, belongs, outline) => {
      context.fillStyle = colour;
      this.paintUnits("fill", (u) => {
        if (!belongs(u)) return false;
        outline(this.screenX(base_x_mm[u]), this.screenY(base_y_mm[u]));
        return true;
      });
    };
    const isKnown = (u) => !Number.isNaN(start_theta_deg[u]);
    const isUnknown = (u) => enabled[u] && !isKnown(u);
    this.drawPlainBases((u) => enabled[u] && !unserved[u] && isKnown(u));
    paint(this.colours.disabled, (u) => !enabled[u],
        (x, y) => context.rect(x - special, y - special, 2 * special, 2 * special));
    paint(this.colours.unserved, (u) => enabled[u] && unserved[u] && isKnown(u),
        (x, y) => this.diamond(x, y, 1.4 * special));
    paint(this.colours.unknown, isUnknown, (x, y) => this.circle(x, y, special));
    paint(this.colours.plate, isUnknown, (x, y) => this.circle(x, y, 0.6 * special));
    context.lineWidth = 1.5;
    context.strokeStyle = this.colours.unserved;
    this.paintUnits("stroke", (u) => {
      if (motion.isBlocker[u]) {
        this.circle(this.screenX(base_x_mm[u]), this.screenY(base_y_mm[u]), 1.9 * special);
      }
      return motion.isBlocker[u];
    });
  }

  drawPlainBases(belongs) {
    const {context} = this;
    const {base_x_mm, base_y_mm} = this.motion.units;
    const radius = Math.min(6, 0.035 * this.pitch_px);
    const isDot = radius < 0.7;  // at a pixel or two a short line costs a tenth of a circle
    context.fillStyle = this.colours.ink;
    context.strokeStyle = this.colours.ink;
    context.lineWidth = 1 / this.ratio;
    context.lineCap = "butt";
    this.paintUnits(isDot ? "stroke" : "fill", (u) => {
      if (!belongs(u)) return false;
      const x = this.screenX(base_x_mm[u]);
      const y = this.screenY(base_y_mm[u]);
      if (!isDot) this.circle(x, y, radius);
      else {
        context.moveTo(x - 0.6, y);
        context.lineTo(x + 0.6, y);
      }
      return true;
    });
  }

  diamond(x_px, y_px, radius_px) {
    this.context.moveTo(x_px, y_px - radius_px);
    this.context.lineTo(x_px + radius_px, y_px);
    this.context.lineTo(x_px, y_px + radius_px);
    this.context.lineTo(x_px - radius_px, y_px);
    this.context.closePath();
  }

  drawFibres() {
    if (this.pitch_px < 40) return;
    const {context, motion} = this;
    const radius = Math.min(4, 0.014 * this.pitch_px);
    context.fillStyle = this.colours.plate;
    this.paintUnits("fill", (u) => {
      if (Number.isNaN(motion.fibre_x[u])) return false;
      this.circle(this.screenX(motion.fibre_x[u]), this.screenY(motion.fibre_y[u]), radius);
      return true;
    });
  }

  drawIds() {
    if (this.pitch_px < 70) return;
    const {context, motion} = this;
    context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    context.textAlign = "center";
    context.textBaseline = "top";
    for (let k = 0; k < this.visibleCount; ++k) {
      const u = this.visible[k];
      const x = this.screenX(motion.units.base_x_mm[u]);
      const y = this.screenY(motion.units.base_y_mm[u]) + Math.min(12, 0.06 * this.pitch_px) + 3;
      this.label(String(motion.units.id[u]), x, y);
    }
  }

  /** Draws text that is legible on any background. */
  label(text, x_px, y_px, colour = this.colours.ink) {
    const {context} = this;
    context.lineJoin = "round";
    context.lineWidth = 3;
    context.strokeStyle = this.colours.plate;
    context.strokeText(text, x_px, y_px);
    context.fillStyle = colour;
    context.fillText(text, x_px, y_px);
  }

  /** The pairs to mark at this time: those near their moment, and the one that was chosen. */
  markedPairs() {
    const near_s = Math.max(0.25, 0.01 * this.motion.makespan_s);
    return this.pairs.filter((pair) => pair === this.selectedPair ||
        Math.abs(pair.t_s - this.motion.t_s) <= near_s);
  }

  drawPairs() {
    const {context, motion} = this;
    for (const pair of this.markedPairs()) {
      const [p, q] = motion.nearestPoints(pair.a, pair.b);
      if (Number.isNaN(p[0] + q[0])) continue;
      const x = this.screenX((p[0] + q[0]) / 2);
      const y = this.screenY((p[1] + q[1]) / 2);
      const radius = Math.max(9, 0.16 * this.pitch_px);
      if (this.pitch_px > 60) this.drawKeepOut(pair);
      context.beginPath();
      this.circle(x, y, radius);
      context.lineWidth = pair === this.selectedPair ? 3 : 2;
      context.strokeStyle = this.colours.pair;
      context.stroke();
      if (this.pitch_px < 40 && pair !== this.selectedPair) continue;
      context.beginPath();
      context.moveTo(this.screenX(p[0]), this.screenY(p[1]));
      context.lineTo(this.screenX(q[0]), this.screenY(q[1]));
      context.lineWidth = 1.5;
      context.stroke();
      context.font = "600 12px system-ui, 'DejaVu Sans', sans-serif";
      context.textAlign = "left";
      context.textBaseline = "middle";
      this.label(micrometres(pair.clearance_mm), x + radius + 5, y, this.colours.pair);
    }
  }

  // Draws each arm with half of the clearance around it. Where the two outlines meet, the pair is
  // just clear.
  drawKeepOut({a, b}) {
    const {context, motion} = this;
    context.beginPath();
    for (const u of [a, b]) {
      const x0 = this.screenX(motion.elbow_x[u]);
      const y0 = this.screenY(motion.elbow_y[u]);
      const x1 = this.screenX(motion.fibre_x[u]);
      const y1 = this.screenY(motion.fibre_y[u]);
      const r = (motion.units.half_width_mm[u] + motion.clearance_mm / 2) * this.scale;
      const along = Math.atan2(y1 - y0, x1 - x0);
      const side = Math.PI / 2;
      context.moveTo(x1 + r * Math.cos(along - side), y1 + r * Math.sin(along - side));
      context.arc(x1, y1, r, along - side, along + side);
      context.arc(x0, y0, r, along + side, along + 3 * side);
      context.closePath();
    }
    context.setLineDash([4, 3]);
    context.lineWidth = 1;
    context.strokeStyle = this.colours.pair;
    context.stroke();
    context.setLineDash([]);
  }

  drawSelected() {
    if (this.selected < 0) return;
    const {context, motion} = this;
    const u = this.selected;
    const {units} = motion;
    context.strokeStyle = this.colours.ink;
    context.lineWidth = 2;
    context.beginPath();
    this.circle(this.screenX(units.base_x_mm[u]), this.screenY(units.base_y_mm[u]),
        Math.max(6, 0.11 * this.pitch_px));
    if (!Number.isNaN(units.target_x_mm[u])) {
      this.circle(this.screenX(units.target_x_mm[u]), this.screenY(units.target_y_mm[u]),
          Math.max(4, 0.075 * this.pitch_px));
    }
    context.stroke();
  }
}

/** A clearance as text: "+12.3 um", signed, because 0 is just clear. */
function micrometres(mm) {
  const um = 1000 * mm;
  const digits = Math.abs(um) < 100 ? 1 : 0;
  return `${um < 0 ? "\u2212" : "+"}${Math.abs(um).toFixed(digits)} \u00b5m`;
}
