// The page put together. A handle for tests and consoles: `focalfleetPage`.

import {Access} from "/page/access.js";
import {Alarms} from "/page/alarms.js";
import {Api} from "/page/api.js";
import {makeThemes} from "/page/colours.js";
import {Configuration} from "/page/configuration.js";
import {counted, duration, find, make, setText} from "/page/dom.js";
import {Events} from "/page/events.js";
import {Fleet, kPhases} from "/page/frames.js";
import {Pointer} from "/page/pointer.js";
import {Plate} from "/page/plate.js";
import {Stop} from "/page/stop.js";
import {Stream} from "/page/stream.js";
import {UnitPanel} from "/page/unit.js";

const kStale_ms = 2500;  // status comes each second at least
const kLegend_ms = 500;

/** An age in whole seconds: a text that changes all the time is neither calm nor cheap. */
function inWords(age_ms) {
  return age_ms < 1000 ? "less than 1 s" : duration(Math.floor(age_ms / 1000)).replace(".0", "");
}

class Page {
  constructor() {
    this.api = new Api();
    this.access = new Access(this.api, () => this.signedIn());
    this.stop = new Stop(this.api, this.access);
    this.stream = new Stream(this.api, (bytes) => this.onFrame(bytes),
        (state, text) => this.onState(state, text));
    this.plate = null;
    this.linkState = "waiting";
    this.linkText = "";
    this.legendAt_ms = 0;
    this.isLegendOld = false;
    setInterval(() => this.showAge(), 500);
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
      this.stream.restart();
      this.alarms.refresh();
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
    const showUnit = (id) => this.unit.showId(id);
    this.unit = new UnitPanel(this.api, this.plate, () => this.showScale());
    this.alarms = new Alarms(this.api, this.access, showUnit);
    this.configuration = new Configuration(this.api, this.access, this.plate, showUnit);
    this.events = new Events(this.api);
    this.openThemes();
    new Pointer(this.plate, (u) => this.unit.select(u), () => this.showScale());
    const fit = () => {
      this.plate.resize();
      this.showScale();
    };
    new ResizeObserver(fit).observe(find("plate"));
    fit();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.plate.recolour();
      this.showLegend();
    });
  }

  openThemes() {
    this.themes = makeThemes(this.fleet, () => performance.now());
    const select = find("theme");
    select.replaceChildren(...Object.entries(this.themes).map(([name, {title}]) =>
      make("option", {value: name}, title)));
    select.addEventListener("change", () => {
      this.plate.setTheme(this.themes[select.value]);
      this.showLegend();
    });
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
    if (snapshot || states) plate.reindex();
    // The legend is written now and then, where hundreds change with each frame.
    this.isLegendOld = this.isLegendOld || states;
    if (snapshot || (this.isLegendOld && now_ms > this.legendAt_ms)) this.renewLegend(now_ms);
    if (facts) this.showFacts();
    this.showAge();
  }

  renewLegend(now_ms) {
    this.isLegendOld = false;
    this.legendAt_ms = now_ms + kLegend_ms;
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
    link.className = `pill ${live ? "live" : this.linkState === "live" ? "waiting" : this.linkState}`;
    setText(find("age"), age_ms === Infinity ? "no data yet" : `data ${inWords(age_ms)} old`);
    const stale = find("stale");
    stale.hidden = live;
    if (!live) setText(stale, age_ms === Infinity ? this.linkText || "Waiting for the daemon."
      : `Old: the plate as it was ${inWords(age_ms)} ago. ${this.linkText}`);
    if (!this.plate) return;
    if (this.plate.isStale !== !live) {
      this.plate.isStale = !live;
      this.plate.dirty = true;
    }
    const isByAge = find("theme").value === "age";
    if (isByAge && now_ms > this.legendAt_ms) this.plate.reindex();
    if ((this.isLegendOld || isByAge) && now_ms > this.legendAt_ms) this.renewLegend(now_ms);
  }

  showFacts() {
    const {facts} = this.fleet;
    const counts = facts.phases.map((count, p) => [kPhases[p], count])
      .filter(([, count]) => count > 0).sort((a, b) => b[1] - a[1]);
    setText(find("fleet-summary"), `${counted(facts.units, "unit")}: ` +
        counts.map(([name, count]) => `${count.toLocaleString("en")} ${name}`).join(", ") +
        (facts.store_failing ? ". The store fails: nothing new may move." : ""));
    this.configuration.note(facts);
    this.alarms.note(facts.alarms);
    this.events.note(facts);
    const down = facts.buses.filter(({link}) => link !== "up");
    const load = Math.max(0, ...facts.buses.map((bus) => bus.load));
    find("buses").className = down.length > 0 ? "trouble" : "";
    setText(find("buses"), `${counted(facts.buses.length, "bus", "buses")}, ` + (down.length === 0
      ? `all up, the fullest ${(100 * load).toFixed(0)} % full`
      : `${down.length} not up: ${down.slice(0, 12).map(({bus_id}) => bus_id).join(", ")}`) + ".");
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
      item.className = plate.counts[k] === 0 ? "empty" : "";
      item.firstChild.style.background = plate.colours[colour];
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
