// The page over many hours: the stream of a configuration, as the daemon sent it, goes through the
// page again and again as fast as it takes it, under other numbers of configurations and alarms, so
// that all that a night asks for anew is asked for. Lists are open, and curves are looked at now
// and then. The heap is the browser's own measure after it has collected its garbage.

import {assert, dropFile, given, isLive, openTab, signIn, textOf, world} from "./browser.mjs";
import {readFileSync} from "node:fs";

const kFramesOfHour = 36_000;  // ten a second
const kHours = Number(process.env.FOCALFLEET_HEAP_HOURS ?? 8);
const kSamplesOfHour = 2;
const kWarmSamples = 2;        // code is compiled and lists reach their lengths
// A page that keeps anything of each frame keeps a pointer of it at least.
const kKeptOfFrame_bytes = 8;
const kKeptOfRound = 0.5;      // nodes and listeners of each configuration

/** Keeps the frames of one configuration, as the daemon sends them; the first is a snapshot. */
async function record(tab) {
  await tab.evaluate(async () => {
    const {snapshotOf} = await import("/page/frames.js");
    const page = window.focalfleetPage;
    const recorded = window.recorded = [snapshotOf(page.fleet)];
    const take = page.stream.onFrame;
    page.stream.onFrame = (frame) => {
      recorded.push(frame.slice());
      take(frame);
    };
  });
  await dropFile(tab, "night.csv", readFileSync(given.targets, "utf8"));
  await tab.click("#apply");
  await textOf(tab, "#configuration", /\(configuration 2\) is done/);
  return tab.evaluate(() => window.recorded.length);
}

/** From here on no frame of the daemon reaches the page, only those that `play` makes. */
async function prepare(tab) {
  await tab.evaluate(() => {
    const page = window.focalfleetPage;
    page.stream.onFrame = () => {};
    const kHead = 40;
    let number = 0;
    let round = 0;
    const renew = (frame) => {
      const view = new DataView(frame.buffer, frame.byteOffset, frame.byteLength);
      const size = view.getUint32(28, true);
      if (size === 0) {
        const same = frame.slice();
        new DataView(same.buffer).setUint32(4, ++number, true);
        return same;
      }
      const facts = JSON.parse(new TextDecoder().decode(frame.subarray(kHead, kHead + size)));
      facts.configuration.id = 1 + round % 2;  // both are in the store
      facts.alarms += Math.floor(round / 4);
      const text = new TextEncoder().encode(JSON.stringify(facts));
      const other = new Uint8Array(frame.length - size + text.length);
      other.set(frame.subarray(0, kHead));
      other.set(text, kHead);
      other.set(frame.subarray(kHead + size), kHead + text.length);
      const head = new DataView(other.buffer);
      head.setUint32(4, ++number, true);
      head.setUint32(28, text.length, true);
      return other;
    };
    let at = 0;
    window.play = async (frames) => {
      for (let k = 0; k < frames; ++k) {
        if (at === 0) {
          ++round;
          page.sheets.show(round % 8 === 0 ? "curves" : "plate");
        }
        page.onFrame(renew(window.recorded[at]));
        at = (at + 1) % window.recorded.length;
        // A real page draws between frames; here it draws after every few.
        if (k % 10 === 0) await new Promise((resolve) => requestAnimationFrame(resolve));
      }
    };
  });
}

async function heapOf(tab, session) {
  await tab.evaluate(() => window.focalfleetPage.sheets.show("plate"));
  await tab.waitForTimeout(1000);  // questions to the daemon are answered
  for (let k = 0; k < 3; ++k) await session.send("HeapProfiler.collectGarbage");
  const {usedSize} = await session.send("Runtime.getHeapUsage");
  const {nodes, jsEventListeners} = await session.send("Memory.getDOMCounters");
  return {MB: usedSize / 1e6, nodes, listeners: jsEventListeners};
}

export async function heap(browser) {
  const tab = await openTab(browser);
  tab.setDefaultTimeout(3_600_000);
  await signIn(tab, "operator");
  await isLive(tab);
  for (const list of ["events", "earlier", "commands"]) await tab.click(`#${list} summary`);
  await dropFile(tab, "first.csv", readFileSync(given.targets, "utf8"));
  await tab.click("#apply");
  await textOf(tab, "#configuration", /\(configuration 1\) is done/);
  await world("targets 77");
  const recorded = await record(tab);
  await prepare(tab);
  const session = await tab.context().newCDPSession(tab);
  const samples = [];
  for (let k = 0; k <= kHours * kSamplesOfHour; ++k) {
    if (k > 0) await tab.evaluate((frames) => window.play(frames), kFramesOfHour / kSamplesOfHour);
    const found = await heapOf(tab, session);
    samples.push(found);
    console.log(JSON.stringify({hours: k / kSamplesOfHour, heap_MB: Number(found.MB.toFixed(2)),
      nodes: found.nodes, listeners: found.listeners}));
  }
  console.log(JSON.stringify({units: given.count, recorded_frames: recorded,
    played_frames: kHours * kFramesOfHour}));
  // The median of the slopes of all pairs (Theil and Sen): garbage that the browser frees late, and
  // lists of other lengths, scatter the samples.
  const warm = samples.slice(Math.min(kWarmSamples, samples.length - 2));
  const rounds = kHours * kFramesOfHour / recorded;
  const most = {MB: kKeptOfFrame_bytes * kHours * kFramesOfHour / 1e6, nodes: kKeptOfRound * rounds,
    listeners: kKeptOfRound * rounds};
  for (const [what, allowed] of Object.entries(most)) {
    const slopes = warm.flatMap((early, k) => warm.slice(k + 1).map((late, n) =>
      (late[what] - early[what]) / (n + 1)));
    slopes.sort((a, b) => a - b);
    const grown = slopes[slopes.length >> 1] * kHours * kSamplesOfHour;
    console.log(JSON.stringify({what, grown: Number(grown.toFixed(2)), allowed}));
    assert.ok(grown <= allowed, `${what} grew by ${grown} in ${kHours} hours`);
  }
  assert.deepEqual(tab.faults, []);
}
