// A browser with the page in it, and what every scenario needs of it.

import {createRequire} from "node:module";
import {createInterface} from "node:readline";
import assert from "node:assert/strict";

const given = JSON.parse(process.argv[2]);
const require = createRequire(`${given.nodeFolder}/`);
const {chromium} = require("playwright-core");
const kPatience_ms = 60_000;  // limit for a hang; nothing is timed
const kLoads = 5;
const kReady = 3;             // frames.js, kPhases
export const kMoving = 3;     // colours.js, State
const kBegun_ms = 300;        // the start comes 0.25 s of the fleet's time after the signal

const answers = createInterface({input: process.stdin})[Symbol.asyncIterator]();

/** The test's world does something (page_test.py). */
export async function world(what) {
  process.stdout.write(`@${what}\n`);
  const {value} = await answers.next();
  assert.equal(value, "done");
}

export async function withBrowser(use) {
  const browser = await chromium.launch({executablePath: "/usr/bin/chromium",
    args: ["--disable-gpu", "--no-sandbox"]});
  try {
    return await use(browser);
  } finally {
    await browser.close();
  }
}

/** A tab; faults of its scripts, what its policy forbids, and other hosts fail the test. */
export async function openTab(browser, options = {}) {
  const context = await browser.newContext({viewport: {width: 1400, height: 900}, ...options});
  const tab = await context.newPage();
  tab.setDefaultTimeout(kPatience_ms);
  tab.faults = [];
  tab.losses = [];  // files and answers that did not come
  tab.on("requestfailed", (request) => tab.losses.push(`${request.url()}: ` +
      request.failure()?.errorText));
  tab.on("pageerror", (error) => tab.faults.push(String(error)));
  tab.on("console", (message) => {
    // A refusal is an answer, and a broken link is the point of a scenario.
    const expected = /Failed to load resource|ERR_(CONNECTION|INCOMPLETE|EMPTY)/;
    if (message.type() === "error" && !expected.test(message.text()))
      tab.faults.push(message.text());
  });
  tab.on("request", (request) => {
    if (!/^(blob|data):/.test(request.url()) && !request.url().startsWith(`${given.url}/`))
      tab.faults.push(`it asks another host: ${request.url()}`);
  });
  await tab.goto(given.url);
  // The daemon ends a connection that is silent for 1 s: on a busy machine the browser may be late,
  // and a person loads the page again.
  for (let k = 0; k < kLoads && tab.losses.length > 0; ++k) {
    tab.losses = [];
    await tab.reload();
  }
  return tab;
}

export async function signIn(tab, role) {
  // The page asks by itself once it knows that the daemon wants a token.
  try {
    await tab.waitForFunction(() => document.getElementById("token-dialog").open ||
        (window.focalfleetPage && window.focalfleetPage.linkState !== "waiting"));
  } catch {
    assert.fail(`the page does not begin; ${tab.faults.join("; ")}; ${tab.losses.join("; ")}`);
  }
  if (!await tab.locator("#token-dialog").isVisible()) await tab.click("#sign-in");
  await tab.fill("#token", given.tokens[role]);
  await tab.click("#token-form button[type=submit]");
  await tab.locator("#role", {hasText: role}).waitFor();
}

export async function isLive(tab) {
  await tab.locator("#link", {hasText: /^live$/}).waitFor();
}

export async function textOf(tab, selector, pattern) {
  const found = tab.locator(selector, {hasText: pattern});
  try {
    await found.waitFor();
  } catch {
    const there = await tab.locator(selector).allInnerTexts();
    assert.fail(`${selector} does not say ${pattern}, but: ${there.join(" | ")}`);
  }
  return found.innerText();
}

/** All units are heard, and none is on its way. */
export async function untilAllStand(tab) {
  await tab.waitForFunction((ready) => window.focalfleetPage.fleet.phase.every((phase) =>
    phase === ready), kReady);
}

/** Units have begun to move. */
export async function untilTheyMove(tab) {
  await textOf(tab, "#fleet-summary", /moving/);
  await tab.waitForFunction(() => window.focalfleetPage.plate.turning.size > 20);
  await tab.waitForTimeout(kBegun_ms);
}

/** The page itself presses stop once units move: on a busy machine a step from here is late. */
export async function armStop(tab) {
  await tab.evaluate(([moving, begun_ms]) => {
    const {plate} = window.focalfleetPage;
    const watch = setInterval(() => {
      if (!plate.state.includes(moving) || plate.turning.size <= 20) return;
      clearInterval(watch);
      setTimeout(() => document.getElementById("stop").click(), begun_ms);
    }, 20);
  }, [kMoving, kBegun_ms]);
}

/** The file is dropped onto the page, as from a folder. */
export async function dropFile(tab, name, text) {
  const data = await tab.evaluateHandle(([fileName, content]) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([content], fileName, {type: "text/csv"}));
    return transfer;
  }, [name, text]);
  for (const event of ["dragenter", "dragover", "drop"])
    await tab.dispatchEvent("body", event, {dataTransfer: data});
}

/** Pixels of the canvas that are not its background, by colour, the commonest first. */
export async function coloursOf(tab) {
  return tab.evaluate(() => {
    const canvas = document.getElementById("plate");
    const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const pixels = new Uint32Array(data.buffer);
    const counts = new Map();
    for (const pixel of pixels) counts.set(pixel, (counts.get(pixel) ?? 0) + 1);
    return [...counts].sort((a, b) => b[1] - a[1]);
  });
}

export async function axeFindings(tab) {
  await tab.evaluate(require("node:fs").readFileSync(require.resolve("axe-core/axe.min.js"), "utf8"));
  return tab.evaluate(async () => {
    const {violations} = await window.axe.run();
    return violations.filter(({impact}) => impact === "serious" || impact === "critical")
      .map(({id, nodes}) => `${id}: ${nodes.map(({target}) => target).join(" | ")}`);
  });
}

export {assert, given};
