// Plate draws the focal plane. Where units are small it draws into an image of its own (raster.js),
// where they are large by the canvas (near.js). Between two frames of the daemon it turns arms
// evenly, and so shows them a tenth of a second late.

import {readColours, stateOf} from "/page/colours.js";
import {Near} from "/page/near.js";
import {Raster} from "/page/raster.js";
import {View} from "/page/view.js";

const kNear_px = 26;        // a pitch from which on units are drawn as shapes
const kReachOfClick_px = 14;
const kFullCircle = 2 * Math.PI;
const kTurnOfGap = 1.1;
const kTurnMost_ms = 400;   // after a longer gap arms are shown where they are

/** The shortest way from one angle to another. */
function turnBetween(from, to) {
  const turn = (to - from) % kFullCircle;
  if (turn > Math.PI) return turn - kFullCircle;
  return turn < -Math.PI ? turn + kFullCircle : turn;
}

export class Plate {
  constructor(canvas, fleet) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", {alpha: false});
    this.fleet = fleet;
    this.view = new View(fleet);
    this.raster = new Raster();
    this.near = new Near(this);
    const n = fleet.count;
    this.elbow_x = new Float64Array(n).fill(NaN);
    this.elbow_y = new Float64Array(n).fill(NaN);
    this.fibre_x = new Float64Array(n).fill(NaN);
    this.fibre_y = new Float64Array(n).fill(NaN);
    this.state = new Uint8Array(n);
    this.index = new Uint8Array(n);  // of the theme's entry
    this.counts = [];
    // Arms that turn: where they were shown when the last frame came.
    this.fromTheta = new Float64Array(n);
    this.fromPhi = new Float64Array(n);
    this.turning = new Set();
    this.turnedAt_ms = 0;
    this.gaps_ms = [100];  // between the last frames
    this.turn_ms = 100;
    this.selected = -1;
    this.marked = [];  // units that a preview does not serve
    this.film = null;  // shown in place of the live fleet
    this.isStale = true;
    this.times_ms = [];  // of drawing, the newest last
    this.isAsked = false;
    this.recolour();
  }

  /** Something has changed: the browser is asked for a moment to draw. At rest it is not. */
  set dirty(isDirty) {
    this.isDirty = isDirty;
    if (isDirty) this.ask();
  }

  ask() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame((now_ms) => {
      this.isAsked = false;
      this.drawIfDue(now_ms);
      if (this.turning.size > 0) this.ask();
    });
  }

  setTheme(theme) {
    this.theme = theme;
    this.reindex();
  }

  /** The style sheet has other colours now. */
  recolour() {
    this.colours = readColours(this.canvas);
    this.dirty = true;
  }

  reindex() {
    this.counts = new Array(this.theme.entries.length).fill(0);
    for (let u = 0; u < this.fleet.count; ++u) {
      this.state[u] = this.film ? this.film.state[u] : stateOf(this.fleet, u);
      this.index[u] = this.theme.indexOf(u);
      ++this.counts[this.index[u]];
    }
    this.dirty = true;
  }

  /** Shows a film, or with null the live fleet again. */
  show(film) {
    this.film = film;
    this.placeAll();
  }

  /** The film stands at another instant. */
  placeFilm() {
    const {theta, phi} = this.film;
    for (let u = 0; u < this.fleet.count; ++u) this.place(u, theta[u], phi[u]);
    this.reindex();
  }

  // ---- motion

  /** The shown angle of an axis at this instant. */
  shown(from, to, share) {
    return Number.isNaN(from) ? to : from + share * turnBetween(from, to);
  }

  share(now_ms) {
    return Math.min(1, (now_ms - this.turnedAt_ms) / this.turn_ms);
  }

  /** A frame begins: arms that turn do so from where they are shown now. */
  beginFrame(now_ms) {
    const share = this.share(now_ms);
    const {fleet, fromTheta, fromPhi} = this;
    for (const u of this.turning) {
      fromTheta[u] = this.shown(fromTheta[u], fleet.theta[u], share);
      fromPhi[u] = this.shown(fromPhi[u], fleet.phi[u], share);
    }
    const gap_ms = now_ms - this.turnedAt_ms;
    // Frames come unevenly: arms that arrive at the mean gap would stand and jump.
    if (gap_ms <= kTurnMost_ms) this.gaps_ms = [...this.gaps_ms.slice(-4), gap_ms];
    this.turn_ms = gap_ms > kTurnMost_ms ? 1 : kTurnOfGap * Math.max(...this.gaps_ms);
    this.before = this.turning;
    this.turning = new Set();
    this.turnedAt_ms = now_ms;
  }

  /** The frame turns the unit; its old angles are still there. */
  noteTurn(u) {
    if (!this.before.has(u)) {
      this.fromTheta[u] = this.fleet.theta[u];
      this.fromPhi[u] = this.fleet.phi[u];
    }
    this.before.delete(u);
    this.turning.add(u);
  }

  /** The frame is read: units that no longer turn are where it has them. */
  endFrame() {
    if (this.film) {  // the live fleet goes on unseen
      this.before = null;
      return this.turning.clear();
    }
    for (const u of this.before) this.place(u, this.fleet.theta[u], this.fleet.phi[u]);
    if (this.before.size + this.turning.size > 0) this.dirty = true;
    this.before = null;
  }

  place(u, theta, phi) {
    const {fleet} = this;
    this.elbow_x[u] = fleet.x_mm[u] + fleet.arm_theta_mm[u] * Math.cos(theta);
    this.elbow_y[u] = fleet.y_mm[u] + fleet.arm_theta_mm[u] * Math.sin(theta);
    this.fibre_x[u] = this.elbow_x[u] + fleet.arm_phi_mm[u] * Math.cos(theta + phi);
    this.fibre_y[u] = this.elbow_y[u] + fleet.arm_phi_mm[u] * Math.sin(theta + phi);
  }

  /** A snapshot came: units that do not turn are where it has them. */
  placeAll() {
    const {fleet} = this;
    this.turning.clear();
    if (this.film) return this.placeFilm();
    for (let u = 0; u < fleet.count; ++u) this.place(u, fleet.theta[u], fleet.phi[u]);
    this.dirty = true;
  }

  /** The units that stand farthest from their targets, the farthest first. */
  worst(most) {
    const {error_um, count} = this.fleet;
    const places = [];
    for (let u = 0; u < count; ++u) if (error_um[u] > 0) places.push(u);
    return places.sort((a, b) => error_um[b] - error_um[a]).slice(0, most);
  }

  turn(now_ms) {
    if (this.turning.size === 0) return;
    const share = this.share(now_ms);
    const {fleet, fromTheta, fromPhi} = this;
    for (const u of this.turning)
      this.place(u, this.shown(fromTheta[u], fleet.theta[u], share),
          this.shown(fromPhi[u], fleet.phi[u], share));
    if (share >= 1) this.turning.clear();
    this.dirty = true;
  }

  targetOf(u) {
    const {fleet} = this;
    const {targetTheta, targetPhi} = this.film ?? fleet;
    const theta = targetTheta[u];
    const both = theta + targetPhi[u];
    return [
      fleet.x_mm[u] + fleet.arm_theta_mm[u] * Math.cos(theta) +
          fleet.arm_phi_mm[u] * Math.cos(both),
      fleet.y_mm[u] + fleet.arm_theta_mm[u] * Math.sin(theta) +
          fleet.arm_phi_mm[u] * Math.sin(both)];
  }

  // ---- drawing

  /** Fits the canvas to its place on the page. */
  resize() {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const {clientWidth: width, clientHeight: height} = this.canvas;
    if (width === 0 || height === 0) return;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.view.resize(width, height, ratio);
    this.dirty = true;
  }

  /** Draws where something has changed. */
  drawIfDue(now_ms) {
    const begun = performance.now();
    this.turn(now_ms);
    if (!this.isDirty || !this.theme) return;
    this.dirty = false;
    if (this.view.pitch_px < kNear_px) this.drawFar();
    else this.near.draw(this.view.visible());
    this.context.setTransform(this.view.ratio, 0, 0, this.view.ratio, 0, 0);
    this.drawMarks();
    if (this.isStale && !this.film) this.drawHatch();
    const took_ms = performance.now() - begun;
    performance.measure("plate", {start: begun, duration: took_ms});
    performance.clearMeasures("plate");
    this.times_ms.push(took_ms);
    if (this.times_ms.length > 1200) this.times_ms.splice(0, 600);
  }

  drawFar() {
    const {raster, view, fleet, colours: {of32}, theme} = this;
    raster.resize(this.canvas.width, this.canvas.height);
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
      const x = (fleet.x_mm[u] - left) * scale;
      const y = (top - fleet.y_mm[u]) * scale;
      if (Number.isNaN(this.fibre_x[u])) {  // a place that is not known has no arms
        raster.dot(x, y, 1.6 * dot, table[this.index[u]]);
        continue;
      }
      const elbow_x = (this.elbow_x[u] - left) * scale;
      const elbow_y = (top - this.elbow_y[u]) * scale;
      raster.line(x, y, elbow_x, elbow_y, thin, of32.link);
      raster.line(elbow_x, elbow_y, (this.fibre_x[u] - left) * scale,
          (top - this.fibre_y[u]) * scale, wide, table[this.index[u]]);
      if (this.state[u] > 3) raster.dot(x, y, 1.2 * dot, table[this.index[u]]);
    }
    this.context.putImageData(raster.image, 0, 0);
  }

  drawMarks() {
    const {context, view, fleet, colours} = this;
    context.strokeStyle = colours.unserved;
    context.lineWidth = 2;
    context.beginPath();
    for (const u of this.marked) {
      const x = view.screenX(fleet.x_mm[u]);
      const y = view.screenY(fleet.y_mm[u]);
      context.moveTo(x + 6, y);
      context.arc(x, y, Math.max(6, 0.3 * view.pitch_px), 0, kFullCircle);
    }
    context.stroke();
    const u = this.selected;
    if (u < 0) return;
    const x = view.screenX(fleet.x_mm[u]);
    const y = view.screenY(fleet.y_mm[u]);
    const ring = (radius, width, colour) => {
      context.beginPath();
      context.arc(x, y, radius, 0, kFullCircle);
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.stroke();
    };
    ring(Math.max(9, fleet.patrol_max_mm[u] * view.scale), 4, colours.plate);
    ring(Math.max(9, fleet.patrol_max_mm[u] * view.scale), 2, colours.ink);
  }

  /** What is shown is old: paled and hatched. */
  drawHatch() {
    const {context, view, colours} = this;
    context.globalAlpha = 0.55;
    context.fillStyle = colours.plate;
    context.fillRect(0, 0, view.width, view.height);
    context.globalAlpha = 0.5;
    context.strokeStyle = colours.muted;
    context.lineWidth = 1;
    context.beginPath();
    for (let x = -view.height; x < view.width; x += 18) {
      context.moveTo(x, view.height);
      context.lineTo(x + view.height, 0);
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  /** The unit whose base or arm is nearest to a place of the canvas, or -1. */
  unitAt(x_px, y_px) {
    const {fleet, view} = this;
    const x = view.plateX(x_px);
    const y = view.plateY(y_px);
    let best = -1;
    let best_mm = Math.max(kReachOfClick_px / view.scale, 0.5 * fleet.pitch_mm);
    for (let u = 0; u < fleet.count; ++u) {
      let mm = Math.hypot(x - fleet.x_mm[u], y - fleet.y_mm[u]);
      if (mm > view.reach_mm + best_mm) continue;
      const ax = this.elbow_x[u];
      const ay = this.elbow_y[u];
      const dx = this.fibre_x[u] - ax;
      const dy = this.fibre_y[u] - ay;
      const f = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)));
      const onArm = Math.hypot(x - ax - f * dx, y - ay - f * dy);
      if (onArm < mm) mm = onArm;
      if (mm < best_mm) {
        best = u;
        best_mm = mm;
      }
    }
    return best;
  }
}
