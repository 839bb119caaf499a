// The player shows a film on the plate in place of the live fleet, and says so all the time.

import {duration, find, make, setText} from "/page/dom.js";

const kLegend_ms = 300;
const kSpeedOfBands = 4;  // of a faster one an arm would be torn between two bands

export class Player {
  /** `onChange()`: the plate shows something else now; `onLegend()`: its counts have changed. */
  constructor(plate, onChange, onLegend) {
    Object.assign(this, {plate, onChange, onLegend});
    this.film = null;
    this.isPlaying = false;
    this.last_ms = 0;
    this.legendAt_ms = 0;
    this.name = "";
    this.describe = () => "";
    find("player-play").addEventListener("click", () => this.toggle());
    find("player-close").addEventListener("click", () => this.close());
    find("player-time").addEventListener("input", () => {
      this.pause();
      this.seek(this.timeOf(Number(find("player-time").value)));
    });
  }

  /**
   * `name` is that of its kind. `describe(u)` says what a unit did; `closed()` is called when the live
   * fleet is back.
   */
  open(film, {name, title, note, describe = () => "", closed = () => {}}) {
    if (this.film) this.closed();
    Object.assign(this, {film, name, describe, closed});
    setText(find("player-title"), title);
    find("player-note").replaceChildren(note);
    find("player").hidden = false;
    this.plate.show(film);
    this.onChange();
    this.seek(film.begin_s);
    this.play();
  }

  close() {
    if (!this.film) return;
    this.pause();
    this.film = null;
    find("player").hidden = true;
    this.plate.show(null);
    this.onChange();
    this.closed();
  }

  toggle() {
    if (this.isPlaying) return this.pause();
    if (this.film.t_s >= this.film.end_s) this.seek(this.film.begin_s);
    this.play();
  }

  play() {
    this.isPlaying = true;
    this.last_ms = performance.now();
    setText(find("player-play"), "Pause");
    this.ask();
  }

  pause() {
    this.isPlaying = false;
    if (this.plate.isPlayed) this.plate.placeFilm();  // its bands are not of the same instant
    setText(find("player-play"), "Play");
  }

  ask() {
    requestAnimationFrame((now_ms) => {
      if (!this.isPlaying) return;
      const passed_s = Math.max(0, now_ms - this.last_ms) / 1000 * Number(find("player-speed").value);
      this.last_ms = now_ms;
      this.seek(Math.min(this.film.end_s, this.film.t_s + passed_s));
      if (this.film.t_s >= this.film.end_s) this.pause();
      else this.ask();
    });
  }

  timeOf(share) {
    if (share >= 1000) return this.film.end_s;  // and no rounding before it
    return this.film.begin_s + share / 1000 * (this.film.end_s - this.film.begin_s);
  }

  seek(t_s) {
    const {film, plate} = this;
    film.t_s = t_s;
    const goesOn = this.isPlaying && t_s < film.end_s &&
        Number(find("player-speed").value) <= kSpeedOfBands;
    if (goesOn) plate.playFilm();
    else plate.placeFilm();
    const slider = find("player-time");
    const share = Math.round(1000 * (t_s - film.begin_s) / (film.end_s - film.begin_s));
    if (Number(slider.value) !== share) slider.value = String(share);
    const text = `${(t_s - film.begin_s).toFixed(1)} of ${duration(film.end_s - film.begin_s)}`;
    setText(find("player-at"), text);
    slider.setAttribute("aria-valuetext", text);
    const now_ms = performance.now();
    if (!this.isPlaying || now_ms > this.legendAt_ms || t_s >= film.end_s) {
      this.legendAt_ms = now_ms + kLegend_ms;
      if (goesOn) plate.countFilm();
      this.onLegend();
    }
  }

  /** The unit that is selected: what it did. */
  select(u) {
    find("player-unit").replaceChildren(this.film && u >= 0 ? make("span", {}, this.describe(u)) : "");
  }
}
