// Scenarios of page_test.py about plans before they are applied, and configurations that are over.

import {readFileSync} from "node:fs";
import {armStop, assert, axeFindings, coloursOf, dropFile, given, isLive, openTab, signIn, textOf,
  untilAllStand, world} from "./browser.mjs";

const targets = () => readFileSync(given.targets, "utf8");
const say = (text) => process.stdout.write(`${text}\n`);

/** The fibres as the plate draws them. */
const fibres = (tab) => tab.evaluate(() => {
  const {fibre_x: x, fibre_y: y} = window.focalfleetPage.plate;
  return [...x].map((value, u) => [value, y[u]]);
});
const apart = (a, b) => Math.max(...a.map(([x, y], u) => Math.hypot(x - b[u][0], y - b[u][1])));

/** The film stands at a share of its time, 0 to 1. */
async function seek(tab, share) {
  await tab.locator("#player-time").evaluate((slider, value) => {
    slider.value = String(1000 * value);
    slider.dispatchEvent(new Event("input"));
  }, share);
}

async function apply(tab, name) {
  await dropFile(tab, name, targets());
  await tab.click("#apply");
}

async function openEarlier(tab) {
  if (!await tab.locator("#earlier").evaluate((details) => details.open))
    await tab.click("#earlier summary");
}

export async function past(browser) {
  const tab = await openTab(browser);
  await signIn(tab, "operator");
  await isLive(tab);
  await untilAllStand(tab);

  say("a preview in motion: the plan's rows on the plate, and nothing moves");
  const before = await fibres(tab);
  await dropFile(tab, "night-1.csv", targets());
  await tab.click("#play-preview");
  await textOf(tab, "#player-title", "Preview of night-1.csv, not live: nothing moves.");
  await seek(tab, 0);
  assert.ok(apart(before, await fibres(tab)) < 0.01, "it begins where the units stand");
  await seek(tab, 0.5);
  assert.ok(apart(before, await fibres(tab)) > 1, "units are on their way");
  await textOf(tab, "#legend", /[1-9]\d*moving/);
  await tab.selectOption("#theme", "power");
  await textOf(tab, "#legend", /[1-9]\d*one turns|[1-9]\d*both turn/);
  await tab.selectOption("#theme", "state");
  await tab.screenshot({path: `${given.out}/preview-motion.png`});
  await seek(tab, 1);
  const planned = await fibres(tab);
  assert.deepEqual(await tab.evaluate(() => [...window.focalfleetPage.fleet.phase]
    .filter((phase) => phase !== 3)), [], "all units stand meanwhile");
  await tab.click("#player-close");
  assert.ok(apart(before, await fibres(tab)) < 1e-9, "the live fleet is back");

  say("applied, the units end where the preview ended");
  await tab.click("#apply");
  await textOf(tab, "#configuration", /night-1.csv \(configuration 1\) is done/);
  await tab.waitForFunction(() => window.focalfleetPage.plate.turning.size === 0);
  assert.ok(apart(planned, await fibres(tab)) < 0.05, "preview and result are the same");

  say("a second one is stopped on its way");
  await world("targets 7");
  await armStop(tab);
  await apply(tab, "night-2.csv");
  await textOf(tab, "#configuration", /night-2.csv \(configuration 2\) is stopped/);
  await untilAllStand(tab);  // all have said where they stand
  await tab.waitForFunction(() => window.focalfleetPage.plate.turning.size === 0);
  const stoppedAt = await fibres(tab);
  await textOf(tab, "#configuration", /\d+ stopped[\s\S]*Stopped/);
  assert.doesNotMatch(await tab.locator("#configuration").innerText(), /Not served/);

  say("replay by the plan's rows");
  await openEarlier(tab);
  await tab.getByRole("button", {name: "Replay configuration 1"}).click();
  await textOf(tab, "#player-title", "Replay of configuration 1, not live.");
  assert.equal(await tab.locator("#player-note").innerText(), "By the rows of its plan.");
  await textOf(tab, "#replay-trouble", `Moves: ${given.count} arrived.`);
  await seek(tab, 0);
  assert.ok(apart(before, await fibres(tab)) < 0.01, "it begins where the units stood");
  await seek(tab, 1);
  assert.ok(apart(planned, await fibres(tab)) < 0.05, "and ends where they arrived");
  await tab.fill("#find-id", "7");
  await tab.press("#find-id", "Enter");
  await textOf(tab, "#player-unit", /Unit 7: arrived .* after it was applied/);
  assert.deepEqual(await axeFindings(tab), []);

  say("a replay plays, pauses and goes back by the keyboard");
  await tab.focus("#player-time");
  await tab.keyboard.press("Home");
  const atBegin = await tab.locator("#player-at").innerText();
  assert.match(atBegin, /^0\.0 of/);
  await tab.click("#player-play");
  await tab.waitForFunction(() => window.focalfleetPage.player.film.t_s >
    window.focalfleetPage.player.film.begin_s + 0.2);
  await tab.click("#player-play");
  const paused = await tab.evaluate(() => window.focalfleetPage.player.film.t_s);
  await tab.evaluate(() => new Promise((resolve) => { requestAnimationFrame(() =>
    requestAnimationFrame(resolve)); }));
  assert.equal(await tab.evaluate(() => window.focalfleetPage.player.film.t_s), paused);

  say("what was stopped goes evenly, and the page says so");
  await tab.getByRole("button", {name: "Replay configuration 2"}).click();
  await textOf(tab, "#player-title", "configuration 2");
  await textOf(tab, "#player-unit", /Unit 7: (stopped|arrived) .* after it was applied/);  // still selected
  await textOf(tab, "#unit-film", /In the replay\s*Unit 7: (stopped|arrived)[\s\S]*Live now/);
  await textOf(tab, "#player-note", /even motion from beginning to end|Even motion between/);
  await seek(tab, 1);
  assert.ok(apart(stoppedAt, await fibres(tab)) < 0.05, "it ends where the units were stopped");
  await textOf(tab, "#replay-trouble", /\d+ stopped/);
  await textOf(tab, "#legend", /ready0moving/);
  await tab.screenshot({path: `${given.out}/replay.png`});

  say("stop works meanwhile, and live is back at a press");
  await tab.click("#stop");
  await textOf(tab, "#stop-state", "the daemon has it");
  await tab.click("#player-close");
  assert.ok(await tab.locator("#player").isHidden());
  assert.equal(await tab.locator("#unit-film").innerText(), "");

  say("a new daemon still has the rows of the plan");
  await world("stop-daemon");
  await world("start-daemon");
  await isLive(tab);
  await openEarlier(tab);
  await tab.getByRole("button", {name: "Replay configuration 1"}).click();
  await textOf(tab, "#player-note", "By the rows of its plan.");
  await seek(tab, 0);
  assert.ok(apart(before, await fibres(tab)) < 0.05);
  await seek(tab, 1);
  assert.ok(apart(planned, await fibres(tab)) < 0.05);
  await tab.click("#player-close");

  say("who stopped, and by which door");
  await tab.click("#commands summary");
  await textOf(tab, "#commands-list", /stop (\(configuration \d+\) )?by token operator-page \(operator, http\)/);
  const times = await tab.locator("#commands-list .event .hint").allInnerTexts();
  assert.ok(times.every((time) => time.trim().endsWith(" UTC")), times.join());
  assert.deepEqual(times, times.toSorted().reverse(), "the newest command first");

  say("nights side by side");
  await tab.click("#show-nights");
  await tab.locator("#nights-table tbody td").first().waitFor();
  const cells = await tab.locator("#nights-table tbody tr").first().locator("td").allInnerTexts();
  assert.deepEqual(cells.slice(0, 3), ["2", "1", String(2 * given.count)]);
  assert.match(cells[4], /^[1-9]\d*$/, "units that were stopped");
  assert.equal(cells[5], "0", "and none that was not served");

  say("the table goes on while it is open; a disabled unit is in its replay, and marked");
  await world("disable 5");
  await world("targets 9");
  await apply(tab, "night-3.csv");
  await textOf(tab, "#nights-table tbody tr:first-child td:nth-child(2)", /^3$/);
  await textOf(tab, "#configuration", /night-3.csv \(configuration 3\) is done/);
  await tab.getByRole("button", {name: "Replay configuration 3"}).click();
  await textOf(tab, "#player-note", "1 unit took no part, disabled now: shown as now.");
  await seek(tab, 1);
  const disabled = await tab.evaluate(() => {
    const {plate, fleet} = window.focalfleetPage;
    const u = fleet.placeOf.get(5);
    return [plate.state[u], plate.fibre_x[u]];
  });
  assert.equal(disabled[0], 8, "colours.js, State");
  assert.ok(Number.isFinite(disabled[1]), "its arm is drawn");
  await textOf(tab, "#legend", /1disabled/);
  await textOf(tab, "#legend-of", "Counts of the replay, not of the live fleet.");
  await tab.screenshot({path: `${given.out}/replay-disabled.png`});
  await tab.click("#player-close");
  assert.deepEqual(tab.faults, []);
  await tab.context().close();
}

const askStream = () => fetch(`${given.url}/stream`, {headers:
  {Authorization: `Bearer ${given.tokens.viewer}`}});

/** Whether the daemon serves one stream more: its status. */
async function streams() {
  const answer = await askStream();
  await answer.body.cancel();
  return answer.status;
}

/** A stream of somebody else, who looks on until it is cancelled. A place that was left is free at the daemon's next sign of life. */
async function hold() {
  const end = Date.now() + 30_000;
  for (;;) {
    const answer = await askStream();
    if (answer.status === 200) return answer.body;
    await answer.body.cancel();
    assert.ok(Date.now() < end, `no place becomes free: ${answer.status}`);
    await new Promise((resolve) => { setTimeout(resolve, 200); });
  }
}

export async function tabs(browser) {
  say("a second tab of the same token shares the stream of the first");
  const first = await openTab(browser);
  await signIn(first, "viewer");
  await isLive(first);
  const open = async (role) => {
    const tab = await first.context().newPage();
    tab.setDefaultTimeout(60_000);
    tab.streams = 0;
    tab.on("request", (request) => {
      if (new URL(request.url()).pathname === "/stream") ++tab.streams;
    });
    await tab.goto(given.url);
    await signIn(tab, role);
    await isLive(tab);
    return tab;
  };
  const second = await open("viewer");
  const third = await open("viewer");
  assert.deepEqual([second.streams, third.streams], [0, 0]);
  await untilAllStand(third);
  const same = (tab) => tab.evaluate(() => [...window.focalfleetPage.fleet.theta]);
  assert.deepEqual(await same(second), await same(first), "it has the same fleet");
  assert.equal(await streams(), 200, "of two places one is free");

  say("a tab with another token has its own");
  const operator = await open("operator");
  assert.equal(operator.streams, 1);

  say("where all places are taken, the page says so, and begins when one is free");
  const held = await hold();
  const late = await openTab(browser);
  await signIn(late, "engineer");
  await textOf(late, "#link", "full");
  await textOf(late, "#stale", /all 3 places for viewers are taken/);
  await held.cancel();
  await isLive(late);
  assert.deepEqual(late.faults, []);
  await late.context().close();

  say("what moves is seen in all of them");
  await operator.bringToFront();
  await dropFile(operator, "night-1.csv", targets());
  await operator.click("#apply");
  await textOf(second, "#configuration", /night-1.csv \(configuration 1\) is done/);
  assert.ok(await third.evaluate(() => window.focalfleetPage.fleet.outcome.every((o) => o === 2)));

  say("the tab that reads is closed: another takes over");
  await first.close();
  await second.waitForFunction(() => window.focalfleetPage.stream.leads ||
    window.focalfleetPage.linkState === "live");
  await third.waitForFunction((number) => window.focalfleetPage.fleet.number !== number,
      await third.evaluate(() => window.focalfleetPage.fleet.number));
  await isLive(third);
  assert.equal(second.streams + third.streams, 1);

  say("a revoked token ends all tabs that show it, and no other");
  await world("revoke viewer-page");
  await textOf(second, "#link", "signed out");
  await textOf(third, "#link", "signed out");
  await isLive(operator);
}

export async function study(browser) {
  const tab = await openTab(browser);
  await signIn(tab, "operator");
  await isLive(tab);

  say("a measured configuration: errors of its exposures as a curve, residuals, who was not found");
  await dropFile(tab, "night-1.csv", targets());
  await tab.selectOption("select[aria-label='Corrections by the camera']", "1");
  await tab.click("#apply");
  await textOf(tab, "#configuration", /night-1.csv \(configuration 1\) is done/);
  await tab.click("#show-curves");
  await tab.locator("#curves .chart canvas").nth(3).waitFor();
  await textOf(tab, "#curves", /Power of configuration 1, by its plan/);
  const exposures = await tab.evaluate(() => window.focalfleetPage.curves.data.exposures);
  assert.equal(exposures.exposure.length, 2, "blind, and after the correction");
  assert.ok(exposures.median_um[1] < exposures.median_um[0]);
  const {power} = await tab.evaluate(() => window.focalfleetPage.curves.data);
  assert.ok(Math.max(...power.total_W) > 0);
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/curves.png`});

  say("what a unit's moves came to, by its exposures");
  await tab.click("#show-plate");
  await tab.fill("#find-id", "7");
  await tab.press("#find-id", "Enter");
  await tab.locator("#unit tbody tr").first().waitFor();
  const [offBy] = await tab.locator("#unit tbody tr td:last-child").allInnerTexts();
  assert.match(offBy, /^[\d.]+ µm$/, "the newest move");
  await tab.screenshot({path: `${given.out}/unit-measured.png`});
  await tab.click("#show-curves");

  say("a fresh tab has the same night at once");
  const fresh = await openTab(browser);
  await signIn(fresh, "viewer");
  await isLive(fresh);
  await fresh.click("#show-curves");
  await fresh.locator("#curves .chart canvas").nth(3).waitFor();
  assert.deepEqual(await fresh.evaluate(() => window.focalfleetPage.curves.data.exposures.exposure),
      exposures.exposure);
  await fresh.context().close();

  await tab.click("#show-camera");
  await textOf(tab, "#camera", /Exposure \d+, .* configuration 1/);
  const arrows = await tab.locator("#residuals").evaluate((canvas) => {
    const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size;
  });
  assert.ok(arrows > 2, "arrows are drawn");
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/camera.png`});

  say("a viewer may not have a campaign diagnosed");
  const chooseCampaign = (page) => page.setInputFiles("#campaign-files",
      [`${given.campaign}/moves.csv`, `${given.campaign}/units.csv`]);
  const viewer = await openTab(browser);
  await signIn(viewer, "viewer");
  await viewer.click("#show-diagnosis");
  await textOf(viewer, "#diagnosis", "There was none yet.");
  assert.ok(await viewer.locator("#choose-campaign").isDisabled());
  await chooseCampaign(viewer);
  await textOf(viewer, "#diagnosis-trouble", /Not begun: .*may not diagnose|Not begun: .*role operator/);
  await viewer.context().close();

  say("a campaign is diagnosed; one at a time; it can be cancelled");
  await tab.click("#show-diagnosis");
  await chooseCampaign(tab);
  await textOf(tab, "#diagnosis", /runs since/);
  await chooseCampaign(tab);
  await textOf(tab, "#diagnosis-trouble", /Not begun: the diagnosis of .* runs; cancel it first/);
  await tab.click("#cancel-diagnosis");
  await textOf(tab, "#diagnosis", "it was cancelled");

  say("the report: a verdict as a sentence, causes, gain, pictures");
  await chooseCampaign(tab);
  await textOf(tab, "#diagnosis-report .lead", /All units end 0\.1 deg late whenever they reverse: backlash/);
  await textOf(tab, "#diagnosis-report .lead", /Nothing else is wrong\. With it in the model/);
  await textOf(tab, "#diagnosis-report .card h3", /^backlash of theta/);
  const pictures = await tab.locator("#diagnosis-report svg.plot").evaluateAll((all) =>
    all.map((one) => [one.getAttribute("aria-label"), one.getBoundingClientRect().height]));
  for (const wanted of [/^rms of each unit before/, /^move \d+ before/, /^theta against theta step/,
    /^periods a turn of theta/])
    assert.ok(pictures.some(([label, height]) => wanted.test(label) && height > 100), `${wanted}: ${pictures}`);
  assert.ok(await tab.getByRole("button", {name: "Load the model"}).isDisabled(), "an engineer may");
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/diagnosis.png`});
  const [download] = await Promise.all([tab.waitForEvent("download"),
    tab.getByRole("button", {name: "Keep the report"}).click()]);
  assert.match(readFileSync(await download.path(), "utf8"), /<!DOCTYPE html>/i);

  say("what the daemon measured itself is diagnosed, too");
  await textOf(tab, "#recordings", /Night of \d{4}-\d\d-\d\d: 1 configuration from 1 on/);
  await tab.click("#diagnose-recording");
  await textOf(tab, "#diagnosis", /Night of .* by token operator-page/);
  await textOf(tab, "#diagnosis-report .lead", /These data are not enough for a verdict/);
  await chooseCampaign(tab);
  await textOf(tab, "#diagnosis-report .card h3", /^backlash of theta/);

  say("an engineer loads the model, and rolls back");
  await signIn(tab, "engineer");
  await tab.click("#show-diagnosis");
  await tab.getByRole("button", {name: "Load the model"}).click();
  await textOf(tab, "#model", /is in force since/);
  await textOf(tab, "#model", /predicted[\s\S]*rms, by campaign/);
  await textOf(tab, "#model", /achieved[\s\S]*before [\d.]+ µm \(1 configuration\), since no exposure known/);
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/model.png`});
  await tab.getByRole("button", {name: "Roll back"}).click();
  await tab.getByRole("button", {name: "Yes"}).click();
  await textOf(tab, "#model", "No model is in force");
  assert.deepEqual(tab.faults, []);
}
