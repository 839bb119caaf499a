// The scenarios of page_test.py.

import {readFileSync} from "node:fs";
import {armStop, assert, axeFindings, coloursOf, dropFile, given, isLive, kMoving, openTab, signIn,
  textOf, withBrowser, world} from "./browser.mjs";
import {calm} from "./calm_steps.mjs";
import {heap} from "./heap_steps.mjs";
import {past, study, tabs} from "./past_steps.mjs";
import {plane} from "./plane_steps.mjs";
import {tasks} from "./task_steps.mjs";

const targets = () => readFileSync(given.targets, "utf8");
const say = (text) => process.stdout.write(`${text}\n`);

/** Verbs that the tab sent, oldest first. */
function watchVerbs(tab) {
  const sent = [];
  tab.on("request", (request) => {
    const at = new URL(request.url()).pathname;
    if (at.startsWith("/api/")) sent.push(at.slice(5));
  });
  return sent;
}

async function night(browser) {
  say("nobody looks on without a token");
  const tab = await openTab(browser);
  await textOf(tab, "#link", "signed out");
  const sent = watchVerbs(tab);

  say("a page that did not come whole is loaded again");
  await tab.route("**/page/near.js", (route) => route.abort(), {times: 1});
  await tab.reload();
  await textOf(tab, "#fleet-summary", "did not come whole");
  await textOf(tab, "#link", "signed out");

  say("a wrong token is refused, with the daemon's words");
  await tab.fill("#token", "fft_wrong");
  await tab.press("#token", "Enter");
  await textOf(tab, "#token-reason", "the token is not valid");

  say("a viewer looks on, and cannot move anything");
  await signIn(tab, "viewer");
  await isLive(tab);
  await textOf(tab, "#fleet-summary", `${given.count} units: ${given.count} standing`);
  await dropFile(tab, "targets.csv", targets());
  await textOf(tab, "#preview", "takes the role operator; you are viewer");
  assert.deepEqual(sent.filter((verb) => verb === "preview" || verb === "apply"), []);

  say("stop: one press, one request; pressing again sends it again");
  sent.length = 0;
  await tab.click("#stop");
  await textOf(tab, "#stop-state", "the daemon has it");
  await tab.keyboard.press("Shift+S");
  await tab.waitForFunction(() => window.focalfleetPage.stop.sent === 2);
  await textOf(tab, "#stop-state", "the daemon has it");
  assert.equal(sent.filter((verb) => verb === "stop").length, 2);

  say("stop works while the page asks for a token");
  await tab.click("#sign-in");
  await tab.click("#stop");
  await tab.waitForFunction(() => window.focalfleetPage.stop.sent === 3);
  await textOf(tab, "#stop-state", "the daemon has it");
  await tab.press("#token", "Escape");
  assert.ok(await tab.locator("#token-dialog").isHidden());

  say("an operator drops a file: preview, apply, progress, result");
  await signIn(tab, "operator");
  await dropFile(tab, "night-1.csv", targets());
  await textOf(tab, "#preview", "Preview of night-1.csv");
  await textOf(tab, "#preview", `of ${given.count} targets`);
  await textOf(tab, "#preview", /at most \d+ W; no limit is set/);
  await tab.screenshot({path: `${given.out}/preview.png`});
  assert.ok(!sent.includes("apply"), "a preview applies nothing");
  await tab.selectOption("#theme", "power");
  await tab.evaluate(() => {  // the motion is brief: what is seen of it is kept
    window.mostTurning = 0;
    setInterval(() => {
      const [, one, both] = [...document.querySelectorAll("#legend b")].map(({textContent}) =>
        Number(textContent));
      window.mostTurning = Math.max(window.mostTurning, one + both);
    }, 20);
  });
  await tab.click("#apply");
  await textOf(tab, "#configuration", /night-1.csv is under way/);
  await textOf(tab, "#progress-text", /planned end|behind its plan|staging|planning/);
  await tab.waitForFunction((moving) => {
    const {plate} = window.focalfleetPage;
    const u = plate.state.indexOf(moving);
    return u >= 0 && plate.ways.of(u) !== null;
  }, kMoving);
  await tab.screenshot({path: `${given.out}/moving.png`});
  await textOf(tab, "#configuration", /night-1.csv \(configuration 1\) is done/);
  assert.equal(await tab.locator("#stop-state").innerText(), "", "the stop before it is over");
  await textOf(tab, "#configuration", `${given.count} units arrived`);
  const arrived = await tab.evaluate(() => window.focalfleetPage.fleet.outcome.every((o) => o === 2));
  assert.ok(arrived, "each unit is at its target on the plate, too");
  assert.ok(await tab.evaluate(() => window.mostTurning) > 0, "the legend counts motors that turn");
  const still = await tab.evaluate(() => window.focalfleetPage.plate.counts[0]);
  assert.equal(still, given.count, "and to stand");
  await tab.selectOption("#theme", "state");

  say("a stop during motion");
  await world("targets 7");
  await dropFile(tab, "night-2.csv", targets());
  await armStop(tab);
  await tab.click("#apply");
  await textOf(tab, "#configuration",
    /night-2.csv .*is stopped\. Stopped by token operator-page, \d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC\./);
  await tab.screenshot({path: `${given.out}/stopped.png`});

  say("where the errors are");
  await tab.getByRole("button", {name: "Map of errors"}).click();
  assert.equal(await tab.locator("#theme").inputValue(), "error");
  await textOf(tab, "#legend", /[1-9]\d*above 100 µm/);
  await tab.screenshot({path: `${given.out}/errors.png`});
  await tab.selectOption("#theme", "state");

  say("a unit: arms, knowledge, neighbours, moves newest first, parameters, alarms");
  await tab.fill("#find-id", "7");
  await tab.press("#find-id", "Enter");
  await textOf(tab, "#unit tbody", /arrived/);
  const overEdge = await tab.locator("#unit").evaluate((card) => Math.max(...[...card.querySelectorAll(
    "table")].map((table) => table.getBoundingClientRect().right)) - card.getBoundingClientRect().right);
  assert.ok(overEdge <= 0, `the moves run over the card by ${overEdge} px`);
  assert.match(await tab.locator("#unit").innerText(), /theta[\s\S]*phi[\s\S]*node/);
  assert.ok(await tab.locator("#beside button").count() >= 2);
  await tab.click("#unit summary:has-text('Parameters')");
  await textOf(tab, "#unit", /repeat\s*\d+\s*default[\s\S]*Waves: \w+, at [\d.]+ V/);
  await tab.click("#unit summary:has-text('Alarms and changes')");
  await textOf(tab, "#unit", /serial \d+, enabled|None is known/);
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/unit.png`});

  say("what happened, newest first");
  await tab.click("#events summary");
  await textOf(tab, "#events-list", /UTC .*night-2.csv.*is stopped/);

  say("who commanded what: units, files and configurations are named");
  await world("disable 5");
  await tab.click("#commands summary");
  await textOf(tab, "#commands-list", /disable \(unit 5\) by uid \d+ /);
  await textOf(tab, "#commands-list", /apply \(night-2.csv, configuration 2\) by token operator-page/);
  await textOf(tab, "#commands-list", /stop \(configuration 2\) by token operator-page/);
  await tab.click("#commands-title");

  say("an alarm: the runbook's words, mute with a reason, acknowledge");
  await tab.click("#sound");
  await world("fault 9");
  const alarm = tab.locator("#alarms li", {hasText: "unit"}).first();
  await alarm.waitFor();
  assert.match(await tab.title(), /^\(\d+\) focalfleet$/);
  assert.equal(await tab.evaluate(() => window.focalfleetPage.alarms.sound.played), 2,
      "a tone when it was turned on, and one for the alarm");
  await alarm.locator("summary").click();
  await alarm.locator(".runbook li").first().waitFor();
  assert.match(await alarm.innerText(), /Do:/);
  await tab.screenshot({path: `${given.out}/alarm.png`});
  await alarm.getByRole("button", {name: "Mute"}).click();
  await textOf(tab, "#alarms", "Give a reason");
  assert.match(await alarm.innerText(), /Mute all \w+/, "all alarms of this kind");
  const open = await tab.locator("#alarms > li").count();
  const asked = tab.waitForRequest(/[/]api[/]alarms_ack$/);
  await alarm.getByRole("button", {name: "Acknowledge"}).click();
  await asked;
  await tab.waitForFunction((before) =>
    document.querySelectorAll("#alarms > li").length < before, open);

  say("the daemon ends: the page says so, keeps what it has, and comes back by a snapshot");
  const numberBefore = await tab.evaluate(() => window.focalfleetPage.fleet.number);
  await world("stop-daemon");
  await textOf(tab, "#link", "no link");
  await textOf(tab, "#stale", /Old: the plate as it was/);
  assert.ok(await tab.evaluate(() => window.focalfleetPage.plate.isStale));
  await tab.click("#stop");
  await textOf(tab, "#stop-state", "NOT STOPPED");
  await tab.screenshot({path: `${given.out}/stale.png`});
  await world("start-daemon");
  await isLive(tab);
  assert.ok(await tab.locator("#stale").isHidden());
  const numberAfter = await tab.evaluate(() => window.focalfleetPage.fleet.number);
  assert.ok(numberAfter < numberBefore, "the frames of the new daemon begin anew");

  say("a revoked token ends the stream");
  await world("revoke operator-page");
  await textOf(tab, "#link", "signed out");
  assert.deepEqual(tab.faults, []);
}

const kSizes = [["desktop", 1400, 900], ["tablet", 768, 1024], ["phone", 390, 844]];

/** The plate drawn at once, and then in four bands over an image that was something else. */
function pixelsThatBandsChange() {
  const {far} = window.focalfleetPage.plate;
  const {unitsOfBand} = far;
  far.unitsOfBand = 1;
  far.draw(far.wholeBand());
  const whole = far.raster.pixels.slice();
  far.raster.pixels.fill(0xFF00FF00);
  for (let k = 0; k < 4; ++k) far.draw(far.nextBand());
  far.unitsOfBand = unitsOfBand;
  return far.raster.pixels.reduce((sum, pixel, k) => sum + (pixel !== whole[k]), 0);
}

async function looks(browser) {
  for (const colorScheme of ["light", "dark"]) {
    for (const [name, width, height] of kSizes) {
      const tab = await openTab(browser, {viewport: {width, height}, colorScheme});
      await signIn(tab, "operator");
      await isLive(tab);
      await tab.waitForFunction(() => {
        const {plate} = window.focalfleetPage;
        return plate.times_ms.length > 0 && !plate.isStale && !plate.isDirty && plate.bandsDue === 0;
      });
      const colours = await coloursOf(tab);
      const [[background, empty]] = colours;
      const drawn = colours.reduce((sum, [, count]) => sum + count, 0) - empty;
      say(`${name} ${colorScheme}: ${drawn} pixels drawn on ${background.toString(16)}`);
      assert.ok(drawn > 5 * given.count, "each unit has pixels");
      assert.equal(await tab.evaluate(pixelsThatBandsChange), 0, "bands are the whole");
      const stop = await tab.locator("#stop").boundingBox();
      assert.ok(stop.height >= 56 && stop.width >= 56 && stop.x >= 0 &&
        stop.y + stop.height <= height, `stop is in view: ${JSON.stringify(stop)}`);
      assert.deepEqual(await axeFindings(tab), []);
      await tab.screenshot({path: `${given.out}/${name}-${colorScheme}.png`});
      await sheets(tab, `${name}-${colorScheme}`, name === "desktop" || colorScheme === "dark");
      if (name === "phone") await player(tab, colorScheme);
      if (name === "phone") await backToPlate(tab);
      if (name === "desktop") await closer(tab, colorScheme);
      assert.deepEqual(tab.faults, []);
      await tab.context().close();
    }
  }
}

/** Pictures of the other views, with stop in each of them. */
async function sheets(tab, name, withAxe) {
  for (const sheet of ["curves", "nights", "model", "diagnosis", "camera"]) {
    await tab.click(`#show-${sheet}`);
    await tab.locator(`#sheet-${sheet}`).waitFor();
    if (sheet === "curves") await tab.locator("#curves .chart canvas").first().waitFor();
    if (withAxe) assert.deepEqual(await axeFindings(tab), []);
    assert.ok(await tab.locator("#stop").isVisible());
    const wide = await tab.evaluate(() => document.documentElement.scrollWidth -
      document.documentElement.clientWidth);
    assert.ok(wide <= 0, `${sheet} is wider than the screen by ${wide} px`);
    await tab.screenshot({path: `${given.out}/${sheet}-${name}.png`});
  }
  await tab.click("#show-plate");
}

/** The plan of a preview on a small screen. */
async function player(tab, colorScheme) {
  await dropFile(tab, "targets.csv", targets());
  await tab.click("#play-preview");
  await textOf(tab, "#player-title", "nothing moves");
  await tab.locator("#plate").scrollIntoViewIfNeeded();
  await tab.evaluate(() => window.scrollTo(0, 0));
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/player-${colorScheme}.png`});
  await tab.click("#player-close");
}

/** From the end of a tall page the plate is one tap away, and stop is there all the time. */
async function backToPlate(tab) {
  await tab.evaluate(() => window.scrollTo(0, document.documentElement.scrollHeight));
  const inView = (selector) => tab.locator(selector).evaluate((element) => {
    const {top, bottom} = element.getBoundingClientRect();
    return top >= 0 && top < window.innerHeight / 2 || bottom <= window.innerHeight && top > 0;
  });
  assert.ok(await tab.evaluate(() => window.scrollY) > 300, "the page is tall");
  assert.ok(await inView("#stop"));
  assert.ok(await inView("#show-plate"));
  assert.ok(!await inView("#plate"));
  await tab.click("#show-plate");
  assert.ok(await inView("#plate"));
  assert.ok(await inView("#stop"));
}

/** Pictures of the near view, a preview, and other colours. */
async function closer(tab, colorScheme) {
  await tab.fill("#find-id", "2500");
  await tab.press("#find-id", "Enter");
  await textOf(tab, "#unit", "theta");
  const [bar_mm, drawn_mm] = await tab.evaluate(() => {
    const bar = document.querySelector("#scale");
    return [Number.parseFloat(bar.lastElementChild.textContent),
      bar.firstElementChild.getBoundingClientRect().width / window.focalfleetPage.plate.view.scale];
  });
  assert.ok(Math.abs(drawn_mm - bar_mm) < 0.01 * bar_mm, `a bar of ${drawn_mm} mm says ${bar_mm}`);
  await tab.screenshot({path: `${given.out}/near-${colorScheme}.png`});
  assert.deepEqual(await axeFindings(tab), []);
  await tab.keyboard.press("Escape");
  await tab.click("#zoom-all");
  await tab.selectOption("#theme", "bus");
  await dropFile(tab, "targets.csv", targets());
  await textOf(tab, "#preview", "Preview of targets.csv");
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/preview-${colorScheme}.png`});
}

const scenarios = {night, looks, past, study, tabs, tasks, calm, heap, plane};
await withBrowser((browser) => scenarios[given.scenario](browser));
say("done");
process.exit(0);
