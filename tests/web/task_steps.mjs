// Ten tasks of an operator's night, done with the page alone. Each ends with the answer that the
// page gives. Clicks, keys and scrolls are counted, and the seconds of a practised hand follow from
// them by the keystroke-level model (Card, Moran and Newell 1980): 1.1 s to point, 0.2 s to click or
// to press a key, 1.35 s to think before each step, 0.4 s from the mouse to the keyboard or back.
// The page's own time is added as measured here.

import {readFileSync} from "node:fs";
import {assert, dropFile, given, isLive, openTab, signIn, textOf, untilAllStand, untilTheyMove,
  world} from
  "./browser.mjs";

const targets = () => readFileSync(given.targets, "utf8");
const say = (text) => process.stdout.write(`${text}\n`);

const kPoint_s = 1.1;
const kPress_s = 0.2;
const kThink_s = 1.35;
const kHome_s = 0.4;
const kScroll_s = 1.0;

/** An operator: what they do to the page, counted. */
class Hand {
  constructor(tab) {
    this.tab = tab;
    this.begin();
  }

  begin() {
    Object.assign(this, {clicks: 0, keys: 0, scrolls: 0, hand_s: 0, page_ms: 0});
  }

  /** An action of the page, whose time is that of the page. */
  async wait(action) {
    const begun = performance.now();
    const value = await action();
    this.page_ms += performance.now() - begun;
    return value;
  }

  async see(element) {
    const isSeen = await element.evaluate((seen) => {
      const box = seen.getBoundingClientRect();
      const top = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
      return Boolean(top) && (seen.contains(top) || top.contains(seen));
    });
    if (isSeen) return;
    ++this.scrolls;
    this.hand_s += kScroll_s;
    await element.scrollIntoViewIfNeeded();
  }

  async click(selector) {
    const element = typeof selector === "string" ? this.tab.locator(selector).first() : selector;
    await element.waitFor();
    await this.see(element);
    ++this.clicks;
    this.hand_s += kThink_s + kPoint_s + kPress_s;
    await this.wait(() => element.click());
  }

  async type(selector, text) {
    const element = typeof selector === "string" ? this.tab.locator(selector).first() : selector;
    await this.click(element);
    this.keys += text.length;
    this.hand_s += kHome_s + text.length * kPress_s;
    await element.fill(text);
  }

  async press(key) {
    ++this.keys;
    this.hand_s += kPress_s;
    await this.wait(() => this.tab.keyboard.press(key));
  }

  async choose(selector, value) {
    const element = typeof selector === "string" ? this.tab.locator(selector).first() : selector;
    await this.see(element);
    this.clicks += 2;  // it opens, and an entry is taken
    this.hand_s += kThink_s + 2 * (kPoint_s + kPress_s);
    await element.selectOption(value);
  }

  async drop(name) {
    ++this.clicks;
    this.hand_s += kThink_s + 2 * kPoint_s + 2 * kPress_s;
    await this.wait(() => dropFile(this.tab, name, targets()));
  }

  answer(selector, pattern) {
    return this.wait(() => textOf(this.tab, selector, pattern));
  }
}

const rows = [];

async function task(hand, name, act) {
  hand.begin();
  await act();
  const s = (hand.hand_s + hand.page_ms / 1000).toFixed(1);
  rows.push(`| ${name} | ${hand.clicks} | ${hand.keys} | ${hand.scrolls} | ${s} |`);
  say(rows.at(-1));
}

export async function tasks(browser) {
  const tab = await openTab(browser);
  await signIn(tab, "operator");
  await isLive(tab);
  await dropFile(tab, "monday.csv", targets());
  await tab.click("#apply");
  await textOf(tab, "#configuration", /is done/);
  await world("yesterday");
  await world("disable 5");
  await world("targets 7");
  await tab.reload();
  await signIn(tab, "operator");
  await isLive(tab);
  await untilAllStand(tab);
  const hand = new Hand(tab);

  await task(hand, "Can this file be served, and how long does it take?", async () => {
    await hand.drop("tuesday.csv");
    await hand.answer("#preview", /served[\s\S]*takes[\s\S]*disabled/);
  });
  await task(hand, "Does its motion look right?", async () => {
    await hand.click("#play-preview");
    await hand.answer("#player-title", "nothing moves");
    await hand.click("#player-close");
  });
  await task(hand, "Apply it, and see when it ends", async () => {
    await hand.click("#apply");
    await hand.answer("#progress-text", /to its planned end/);
  });
  const result = await textOf(tab, "#configuration", /tuesday.csv \(configuration 2\) is done/);
  const [, makespan] = /It took (.*), planned/.exec(result);
  await textOf(tab, "#configuration", /Not served\s*1: disabled: its gear is worn\s*5\s*Farthest/);
  await task(hand, "Find why unit 5 was not served", async () => {
    await hand.type("#find-id", "5");
    await hand.press("Enter");
    await hand.answer("#unit", /disabled: its gear is worn/);
  });
  await task(hand, "Find the worst unit", async () => {
    await hand.click("#worst");
    await hand.answer("#unit", /off by/);
  });
  await world("targets 9");
  await dropFile(tab, "tuesday-2.csv", targets());
  await tab.click("#apply");
  await untilTheyMove(tab);
  await task(hand, "Stop", async () => {
    await hand.click("#stop");
    await hand.answer("#stop-state", "the daemon has it");
  });
  await textOf(tab, "#configuration", /tuesday-2.csv .*is stopped/);
  await untilAllStand(tab);
  await task(hand, "Find who stopped", async () => {
    await hand.click("#commands summary");
    await hand.answer("#commands-list", /stop (\(configuration \d+\) )?by token operator-page/);
  });
  await task(hand, "How did the last configuration go, unit by unit?", async () => {
    await hand.click("#earlier summary");
    await hand.click(tab.getByRole("button", {name: "Replay configuration 3"}));
    await hand.answer("#replay-trouble", /Moves: \d+ /);
  });
  await tab.click("#player-close");
  await world("fault 9");
  const alarm = tab.locator("#alarms > li", {hasText: "fault"}).first();
  await alarm.waitFor();
  await task(hand, "An alarm: what is to be done, and mute it until dawn", async () => {
    await hand.click(alarm.locator("summary"));
    await hand.wait(() => alarm.locator(".runbook li").first().waitFor());
    await hand.choose(alarm.getByLabel("How long it is muted"), "dawn");
    await hand.type(alarm.getByLabel("Muted until, UTC"), "0530");  // once: the browser keeps it
    await hand.type(alarm.getByLabel("Reason to mute"), "waits for the day crew");
    await hand.click(alarm.getByRole("button", {name: "Mute"}));
    await hand.answer("#mutes", /is muted until .* 05:30:\d\d UTC by .*: waits for the day crew/);
  });
  await task(hand, "Was last night better than this one?", async () => {
    await hand.click("#show-nights");
    await hand.wait(() => tab.locator("#nights-table tbody tr").nth(1).waitFor());
  });
  const nights = await tab.locator("#nights-table tbody tr").allInnerTexts();
  assert.equal(nights.length, 2, nights.join("\n"));
  assert.match(nights[1], /100\.0 %/);
  assert.ok(nights[0].includes(`\t${makespan}\t`), `${nights[0]}: one that was stopped has no makespan`);
  await tab.screenshot({path: `${given.out}/nights.png`});
  assert.equal(rows.length, 10);
  assert.deepEqual(tab.faults, []);
}
