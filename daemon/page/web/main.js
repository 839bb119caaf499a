// The page put together. A handle for tests and consoles: `focalfleetPage`.

import {Access} from "/page/access.js";
import {Alarms} from "/page/alarms.js";
import {Api} from "/page/api.js";
import {Camera} from "/page/camera.js";
import {kStates, makeFilmThemes, makeThemes, stateOf} from "/page/colours.js";
import {Commands} from "/page/commands.js";
import {Configuration} from "/page/configuration.js";
import {Curves} from "/page/curves.js";
import {counted, duration, find, make, set, setText} from "/page/dom.js";
import {Diagnosis} from "/page/diagnosis.js";
import {Earlier} from "/page/earlier.js";
import {Events} from "/page/events.js";
import {Fleet} from "/page/frames.js";
import {Model} from "/page/model.js";
import {Nights} from "/page/nights.js";
import {Plate} from "/page/plate.js";
import {Player} from "/page/player.js";
import {Pointer} from "/page/pointer.js";
import {SharedStream} from "/page/shared_stream.js";
import {Sheets} from "/page/sheets.js";
import {Stop} from "/page/stop.js";
import {UnitPanel} from "/page/unit.js";
import {Ways} from "/page/ways.js";

const kStale_ms = 2500;  // status comes each second at least
const kFresh_ms = 2000;  // ages below it are one text
const kLook_ms = 500;    // at an age or a legend that changes
const kLegend_ms = 500;

/**
 * An age in whole seconds: a text that changes all the time is neither calm nor cheap. Status comes
 * each second at rest.
 */
function inWords(age_ms) {
  return age_ms < kFresh_ms ? "less than 2 s" : duration(Math.floor(age_ms / 1000)).replace(".0", "");
}

/** Parts of the page, and the verb without which each of them is nothing. */
const kOffers = [["show-nights", "history"], ["show-model", "model"], ["show-diagnosis", "diagnose"],
  ["show-camera", "measurements"], ["earlier-section", "replay"], ["events-section", "events"],
  ["commands-section", "audit"]];

class Page {
  constructor() {
    this.api = new Api();
    this.access = new Access(this.api, () => this.signedIn());
    this.stop = new Stop(this.api, this.access);
    this.stream = new SharedStream(this.api, (bytes) => this.onFrame(bytes),
        (state, text) => this.onState(state, text), () => this.fleet);
    this.plate = null;
    this.linkState = "waiting";
    this.linkText = "";
    this.legendAt_ms = 0;
    this.isLegendOld = false;
    this.ageTimer = 0;
    this.showAge();
  }

  async begin() {
    await this.access.refresh();
    if (this.access.role !== "none") return this.signedIn();
    this.onState("token", "");
    setText(find("fleet-summary"), "A token is needed to look on.");
    this.access.open("This daemon asks everybody for a token.");
  }

  async signedIn() {
    if (this.plate) {
      this.offer();
      this.stream.restart();
      this.alarms.refresh();
      this.commands.note();
      this.sheets.show(this.sheets.shown);
      if (this.fleet.facts) this.configuration.resultOf = "";
      return;
    }
    if (this.starting) return;
    this.starting = true;
    try {
      this.open(await this.api.layout());
      this.stream.run();
    } catch (error) {
      this.onState("waiting", error.message);
      setTimeout(() => this.signedIn(), 1000);
    } finally {
      this.starting = false;
    }
  }

  open(layout) {
    this.fleet = new Fleet(layout);
    this.plate = new Plate(find("plate"), this.fleet);
    this.plate.ways = new Ways(this.api, this.plate);
    const showUnit = (id) => this.unit.showId(id);
    this.player = new Player(this.plate, () => this.filmChanged(), () => this.showLegend());
    this.unit = new UnitPanel(this.api, this.access, this.plate, this.player, () => this.showScale(),
        (u) => this.player.select(u));
    this.alarms = new Alarms(this.api, this.access, showUnit);
    this.configuration = new Configuration(this.api, this.access, this.plate, this.player,
        {onUnit: showUnit, onErrors: () => this.showErrors()});
    this.earlier = new Earlier(this.api, this.access, this.plate, this.player);
    this.commands = new Commands(this.api, this.access);
    this.events = new Events(this.api, () => this.commands.note());
    this.openThemes();
    this.openSheets();
    this.offer();
    new Pointer(this.plate, (u) => this.unit.select(u), () => this.showScale());
    const fit = () => {
      this.plate.resize();
      this.showScale();
    };
    new ResizeObserver(fit).observe(find("plate"));
    fit();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.plate.recolour();
      this.curves.remake();
      this.showLegend();
    });
  }

  openSheets() {
    const {api, plate} = this;
    const showUnit = (id) => {
      this.sheets.show("plate");
      this.unit.showId(id);
    };
    this.curves = new Curves(api, plate, () => this.sheets.shown === "curves");
    this.nights = new Nights(api, () => this.sheets.shown === "nights");
    this.model = new Model(api, this.access);
    this.diagnosis = new Diagnosis(api, this.access, () => this.sheets.shown === "diagnosis",
        () => this.sheets.show("model"));
    this.camera = new Camera(api, plate, showUnit);
    this.sheets = new Sheets({curves: () => this.curves.show(), nights: () => this.nights.show(),
      model: () => this.model.show(), diagnosis: () => this.diagnosis.open(), camera: () => this.camera.show()});
  }

  /** The plate shows a film, or the live fleet again. */
  filmChanged() {
    const {film} = this.player;
    const select = find("theme");
    const themes = film ? makeFilmThemes(film, this.themes) : this.themes;
    for (const option of select.options) option.disabled = !themes[option.value];
    if (!themes[select.value]) select.value = "state";
    this.shownThemes = themes;
    if (film) this.sheets.show("plate");
    find("sheet-plate").classList.toggle("film", Boolean(film));
    this.plate.setTheme(themes[select.value]);
    this.player.select(this.plate.selected);
    this.unit.showFilm();
    setText(find("legend-of"), film ? `Counts of the ${this.player.name}, not of the live fleet.` : "");
    this.showLegend();
  }

  /** All units of the plate, by their distance from their targets. */
  showErrors() {
    this.sheets.show("plate");
    this.plate.view.showAll();
    this.showScale();
    const select = find("theme");
    select.value = "error";
    select.dispatchEvent(new Event("change"));
  }

  /** What the daemon does not carry out is not offered. */
  offer() {
    for (const [id, verb] of kOffers) {
      const element = find(id);
      element.hidden = !this.access.has(verb);
    }
    if (find(`show-${this.sheets.shown}`).hidden) this.sheets.show("plate");
  }

  openThemes() {
    this.themes = makeThemes(this.fleet, this.plate.neighbours, () => performance.now());
    const select = find("theme");
    select.replaceChildren(...Object.entries(this.themes).map(([name, {title}]) =>
      make("option", {value: name}, title)));
    select.addEventListener("change", () => {
      this.plate.setTheme(this.shownThemes[select.value]);
      this.showLegend();
    });
    this.shownThemes = this.themes;
    this.plate.setTheme(this.themes.state);
    this.showLegend();
  }

  // ---- the stream

  onFrame(bytes) {
    const now_ms = performance.now();
    const {plate, fleet} = this;
    plate.beginFrame(now_ms);
    let states = false;
    const {snapshot, facts} = fleet.take(bytes, now_ms, (u) => plate.noteTurn(u), () => {
      states = true;
    });
    plate.endFrame();
    if (snapshot) plate.placeAll();
    states = states || Boolean(plate.theme.followsFrames);
    if (!plate.film && (snapshot || states)) plate.reindex();
    // The legend is written now and then, where hundreds change with each frame.
    this.isLegendOld = this.isLegendOld || states;
    if (snapshot || (this.isLegendOld && now_ms > this.legendAt_ms)) this.renewLegend(now_ms);
    if (facts) this.showFacts();
    this.showAge();
  }

  renewLegend(now_ms) {
    this.isLegendOld = false;
    this.legendAt_ms = now_ms + kLegend_ms;
    this.showSummary();
    this.showLegend();
  }

  onState(state, text) {
    const changed = state !== this.linkState;
    this.linkState = state;
    this.linkText = text;
    if (changed && state === "token") this.access.open(text || "A token is needed.");
    if (changed && state === "live") this.access.refresh().then(() => this.alarms.refresh());
    this.showAge();
  }

  // ---- what is said

  showAge() {
    const now_ms = performance.now();
    const age_ms = this.fleet ? this.fleet.age_ms(now_ms) : Infinity;
    const live = this.linkState === "live" && age_ms < kStale_ms;
    const words = {live: "live", waiting: "no link", token: "signed out", full: "full"};
    const link = find("link");
    setText(link, live || this.linkState !== "live" ? words[this.linkState] : "daemon is late");
    set(link, "className", `pill ${live ? "live" : this.linkState === "live" ? "waiting" : this.linkState}`);
    setText(find("age"), age_ms === Infinity ? "no data yet" : `data ${inWords(age_ms)} old`);
    const stale = find("stale");
    set(stale, "hidden", live);
    if (!live) setText(stale, age_ms === Infinity ? this.linkText || "Waiting for the daemon."
      : `Old: the plate as it was ${inWords(age_ms)} ago. ${this.linkText}`);
    if (!this.plate) return this.lookAgain(age_ms, true);
    if (this.plate.isStale !== !live) {
      this.plate.isStale = !live;
      this.plate.dirty = true;
    }
    const isByAge = find("theme").value === "age";
    if (isByAge && now_ms > this.legendAt_ms) this.plate.reindex();
    if ((this.isLegendOld || isByAge) && now_ms > this.legendAt_ms) this.renewLegend(now_ms);
    this.lookAgain(age_ms, this.isLegendOld || isByAge);
  }

  /** At rest each frame says the age anew, and only a frame that does not come needs a timer. */
  lookAgain(age_ms, isChanging) {
    clearTimeout(this.ageTimer);
    const wait_ms = isChanging ? kLook_ms : Math.max(kLook_ms, kFresh_ms - age_ms);
    this.ageTimer = setTimeout(() => this.showAge(), wait_ms);
  }

  showFacts() {
    const {facts} = this.fleet;
    this.stop.note(facts.configuration);
    this.showSummary();
    this.configuration.note(facts);
    this.plate.ways.note(facts);
    if (this.access.has("history")) {
      this.earlier.note(facts);
      this.nights.note(facts);
    }
    this.alarms.note(facts.alarms);
    if (this.access.has("events")) this.events.note(facts);
    if (this.access.has("history")) this.unit.history.note(facts);
    const down = facts.buses.filter(({link}) => link !== "up");
    const load = Math.max(0, ...facts.buses.map((bus) => bus.load));
    set(find("buses"), "className", down.length > 0 ? "trouble" : "");
    setText(find("buses"), `${counted(facts.buses.length, "bus", "buses")}, ` + (down.length === 0
      ? `all up, the fullest ${(100 * load).toFixed(0)} % full`
      : `${down.length} not up: ${down.slice(0, 12).map(({bus_id}) => bus_id).join(", ")}`) + ".");
  }

  /** The live fleet by states, in the legend's words: troubles first, as the line may be cut short. */
  showSummary() {
    const {fleet, fleet: {facts}} = this;
    if (!facts) return;
    const counts = new Array(kStates.length).fill(0);
    for (let u = 0; u < fleet.count; ++u) ++counts[stateOf(fleet, u)];
    const text = `${counted(facts.units, "unit")}: ` + kStates.map(({text: name}, k) => [name, counts[k]])
      .filter(([, count]) => count > 0).reverse()
      .map(([name, count]) => `${count.toLocaleString("en")} ${name.split(":")[0]}`).join(", ");
    setText(find("fleet-summary"), (facts.store_failing
      ? "The store fails: nothing new may move. " : "") + text);
    set(find("fleet-summary"), "title", text);
  }

  showLegend() {
    const {plate} = this;
    const list = find("legend");
    const entries = plate.theme.entries.slice(0, 60);
    if (list.childElementCount !== entries.length || list.dataset.theme !== find("theme").value) {
      list.dataset.theme = find("theme").value;
      list.replaceChildren(...entries.map(({text}) => make("li", {},
          make("i", {class: "key"}), make("b", {}), make("span", {}, text))));
    }
    entries.forEach(({colour}, k) => {
      const item = list.children[k];
      set(item, "className", plate.counts[k] === 0 ? "empty" : "");
      if (item.dataset.colour !== plate.colours[colour]) {
        item.dataset.colour = plate.colours[colour];
        item.firstChild.style.background = plate.colours[colour];
      }
      setText(item.children[1], plate.counts[k].toLocaleString("en"));
    });
  }

  /** A length of the plate that is easy to read, beside its bar. */
  showScale() {
    const {view} = this.plate;
    const most_mm = 120 / view.scale;
    const power = 10 ** Math.floor(Math.log10(most_mm));
    const mm = [5, 2, 1].map((k) => k * power).find((length) => length <= most_mm) ?? power;
    find("scale").firstElementChild.style.width = `${mm * view.scale}px`;
    setText(find("scale").lastElementChild, mm >= 1 ? `${mm} mm` : `${1000 * mm} µm`);
  }
}

const page = new Page();
window.focalfleetPage = page;
page.begin();
