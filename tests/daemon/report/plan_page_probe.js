// The probe operates the page as a person would and writes what it sees into the document, for
// plan_page_browser_test.cc. `probeTimes` are the times at which it reads everything.
"use strict";

const probe = {errors: probeErrors};
const nextFrame = () => new Promise((done) => requestAnimationFrame(done));
const canvasOf = (id) => document.getElementById(id);

function pointer(canvas, type, x, y, buttons = 0) {
  canvas.setPointerCapture = () => {};  // no such pointer exists
  const box = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new PointerEvent(type, {bubbles: true, button: 0, buttons,
    clientX: box.left + canvas.clientLeft + x, clientY: box.top + canvas.clientTop + y}));
}

function key(name, shiftKey = false) {
  document.body.dispatchEvent(new KeyboardEvent("keydown", {bubbles: true, key: name, shiftKey}));
}

// Returns the units that show no paint in the middle of their arm.
function unpainted() {
  const {plate, motion} = planPage;
  const ratio = plate.canvas.width / plate.width;
  const colourAt = (x, y) => [...plate.context.getImageData(
      Math.floor(ratio * x), Math.floor(ratio * y), 1, 1).data].join();
  const empty = colourAt(1, 1);
  const missing = [];
  for (let u = 0; u < motion.count; ++u) {
    const x = plate.screenX((motion.elbow_x[u] + motion.fibre_x[u]) / 2);
    const y = plate.screenY((motion.elbow_y[u] + motion.fibre_y[u]) / 2);
    if (Number.isNaN(x) || colourAt(x, y) === empty) missing.push(u);
  }
  return missing;
}

function askAt(t_s) {
  const {motion, power} = planPage;
  planPage.setTime(t_s);
  planPage.draw();
  return {
    t_s, elbow_x: [...motion.elbow_x], elbow_y: [...motion.elbow_y],
    fibre_x: [...motion.fibre_x], fibre_y: [...motion.fibre_y], state: [...motion.state],
    total_W: power.total.at(t_s), rails_W: power.rails.map(({curve}) => curve.at(t_s)),
    drawn: Number(canvasOf("plate").dataset.drawn), unpainted: unpainted(),
    told: canvasOf("moving").textContent,
  };
}

async function play() {
  planPage.setTime(0);
  await nextFrame();
  canvasOf("play").click();
  const times = [];
  for (let k = 0; k < 40; ++k) {
    await nextFrame();
    times.push(planPage.t_s);
  }
  const label = canvasOf("play").textContent;
  key(" ");
  await nextFrame();
  const paused = planPage.t_s;
  await nextFrame();
  await nextFrame();
  return {times, label, paused, later: planPage.t_s, shown: canvasOf("time").textContent};
}

async function useKeys() {
  planPage.setTime(5);
  key("ArrowRight");
  const right = planPage.t_s;
  key("ArrowLeft", true);
  const left = planPage.t_s;
  key("End");
  const end = planPage.t_s;
  key("Home");
  await nextFrame();
  return {right, left, end, home: planPage.t_s};
}

// Clicks on the middle of an arm, away from the point about which the plate was centred.
async function click(u) {
  const {plate, motion} = planPage;
  key("0");
  await nextFrame();
  const x = plate.screenX((motion.elbow_x[u] + motion.fibre_x[u]) / 2);
  const y = plate.screenY((motion.elbow_y[u] + motion.fibre_y[u]) / 2);
  pointer(plate.canvas, "pointerdown", x, y, 1);
  pointer(plate.canvas, "pointerup", x, y);
  await nextFrame();
  return [...document.querySelectorAll("#unit dt")].reduce((facts, name) => (
    {...facts, [name.textContent]: name.nextSibling.textContent}), {});
}

async function zoomAndDrag() {
  const {plate} = planPage;
  key("0");
  await nextFrame();
  const before = {x: plate.plateX(100), y: plate.plateY(80), scale: plate.scale};
  const box = plate.canvas.getBoundingClientRect();
  plate.canvas.dispatchEvent(new WheelEvent("wheel", {deltaY: -400, cancelable: true,
    clientX: box.left + plate.canvas.clientLeft + 100,
    clientY: box.top + plate.canvas.clientTop + 80}));
  const zoomed = {x: plate.plateX(100), y: plate.plateY(80), scale: plate.scale};
  pointer(plate.canvas, "pointerdown", 100, 80, 1);
  pointer(plate.canvas, "pointermove", 160, 120, 1);
  pointer(plate.canvas, "pointerup", 160, 120);
  const dragged = {x: plate.plateX(160), y: plate.plateY(120), scale: plate.scale};
  await nextFrame();
  return {before, zoomed, dragged, drawn: Number(plate.canvas.dataset.drawn)};
}

async function jumpToPair() {
  const {plate, motion} = planPage;
  key("0");
  const whole = plate.scale;
  const button = document.querySelector("#pairs button");
  button.click();
  await nextFrame();
  const {a, b} = planPage.pairs[0];
  const [p, q] = motion.nearestPoints(a, b);
  return {text: button.textContent, t_s: planPage.t_s, pressed: button.getAttribute("aria-pressed"),
    marked: plate.markedPairs().length, zoomed: plate.scale / whole,
    off_x: plate.screenX((p[0] + q[0]) / 2) - plate.width / 2,
    off_y: plate.screenY((p[1] + q[1]) / 2) - plate.height / 2};
}

function clickCurves() {
  const {curves} = planPage;
  pointer(curves.canvas, "pointerdown", curves.x(7.5), 60, 1);
  return planPage.t_s;
}

function find(text) {
  canvasOf("find-id").value = text;
  document.querySelector("#find button").click();
  return canvasOf("find-trouble").textContent;
}

async function run() {
  await nextFrame();
  probe.units = planPage.motion.count;
  probe.makespan_s = planPage.motion.makespan_s;
  probe.moments = probeTimes.map(askAt);
  probe.play = await play();
  probe.keys = await useKeys();
  probe.clicked = await click(20);
  probe.unserved = await click(9);
  probe.view = await zoomAndDrag();
  probe.pair = await jumpToPair();
  probe.curves_t_s = clickCurves();
  probe.found = [find("17"), find("4711")];
  probe.selected = planPage.plate.selected;
  probe.legend = document.getElementById("legend").textContent;
  probe.fetched = performance.getEntriesByType("resource").length;
}

run().catch((error) => probe.errors.push(String(error))).then(() => {
  const result = document.createElement("pre");
  result.id = "probe";
  result.textContent = JSON.stringify(probe);
  document.body.append(result);
});
