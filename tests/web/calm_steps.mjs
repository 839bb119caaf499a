// The page while data arrive: buttons stay where an operator aims at them, alarms name their faults,
// and nothing that begins in a muted kind goes unseen.

import {readFileSync} from "node:fs";
import {assert, axeFindings, dropFile, given, isLive, openTab, signIn, textOf, untilAllStand, world}
  from "./browser.mjs";

const targets = () => readFileSync(given.targets, "utf8");
const say = (text) => process.stdout.write(`${text}\n`);

const kFrames_ms = 2500;  // a frame that has the newest alarm comes each second

const kButtons = ["#stop", "#sound", "#choose-file", "#find-id", "#worst", "#theme", "#show-plate",
  "#sign-in"];

/** Where elements are on the screen, by their selectors. */
async function placesOf(tab, selectors) {
  const places = {};
  for (const selector of selectors) {
    const {x, y} = await tab.locator(selector).first().boundingBox();
    places[selector] = [Math.round(x), Math.round(y)];
  }
  return places;
}

const alarmOf = (tab, text) => tab.locator("#alarms > li", {hasText: text}).first();

async function alarms(tab) {
  say("an alarm names the fault, and moves no button");
  const before = await placesOf(tab, kButtons);
  await world("fault 9");
  await textOf(tab, "#alarms > li:first-child", /unit 9 (is in fault: |reports fault )over_temperature/);
  assert.deepEqual(await placesOf(tab, kButtons), before, "an alarm came");

  await runbook(tab);

  say("the runbook's commands have the number of the unit");
  const fault = alarmOf(tab, "UnitFault");
  await fault.locator("summary").click();
  await fault.locator(".runbook li").first().waitFor();
  assert.match(await fault.innerText(), /focalfleet unit 9[\s\S]*focalfleet enable 9/);
  assert.doesNotMatch(await fault.innerText(), /\bUNIT\b/);

  say("where a button has the focus, its entry stays in its place");
  await tab.locator("#legend-title").click();
  const focused = ["#alarms [aria-label='Acknowledge UnitFault']"];
  await tab.locator(focused[0]).focus();
  const focusedAt = await placesOf(tab, focused);
  await world("silence 18");
  await alarmOf(tab, "UnitSilent").waitFor();
  assert.deepEqual(await placesOf(tab, focused), focusedAt, "an alarm came");
  assert.ok(await tab.locator(focused[0]).evaluate((button) => button === document.activeElement));
  await tab.locator("#legend-title").click();
  await tab.locator(focused[0]).blur();
  await textOf(tab, "#alarms > li:first-child", /UnitSilent/);

  say("where somebody points, entries and their buttons stay while alarms come");
  const aimed = ["#alarms .acknowledge", "#alarms button:has-text('Mute all UnitFault')"];
  await fault.getByLabel("Reason to mute").fill("half a rea");
  await tab.hover(aimed[1]);
  const places = await placesOf(tab, aimed);
  await world("fault 12");
  await textOf(tab, "#alarms", /unit 12 /);
  await textOf(tab, "#alarms", /Commands name unit 12, the newest; they go for each of 9, 12\./);
  await world("silence 15");
  await textOf(tab, "#alarms", /unit 15 /);
  assert.deepEqual(await placesOf(tab, aimed), places, "two more alarms came");
  assert.equal(await fault.getByLabel("Reason to mute").inputValue(), "half a rea");
  await tab.screenshot({path: `${given.out}/alarms-held.png`});
  await tab.locator("#legend-title").click();
  await textOf(tab, "#alarms > li:first-child", /UnitSilent/);
  await alarmOf(tab, "UnitFault").locator("summary").click();
  assert.deepEqual(await axeFindings(tab), []);
}

async function mutes(tab) {
  say("muted until dawn: the time is given once, in 24 hours of UTC");
  const fault = alarmOf(tab, "UnitFault");
  await fault.locator("summary").click();
  await fault.getByLabel("How long it is muted").selectOption("dawn");
  await fault.getByLabel("Reason to mute").fill("waits for the day crew");
  await fault.getByRole("button", {name: "Mute"}).click();
  await textOf(tab, "#alarms", "When is dawn, UTC");
  await fault.getByLabel("Muted until, UTC").fill("17:61");
  await fault.getByRole("button", {name: "Mute"}).click();
  await textOf(tab, "#alarms", "When is dawn, UTC");
  await fault.getByLabel("Muted until, UTC").fill("1730");
  await fault.getByRole("button", {name: "Mute"}).click();
  await textOf(tab, "#mutes", /UnitFault is muted until \S+ 17:30:\d\d UTC .*\(2 alarms\)/);
  const silent = alarmOf(tab, "UnitSilent");
  await silent.locator("summary").click();
  await silent.getByLabel("How long it is muted").selectOption("dawn");
  assert.equal(await silent.getByLabel("Muted until, UTC").inputValue(), "17:30");
  await silent.locator("summary").click();

  say("what begins in a muted kind is seen, and moves no button");
  const before = await placesOf(tab, kButtons);
  await world("fault 20-29");
  await textOf(tab, "#alarms-summary", /12 muted \(10 since\)/);
  await textOf(tab, "#mutes", /10 since: units 20, 21, 22, 23, 24, 25 and 4 more/);
  await textOf(tab, "#alarms > li:not(.quiet)", /UnitFault \(since it was muted\)/);
  assert.deepEqual(await placesOf(tab, kButtons), before);
  await tab.screenshot({path: `${given.out}/mutes.png`});
}

/** An alarm that comes while the daemon is asked for the list is in the list soon after. */
async function late(tab) {
  say("an alarm that comes while the list is asked for");
  const asked = [];
  await tab.route("**/api/alarms", async (route) => {
    const response = await route.fetch();
    await new Promise((resolve) => asked.push(resolve));
    await route.fulfill({response});
  }, {times: 1});
  // A hidden page does not ask from time to time.
  await tab.evaluate(() => Object.defineProperty(document, "hidden", {get: () => true, configurable: true}));
  await world("silence 33");
  while (asked.length === 0) await tab.waitForTimeout(50);
  await world("silence 34");
  const isKnown = () => tab.evaluate(async () => (await window.focalfleetPage.api.ask("alarms"))
    .alarms.some(({unit_id: unit}) => unit === 34));
  while (!await isKnown()) await tab.waitForTimeout(100);
  await tab.waitForTimeout(kFrames_ms);
  await tab.evaluate(() => { window.focalfleetPage.alarms.note = () => {}; });  // no further news
  asked[0]();
  await textOf(tab, "#alarms", /unit 34 /);
  await tab.evaluate(() => {
    delete document.hidden;
    delete window.focalfleetPage.alarms.note;
  });
}

/** One of the alarms of an entry ends between the look and the press: the other is acknowledged. */
async function acknowledged(tab) {
  say("an alarm of an entry has ended when it is acknowledged");
  const count = await tab.evaluate(async () => {
    const {api, alarms: list} = window.focalfleetPage;
    const before = await api.ask("alarms");
    const ids = before.alarms.filter(({name, state}) => name === "UnitSilent" && state === "open")
      .map(({id}) => id);
    await api.ask("alarms_ack", {ids: ids.slice(0, 1)});
    const {ask} = api;
    api.ask = () => {  // the first look at the list was before that
      api.ask = ask;
      return Promise.resolve(before);
    };
    await list.acknowledge(ids);
    return ids.length;
  });
  assert.ok(count > 1);
  await textOf(tab, "#alarms-summary",
    new RegExp(`${count - 1} alarms? acknowledged; 1 had ended meanwhile`));
  assert.equal(await alarmOf(tab, "UnitSilent").count(), 0, "those that stood are acknowledged");
}

/** A line that was unfolded and an older page stay while something happens. */
async function happened(tab) {
  say("a new alarm closes no line of what happened, and takes no older page");
  if (!await tab.locator("#events").evaluate((details) => details.open)) await tab.click("#events summary");
  await tab.evaluate(() => {  // pages of four lines
    const {events} = window.focalfleetPage;
    events.begin();
    events.runs_max = 4;
    events.refresh();
  });
  await tab.waitForFunction(() => document.querySelectorAll("#events-list > :not(.more)").length === 4);
  await tab.click("#events-list > .more");
  await tab.waitForFunction(() => document.querySelectorAll("#events-list > :not(.more)").length > 4);
  const run = tab.locator("#events-list details.run").first();
  await run.waitFor();
  await run.evaluate((details) => { details.open = true; });
  const oldest = await tab.locator("#events-list > :not(.more)").last().innerText();
  await world("silence 51");
  await textOf(tab, "#events-list", /unit 51 /);
  assert.equal(await tab.locator("#events-list details.run[open]").count(), 1, "the line is still unfolded");
  assert.equal(await tab.locator("#events-list > :not(.more)").last().innerText(), oldest);
  await tab.click("#events-title");
}

/** The first answer to a question, without configurations, comes after the second one's. */
function lateAnswer(tab, list) {
  return tab.evaluate(async (name) => {
    const {api, [name]: shown} = window.focalfleetPage;
    const look = () => name === "nights" ? shown.show() : shown.page(null);
    const {ask} = api;
    let answer = null;
    api.ask = () => {
      api.ask = ask;
      return new Promise((resolve) => { answer = resolve; });
    };
    const first = look();
    await look();
    answer({configurations: []});
    await first;
  }, list);
}

async function answers(tab) {
  say("a late answer replaces no newer one");
  await tab.click("#show-nights");
  await textOf(tab, "#nights-table", /night of/);
  await lateAnswer(tab, "nights");
  assert.match(await tab.locator("#nights-table").innerText(), /night of/);
  await tab.click("#show-plate");
  await tab.click("#earlier summary");
  await textOf(tab, "#earlier-list", "night-1.csv");
  await lateAnswer(tab, "earlier");
  assert.match(await tab.locator("#earlier-list").innerText(), /night-1.csv/);
  await tab.click("#earlier-title");
}

async function runbook(tab) {
  say("a runbook that did not come is asked for again");
  await tab.route("**/page/runbook.md", (route) => route.fulfill({status: 503, body: "busy"}), {times: 1});
  const fault = alarmOf(tab, "UnitFault");
  await fault.locator("summary").click();
  await textOf(tab, "#alarms", "The runbook did not come");
  await fault.locator("summary").click();
  await fault.locator("summary").click();
  await fault.locator(".runbook li").first().waitFor();
  await fault.locator("summary").click();
}

async function pages(tab) {
  say("an older page of a list has nothing of the newer one");
  const ns = [1795917759008221125n, 1795917759008221183n, 1795917759008221313n, 1795917759008221440n];
  const asked = await tab.evaluate(async (times) => {
    const {justBefore} = await import("/page/api.js");
    return times.map((time) => JSON.stringify(justBefore(JSON.parse(time))));
  }, ns.map(String));
  for (const [k, time] of ns.entries())
    assert.ok(BigInt(asked[k]) <= time && time - BigInt(asked[k]) < 1000n, `${time} became ${asked[k]}`);
}

export async function calm(browser) {
  const tab = await openTab(browser);
  await signIn(tab, "operator");
  await isLive(tab);
  await untilAllStand(tab);

  say("what happened: many units that did the same are one line");
  await tab.click("#events summary");
  await textOf(tab, "#events-list",
    new RegExp(`UTC unit \\d+: serial \\d+, enabled\\s*and ${given.count - 1} more like it`));
  assert.ok(await tab.locator("#events-list > *").count() < 20);
  await tab.click("#events-title");
  await tab.locator("aside").evaluate((aside) => aside.scrollTo(0, 0));

  say("no unit has a target: Worst says so, and selects none");
  await tab.click("#worst");
  await textOf(tab, "#find-trouble", "No unit has a target.");

  say("a preview: its buttons come first, its targets are on the plate before it is played");
  const before = await placesOf(tab, ["#stop", "#sound", "#choose-file"]);
  await dropFile(tab, "night-1.csv", targets());
  await tab.locator("#apply").waitFor();
  const shown = await placesOf(tab, ["#apply", "#play-preview"]);
  await textOf(tab, "#preview", /no limit is set/);
  await textOf(tab, "#preview", /Corrections/);
  await tab.waitForFunction(() => window.focalfleetPage.plate.targets !== null);
  const [x, y] = await tab.evaluate(() => window.focalfleetPage.plate.targetOf(
    window.focalfleetPage.plate.targets.keys().next().value));
  assert.ok(Number.isFinite(x) && Number.isFinite(y), `a target at ${x}, ${y}`);
  assert.deepEqual(await placesOf(tab, ["#apply", "#play-preview"]), shown);
  assert.deepEqual(await placesOf(tab, ["#stop", "#sound", "#choose-file"]), before);

  say("a configuration and its result move no button");
  await tab.click("#apply");
  await tab.waitForFunction(() => document.getElementById("preview").childElementCount === 0);
  const idle = await placesOf(tab, kButtons);
  await textOf(tab, "#configuration", /is under way/);
  assert.equal(await tab.locator("#configuration").getAttribute("aria-live"), "off");
  assert.deepEqual(await placesOf(tab, kButtons), idle, "it is under way");
  await textOf(tab, "#configuration", /night-1.csv \(configuration 1\) is done/);
  assert.equal(await tab.locator("#configuration").getAttribute("aria-live"), "polite");
  assert.deepEqual(await placesOf(tab, kButtons), idle, "its result is there");

  say("all arrived and nothing measured: Worst says so");
  await tab.click("#worst");
  await textOf(tab, "#find-trouble", `All ${given.count} units arrived; errors not measured.`);
  assert.equal(await tab.locator("#unit").innerText(), "");

  await alarms(tab);
  await mutes(tab);
  await late(tab);
  await acknowledged(tab);
  await happened(tab);
  await answers(tab);
  await pages(tab);

  say("header and legend count the same");
  const words = (await tab.locator("#fleet-summary").innerText()).split(": ")[1].split(", ");
  const legend = (await tab.locator("#legend li:not(.empty)").allInnerTexts())
    .map((text) => text.replace(/\s+/g, " ").trim().split(":")[0]);
  assert.deepEqual(words, legend.toReversed(), "troubles first");

  say("more units than a list has room for are counted");
  await world("targets 7");
  await dropFile(tab, "night-2.csv", targets());
  await textOf(tab, "#preview", /17 targets not served[\s\S]*and 9 more units/);
  await tab.screenshot({path: `${given.out}/preview-unserved.png`});
  assert.deepEqual(await axeFindings(tab), []);

  say("a preview is out of date once another configuration begins");
  const ofPreview = () => tab.evaluate(() => {
    const {targets: shown, marked} = window.focalfleetPage.plate;
    return [shown !== null, marked.length > 0];
  });
  await tab.waitForFunction(() => window.focalfleetPage.plate.targets !== null);
  await world("apply");
  await textOf(tab, "#apply-trouble", "Another configuration has begun since");
  assert.ok(await tab.locator("#play-preview").isDisabled());
  assert.deepEqual(await ofPreview(), [false, true]);
  await textOf(tab, "#configuration", /configuration 2\) is done/);

  say("a file that is refused leaves nothing of the one before on the plate");
  await world("targets 9");
  await dropFile(tab, "night-3.csv", targets());
  await tab.waitForFunction(() => window.focalfleetPage.plate.targets !== null);
  await dropFile(tab, "notes.csv", "no targets");
  await tab.locator("#preview .trouble[role=alert]").waitFor();
  assert.deepEqual(await ofPreview(), [false, false]);

  say("what a stop says does not move it, on a wide and a tall screen");
  await world("stop-daemon");
  await textOf(tab, "#link", "no link");
  for (const [width, height] of [[1400, 900], [768, 1024], [390, 844]]) {
    await tab.setViewportSize({width, height});
    await tab.evaluate(() => document.getElementById("stop-state").replaceChildren());
    const {"#stop": at} = await placesOf(tab, ["#stop"]);
    await tab.click("#stop");
    await textOf(tab, "#stop-state", /NOT STOPPED: .* At the host: focalfleet stop --direct/);
    assert.deepEqual(await placesOf(tab, ["#stop"]), {"#stop": at}, `${width} px wide`);
    await tab.screenshot({path: `${given.out}/not-stopped-${width}.png`});
  }
  assert.deepEqual(tab.faults, []);
}
