// Controls handles the reader's input: time, view, unit, pair, rail. The page draws when something
// has changed and rests otherwise.

const kStep_s = 0.1;
const kLongStep_s = 1;
const kFrameMax_s = 0.25;  // after a pause of the browser the plan continues without a jump
const kZoomStep = 1.4;
const kDrag_px = 4;

function byId(id) { return document.getElementById(id); }

function element(name, text, attributes = {}) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

class PlanPage {
  constructor(data) {
    this.motion = new Motion(data);
    this.power = new Power(this.motion, data.rail_limits);
    this.pairs = data.pairs;
    this.plate = new Plate(byId("plate"), this.motion, this.pairs);
    this.curves = new Curves(byId("curves"), this.motion, this.power);
    this.t_s = 0;
    this.playing = false;
    this.speed = 1;
    this.waitsForFrame = false;
    this.fillSummary();
    this.fillLegend();
    this.fillPairs();
    this.fillRails();
    this.listenToTime();
    this.listenToPlate();
    this.listenToPage();
    byId("slider").max = this.motion.makespan_s;
    this.goWhereTheAddressSays();
    this.redraw();
  }

  // ---- time

  setTime(t_s) {
    this.t_s = Math.min(this.motion.makespan_s, Math.max(0, t_s));
    this.redraw();
  }

  setPlaying(playing) {
    if (playing && this.t_s >= this.motion.makespan_s) this.t_s = 0;
    this.playing = playing && this.motion.makespan_s > 0;
    this.lastFrame_ms = undefined;
    byId("play").textContent = this.playing ? "Pause" : "Play";
    this.redraw();
  }

  redraw() {
    if (this.waitsForFrame) return;
    this.waitsForFrame = true;
    requestAnimationFrame((now_ms) => this.frame(now_ms));
  }

  frame(now_ms) {
    this.waitsForFrame = false;
    if (this.playing) {
      const passed_s = (now_ms - (this.lastFrame_ms ?? now_ms)) / 1000;
      this.lastFrame_ms = now_ms;
      this.t_s += this.speed * Math.min(kFrameMax_s, passed_s);
      if (this.t_s >= this.motion.makespan_s) {
        this.t_s = this.motion.makespan_s;
        this.setPlaying(false);
      }
    }
    this.draw();
    if (this.playing) this.redraw();
  }

  draw() {
    this.motion.setTime(this.t_s);
    this.plate.draw();
    this.curves.draw(this.t_s);
    this.tell();
  }

  listenToTime() {
    byId("play").addEventListener("click", () => this.setPlaying(!this.playing));
    byId("speed").addEventListener("change", (event) => {
      this.speed = Number(event.target.value);
    });
    byId("slider").addEventListener("input", (event) => this.setTime(Number(event.target.value)));
    const curves = byId("curves");
    const take = (event) => this.setTime(this.curves.timeAt(event.offsetX));
    curves.addEventListener("pointerdown", (event) => {
      curves.setPointerCapture(event.pointerId);
      take(event);
    });
    curves.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) take(event);
    });
  }

  // ---- the plate

  listenToPlate() {
    const {plate} = this;
    const {canvas} = plate;
    let drag = null;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 16 : 1;
      plate.zoom(Math.exp(-0.0015 * lines * event.deltaY), event.offsetX, event.offsetY);
      this.redraw();
    }, {passive: false});
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      drag = {x: event.offsetX, y: event.offsetY, moved: false};
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!drag) return;
      const dx = event.offsetX - drag.x;
      const dy = event.offsetY - drag.y;
      if (!drag.moved && Math.hypot(dx, dy) < kDrag_px) return;
      drag = {x: event.offsetX, y: event.offsetY, moved: true};
      plate.pan(dx, dy);
      this.redraw();
    });
    canvas.addEventListener("pointerup", (event) => {
      if (drag && !drag.moved) this.select(plate.unitAt(event.offsetX, event.offsetY));
      drag = null;
    });
    canvas.addEventListener("pointercancel", () => { drag = null; });
    byId("zoom-in").addEventListener("click", () => this.zoom(kZoomStep));
    byId("zoom-out").addEventListener("click", () => this.zoom(1 / kZoomStep));
    byId("zoom-all").addEventListener("click", () => this.showAll());
  }

  zoom(factor) {
    this.plate.zoom(factor);
    this.redraw();
  }

  showAll() {
    this.plate.showAll();
    this.redraw();
  }

  /** Selects a unit by its place in the layout; -1: none. */
  select(u) {
    this.plate.selected = u;
    byId("unit-hint").hidden = u >= 0;
    byId("unit").hidden = u < 0;
    this.redraw();
  }

  selectPair(pair) {
    this.setPlaying(false);
    this.setTime(pair.t_s);
    this.motion.setTime(this.t_s);
    this.plate.selectedPair = pair;
    this.plate.showPair(pair);
    this.redraw();
  }

  // ---- the page

  listenToPage() {
    document.addEventListener("keydown", (event) => this.onKey(event));
    byId("find").addEventListener("submit", (event) => {
      event.preventDefault();
      this.find(byId("find-id").value.trim());
    });
    const resized = new ResizeObserver(() => {
      const was = this.plate.scale / this.plate.scaleAll;
      const {centre_x, centre_y} = this.plate;
      this.plate.resize();
      this.plate.showAll();
      if (was !== 1) {
        Object.assign(this.plate, {centre_x, centre_y, scale: was * this.plate.scale});
      }
      this.curves.resize();
      this.draw();  // at once: a canvas of a new size is empty
    });
    resized.observe(this.plate.canvas);
    resized.observe(this.curves.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.plate.colours = readColours(this.plate.canvas);
      this.curves.resize();
      this.redraw();
    });
    addEventListener("hashchange", () => this.goWhereTheAddressSays());
  }

  onKey(event) {
    const {target, key} = event;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (target instanceof HTMLInputElement && target.type !== "range") return;
    if (target instanceof HTMLSelectElement) return;
    if (key === " " && target instanceof HTMLButtonElement) return;
    const step_s = event.shiftKey ? kLongStep_s : kStep_s;
    const actions = {
      " ": () => this.setPlaying(!this.playing),
      ArrowLeft: () => this.setTime(this.t_s - step_s),
      ArrowRight: () => this.setTime(this.t_s + step_s),
      Home: () => this.setTime(0),
      End: () => this.setTime(this.motion.makespan_s),
      "+": () => this.zoom(kZoomStep),
      "-": () => this.zoom(1 / kZoomStep),
      "0": () => this.showAll(),
      Escape: () => {
        this.plate.selectedPair = null;
        this.select(-1);
      },
    };
    if (!Object.hasOwn(actions, key)) return;
    event.preventDefault();
    actions[key]();
  }

  find(text) {
    const u = this.motion.placeOf.get(Number(text));
    const found = text !== "" && u !== undefined;
    byId("find-trouble").textContent = found ? "" : `no unit ${text}`;
    if (!found) return;
    this.select(u);
    this.plate.showUnit(u);
    this.redraw();
  }

  /** Shows the place and moment of a link: plan.html#t=12.5&unit=17. */
  goWhereTheAddressSays() {
    const wanted = new URLSearchParams(location.hash.slice(1));
    const t_s = Number(wanted.get("t"));
    if (wanted.has("t") && Number.isFinite(t_s)) this.setTime(t_s);
    this.motion.setTime(this.t_s);
    if (wanted.has("unit")) this.find(wanted.get("unit"));
    else this.select(-1);
    const pair = this.pairs[Number(wanted.get("pair")) - 1];
    if (pair) this.selectPair(pair);
  }

  fillSummary() {
    const {count, makespan_s, ends_s, units} = this.motion;
    const movers = ends_s.reduce((n, end) => n + (end >= 0 ? 1 : 0), 0);
    const targeted = units.target_x_mm.reduce((n, x) => n + (Number.isNaN(x) ? 0 : 1), 0);
    const unserved = units.unserved.reduce((n, why) => n + (why ? 1 : 0), 0);
    const facts = [
      `${count} units`, `${targeted} with a target`, `${movers} move`,
      ...(unserved ? [`${unserved} not served`] : []), `${makespan_s.toFixed(2)} s`,
      `${this.power.total.energy_J().toFixed(1)} J`,
      `peak ${this.power.total.peak_W.toFixed(2)} W`];
    byId("summary").textContent = facts.join(" \u00b7 ");
  }

  fillLegend() {
    this.legend = kStates.map(({name, text}) => {
      const item = element("li");
      const number = element("b", "0");
      item.append(element("i", "", {class: `key ${name}`}), number, ` ${text}`);
      byId("legend").append(item);
      return {item, number};
    });
    const add = (name, count, text) => {
      if (count === 0) return;
      const item = element("li");
      item.append(element("i", "", {class: `key ${name}`}), element("b", String(count)), text);
      byId("legend").append(item);
    };
    add("blocker", this.motion.isBlocker.reduce((n, is) => n + is, 0), " in the way of another");
    add("obstacle", this.motion.obstacles.length, " fixed obstacles");
    add("pair", this.pairs.length, " tightest pairs, near their time");
    const item = element("li");
    item.append(element("i", "", {class: "key target"}), " target");
    byId("legend").append(item);
    const {units, count} = this.motion;
    this.everInState = new Uint8Array(kStates.length).fill(1);
    this.everInState[State.disabled] = units.enabled.some((is) => !is);
    this.everInState[State.unserved] = units.unserved.some((why) => why);
    this.everInState[State.unknown] = units.start_theta_deg.some((deg) => Number.isNaN(deg));
    byId("plate").setAttribute("aria-label", `Focal plane with ${count} units`);
  }

  fillPairs() {
    const {units} = this.motion;
    byId("pairs-hint").textContent = this.pairs.length === 0 ?
      "This plan names none." :
      `Distance beyond the ${(1000 * this.motion.clearance_mm).toFixed(0)} \u00b5m that are kept.`;
    for (const pair of this.pairs) {
      const button = element("button", undefined, {type: "button"});
      button.append(element("span", `${units.id[pair.a]} \u2013 ${units.id[pair.b]}`),
          element("b", micrometres(pair.clearance_mm)),
          element("span", `${pair.t_s.toFixed(2)} s`));
      button.addEventListener("click", () => this.selectPair(pair));
      const item = element("li");
      item.append(button);
      byId("pairs").append(item);
      pair.button = button;
    }
  }

  fillRails() {
    const body = document.querySelector("#rails tbody");
    const addRow = (name, curve, limit_W, place) => {
      const row = element("tr");
      const head = element("th", undefined, {scope: "row"});
      row.append(head, element("td"), element("td", curve.peak_W.toFixed(3)),
          element("td", limit_W === undefined ? "\u2013" : limit_W.toFixed(3)));
      if (limit_W !== undefined && curve.peak_W > limit_W) row.classList.add("over");
      if (place === undefined) head.textContent = name;
      else head.append(this.railButton(Number(name), place));
      body.append(row);
      return {cell: row.cells[1], curve};
    };
    this.railRows = [addRow("all", this.power.total)];
    this.power.rails.forEach(({rail, curve, limit_W}, place) => {
      this.railRows.push(addRow(String(rail), curve, limit_W, place));
    });
    byId("curves").setAttribute("aria-label",
        `Power over time, peak ${this.power.total.peak_W.toFixed(3)} W, of ` +
        `${this.power.rails.length} rails`);
  }

  railButton(rail, place) {
    const button = element("button", undefined,
        {type: "button", "aria-pressed": "false", title: "Emphasise this rail's curve"});
    const key = element("i", "", {class: "key line"});
    key.style.background = `var(--s${place % 7})`;
    button.append(key, String(rail));
    button.addEventListener("click", () => {
      this.curves.emphasised = this.curves.emphasised === rail ? null : rail;
      for (const other of document.querySelectorAll("#rails button")) {
        other.setAttribute("aria-pressed",
            String(other === button && this.curves.emphasised === rail));
      }
      this.curves.drawStill();
      this.redraw();
    });
    return button;
  }

  // ---- texts beside the pictures

  tell() {
    const {motion, t_s} = this;
    const time = `${t_s.toFixed(2)} s`;
    byId("time").textContent = `${time} of ${motion.makespan_s.toFixed(2)} s`;
    byId("moving").textContent = `${motion.inState[State.moving]} moving`;
    const slider = byId("slider");
    slider.value = t_s;
    slider.setAttribute("aria-valuetext", `${time}, ${motion.inState[State.moving]} moving`);
    this.legend.forEach(({item, number}, state) => {
      number.textContent = motion.inState[state];
      item.hidden = !this.everInState[state];
    });
    for (const {cell, curve} of this.railRows) cell.textContent = curve.at(t_s).toFixed(3);
    const marked = new Set(this.plate.markedPairs());
    for (const pair of this.pairs) {
      pair.button.classList.toggle("now", marked.has(pair));
      pair.button.setAttribute("aria-pressed", String(pair === this.plate.selectedPair));
    }
    this.tellScale();
    if (this.plate.selected >= 0) this.tellUnit(this.plate.selected);
  }

  tellScale() {
    const {scale} = this.plate;
    const length_mm = roundStep(140 / scale, 1.8);
    const bar = byId("scale");
    bar.firstElementChild.style.width = `${length_mm * scale}px`;
    const digits = (x) => Number(x.toPrecision(3));
    bar.lastElementChild.textContent = length_mm >= 0.1 ?
      `${digits(length_mm)} mm` : `${digits(1000 * length_mm)} \u00b5m`;
  }

  tellUnit(u) {
    const {motion, t_s} = this;
    const {units} = motion;
    const point = (x, y) => `${x.toFixed(3)}, ${y.toFixed(3)} mm`;
    const facts = [["unit", String(units.id[u])], ["state", this.stateText(u)]];
    if (!Number.isNaN(motion.theta_deg[u])) {
      facts.push(["theta", `${motion.theta_deg[u].toFixed(3)}\u00b0`],
          ["phi", `${motion.phi_deg[u].toFixed(3)}\u00b0`],
          ["fibre", point(motion.fibre_x[u], motion.fibre_y[u])]);
    }
    facts.push(["target", Number.isNaN(units.target_x_mm[u]) ? "none" :
      point(units.target_x_mm[u], units.target_y_mm[u])]);
    if (motion.ends_s[u] >= 0) {
      facts.push(["moves", `${motion.begins_s[u].toFixed(2)} to ${motion.ends_s[u].toFixed(2)} s`]);
    }
    facts.push(["power", `${(1000 * motion.powerAt(u, t_s)).toFixed(1)} mW`],
        ["rail", String(units.rail[u])], ["bus, node", `${units.bus[u]}, ${units.node[u]}`]);
    const list = byId("unit");
    if (list.childElementCount !== 2 * facts.length) {
      list.replaceChildren(...facts.flatMap(() => [element("dt"), element("dd")]));
    }
    facts.forEach(([name, value], k) => {
      list.children[2 * k].textContent = name;
      list.children[2 * k + 1].textContent = value;
    });
  }

  stateText(u) {
    const {units, state} = this.motion;
    let text = kStates[state[u]].text;
    if (state[u] === State.stands && Number.isNaN(units.target_x_mm[u])) text += ", no target";
    if (units.unserved[u]) {
      text = (state[u] === State.moving ? "moving; " : "") + "target not served: " +
          kUnservedWhy[units.unserved[u]];
      if (units.by[u]) text += `; unit ${units.id[units.by[u] - 1]} is in the way`;
    }
    return text;
  }
}

const planPage = new PlanPage(JSON.parse(byId("plan").textContent));
