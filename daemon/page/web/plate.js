// Plate draws the focal plane. Where units are small it draws into an image of its own (far.js),
// where they are large by the canvas (near.js). Between two frames of the daemon it turns arms
// (turning.js).

import {readColours, stateOf} from "/page/colours.js";
import {Far} from "/page/far.js";
import {Near} from "/page/near.js";
import {Neighbours} from "/page/neighbours.js";
import {Turning} from "/page/turning.js";
import {View} from "/page/view.js";

const kNear_px = 26;        // a pitch from which on units are drawn as shapes
const kReachOfClick_px = 14;
const kFullCircle = 2 * Math.PI;
const kEverywhere = {low_mm: -Infinity, high_mm: Infinity};

// Sines of a turn in even steps of 0.1 mrad, a hundredth of a pixel at an arm of 100 px.
const kSteps = 65536;
const kStepsPerRadian = kSteps / kFullCircle;
const kQuarter = kSteps / 4;
const kSines = Float64Array.from({length: kSteps}, (_, k) => Math.sin(k / kStepsPerRadian));

export class Plate {
  constructor(canvas, fleet) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", {alpha: false});
    this.fleet = fleet;
    this.view = new View(fleet);
    this.far = new Far(this);
    this.near = new Near(this);
    this.neighbours = new Neighbours(fleet);
    const n = fleet.count;
    this.elbow_x = new Float64Array(n).fill(NaN);
    this.elbow_y = new Float64Array(n).fill(NaN);
    this.fibre_x = new Float64Array(n).fill(NaN);
    this.fibre_y = new Float64Array(n).fill(NaN);
    this.state = new Uint8Array(n);
    this.index = new Uint8Array(n);  // of the theme's entry
    this.counts = [];
    this.turning = new Turning(fleet);
    this.placed = (u, theta, phi) => this.place(u, theta, phi);
    this.selected = -1;
    this.targets = null;  // [theta, phi] by place, of a preview; null: the fleet's own
    this.marked = [];  // units that a preview does not serve
    this.ways = null;  // of the configuration under way
    this.film = null;  // shown in place of the live fleet
    this.isPlayed = false;  // it goes on
    this.isStale = true;
    this.times_ms = [];  // of drawing, the newest last
    this.isAsked = false;
    this.bandsDue = 0;  // that have changed, and are not drawn yet
    this.recolour();
  }

  /** All is to be drawn: the browser is asked for a moment. At rest it is not. */
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
      if (this.turning.size > 0 || this.bandsDue > 0) this.ask();
    });
  }

  setTheme(theme) {
    this.theme = theme;
    this.reindex();
    this.dirty = true;
  }

  /** The style sheet has other colours now. */
  recolour() {
    this.colours = readColours(this.canvas);
    this.dirty = true;
  }

  /** Units have other states. Far away they are drawn with the next bands. */
  reindex() {
    this.counts = new Array(this.theme.entries.length).fill(0);
    for (let u = 0; u < this.fleet.count; ++u) {
      this.state[u] = this.film ? this.film.state[u] : stateOf(this.fleet, u);
      this.index[u] = this.theme.indexOf(u);
      ++this.counts[this.index[u]];
    }
    this.bandsDue = this.far.bands;
    this.ask();
  }

  /** Shows a film, or with null the live fleet again. */
  show(film) {
    this.film = film;
    this.placeAll();
  }

  /** The film stands at another instant: all of it is shown at once. */
  placeFilm() {
    this.isPlayed = false;
    this.film.seek(this.film.t_s);
    for (let u = 0; u < this.fleet.count; ++u) this.placeOfFilm(u);
    this.reindex();
    this.dirty = true;
  }

  /** The film goes on: far away the next band of it is shown. */
  playFilm() {
    this.isPlayed = true;
    this.bandsDue = Math.max(1, this.bandsDue);
    this.ask();
  }

  /** The counts of the legend are those of the film's instant. */
  countFilm() {
    this.film.seek(this.film.t_s);
    this.reindex();
  }

  placeOfFilm(u) {
    const {theta, phi} = this.film;
    this.place(u, theta[u], phi[u]);
  }

  /** Units of a band are where the film has them at its instant. */
  showFilm({low_mm, high_mm}) {
    const {film, fleet, theme} = this;
    for (let u = 0; u < fleet.count; ++u) {
      if (fleet.y_mm[u] > high_mm || fleet.y_mm[u] < low_mm) continue;
      film.update(u);
      this.placeOfFilm(u);
      this.state[u] = film.state[u];
      this.index[u] = theme.indexOf(u);
    }
  }

  // ---- motion

  /** A frame begins. */
  beginFrame(now_ms) {
    this.turning.begin(now_ms);
  }

  /** The frame turns the unit; its old angles are still there. */
  noteTurn(u) {
    this.turning.note(u);
  }

  /** The frame is read. */
  endFrame() {
    this.turning.end();
    if (this.film) return this.turning.clear();  // the live fleet goes on unseen
    if (this.turning.size > 0) this.ask();
  }

  place(u, theta, phi) {
    const {fleet} = this;
    if (Number.isNaN(theta + phi)) {
      this.elbow_x[u] = this.elbow_y[u] = this.fibre_x[u] = this.fibre_y[u] = NaN;
      return;
    }
    const along = Math.round(theta * kStepsPerRadian) & (kSteps - 1);
    const both = Math.round((theta + phi) * kStepsPerRadian) & (kSteps - 1);
    this.elbow_x[u] = fleet.x_mm[u] + fleet.arm_theta_mm[u] * kSines[(along + kQuarter) & (kSteps - 1)];
    this.elbow_y[u] = fleet.y_mm[u] + fleet.arm_theta_mm[u] * kSines[along];
    this.fibre_x[u] = this.elbow_x[u] + fleet.arm_phi_mm[u] * kSines[(both + kQuarter) & (kSteps - 1)];
    this.fibre_y[u] = this.elbow_y[u] + fleet.arm_phi_mm[u] * kSines[both];
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

  /** Targets of a preview by place, as [theta, phi], or with null those of the fleet again. */
  showTargets(targets) {
    this.targets = targets;
    this.dirty = true;
  }

  targetOf(u) {
    const {fleet, film, targets} = this;
    const [theta, phi] = targets && !film ? targets.get(u) ?? [NaN, NaN]
      : [(film ?? fleet).targetTheta[u], (film ?? fleet).targetPhi[u]];
    const both = theta + phi;
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
    const turns = this.turning.size > 0;
    if ((!this.isDirty && !turns && this.bandsDue === 0) || !this.theme) return;
    const isFar = this.view.pitch_px < kNear_px;
    const isWhole = this.isDirty || !isFar;
    const band = isWhole ? this.far.wholeBand() : this.far.nextBand();
    this.turning.show(now_ms, isWhole ? kEverywhere : band, this.placed);
    if (this.film && this.isPlayed) this.showFilm(isWhole ? kEverywhere : band);
    this.dirty = false;
    this.bandsDue = isWhole ? 0 : Math.max(0, this.bandsDue - 1);
    // Beside a border an arm may have been drawn for two instants.
    if (turns && this.turning.size === 0 && !isWhole) this.bandsDue = this.far.bands;
    if (isFar) this.far.draw(band);
    else this.near.draw(this.view.visible());
    this.drawOver(band);
    const took_ms = performance.now() - begun;
    performance.measure("plate", {start: begun, duration: took_ms});
    performance.clearMeasures("plate");
    this.times_ms.push(took_ms);
    if (this.times_ms.length > 1200) this.times_ms.splice(0, 600);
  }

  /** What lies over the units, in the rows that were drawn. */
  drawOver({top, bottom}) {
    const {context, view} = this;
    context.save();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.beginPath();
    context.rect(0, top, this.canvas.width, bottom - top);
    context.clip();
    context.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    this.drawMarks();
    if (this.isStale && !this.film) this.drawHatch();
    context.restore();
  }

  drawMarks() {
    const {context, view, fleet, colours} = this;
    context.strokeStyle = colours.unserved;
    context.lineWidth = 2;
    context.beginPath();
    for (const u of this.marked) {
      const x = view.screenX(fleet.x_mm[u]);
      const y = view.screenY(fleet.y_mm[u]);
      const radius = Math.max(6, 0.3 * view.pitch_px);
      context.moveTo(x + radius, y);
      context.arc(x, y, radius, 0, kFullCircle);
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
    this.drawNeighbours(u);
    ring(Math.max(9, fleet.patrol_max_mm[u] * view.scale), 4, colours.plate);
    ring(Math.max(9, fleet.patrol_max_mm[u] * view.scale), 2, colours.ink);
  }

  /** Thin rings about the units beside one, where there is room for them. */
  drawNeighbours(u) {
    const {context, view, fleet, colours} = this;
    if (view.pitch_px < kNear_px) return;
    context.beginPath();
    for (const v of this.neighbours.of(u)) {
      const x = view.screenX(fleet.x_mm[v]);
      const y = view.screenY(fleet.y_mm[v]);
      const radius = fleet.patrol_max_mm[v] * view.scale;
      context.moveTo(x + radius, y);
      context.arc(x, y, radius, 0, kFullCircle);
    }
    context.lineWidth = 1;
    context.setLineDash([3, 5]);
    context.strokeStyle = colours.muted;
    context.stroke();
    context.setLineDash([]);
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
