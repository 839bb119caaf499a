// Frame times of the page while all units move, in the browser's own count.

import {readdirSync, readFileSync} from "node:fs";
import {dropFile, given, isLive, kMoving, openTab, signIn, textOf, withBrowser} from
  "./browser.mjs";

const kMeasured_ms = 12_000;
const kSettled_ms = 10_000;  // the browser itself works on for a while after a page has come
const kAtRest_ms = 30_000;
const kTicksPerSecond = 100;
const kBegun_ms = 1000;  // the start comes a moment after the signal

/** CPU of this program's children and theirs: the browser. Units: s. */
function browserCpu_s() {
  const stats = readdirSync("/proc").filter((name) => /^\d+$/.test(name)).flatMap((pid) => {
    try {
      const fields = readFileSync(`/proc/${pid}/stat`, "utf8").split(") ").at(-1).split(" ");
      return [{pid: Number(pid), parent: Number(fields[1]), ticks: Number(fields[11]) +
        Number(fields[12])}];
    } catch {
      return [];  // it has ended meanwhile
    }
  });
  const ours = new Set([process.pid]);
  for (let more = true; more;) {
    more = false;
    for (const {pid, parent} of stats) {
      if (!ours.has(parent) || ours.has(pid)) continue;
      ours.add(pid);
      more = true;
    }
  }
  ours.delete(process.pid);
  return stats.filter(({pid}) => ours.has(pid)).reduce((sum, {ticks}) => sum + ticks, 0) /
      kTicksPerSecond;
}

/** A tab at rest, with nobody who asks it anything. */
async function measureIdle(what) {
  await new Promise((resolve) => setTimeout(resolve, kSettled_ms));
  const cpu_s = browserCpu_s();
  await new Promise((resolve) => setTimeout(resolve, kAtRest_ms));
  console.log(JSON.stringify({what, units: given.count,
    cpu_percent: Math.round(1e5 * (browserCpu_s() - cpu_s) / kAtRest_ms * 10) / 10}));
}

async function measure(tab, what) {
  const cpu_s = browserCpu_s();
  const seen = await tab.evaluate(async (span_ms) => {
    const {plate, stream} = window.focalfleetPage;
    const drawn = [];
    const gaps = [];
    const bytes = stream.bytes;
    let last = 0;
    const begun = performance.now();
    const heldTimes = plate.times_ms;
    plate.times_ms = drawn;
    await new Promise((resolve) => {
      const step = (now) => {
        if (last > 0) gaps.push(now - last);
        last = now;
        if (now - begun > span_ms) resolve();
        else requestAnimationFrame(step);
      };
      requestAnimationFrame(step);
    });
    plate.times_ms = heldTimes;
    return {drawn: [...drawn], gaps, turning: plate.turning.size, bytes: stream.bytes - bytes,
      took_s: (performance.now() - begun) / 1000};
  }, kMeasured_ms);
  const used_s = browserCpu_s() - cpu_s;
  const quantile = (list, q) => [...list].sort((a, b) => a - b)[Math.floor(q * (list.length - 1))];
  const round = (x) => Math.round(10 * x) / 10;
  const summary = {what, units: given.count, turning: seen.turning, frames: seen.drawn.length,
    drawn_per_s: round(seen.drawn.length / seen.took_s),
    fps: round(seen.gaps.length / seen.took_s), median_ms: round(quantile(seen.drawn, 0.5) ?? 0),
    p99_ms: round(quantile(seen.drawn, 0.99) ?? 0), gap_p99_ms: round(quantile(seen.gaps, 0.99)),
    cpu_ms_per_frame: round(1000 * used_s / Math.max(1, seen.drawn.length)),
    cpu_share: round(100 * used_s / seen.took_s), kB_per_s: round(seen.bytes / seen.took_s / 1000)};
  console.log(JSON.stringify(summary));
}

await withBrowser(async (browser) => {
  const blank = await browser.newPage();
  await measureIdle("an empty tab");
  await blank.close();
  const tab = await openTab(browser);
  tab.setDefaultTimeout(400_000);
  await signIn(tab, "operator");
  await isLive(tab);
  await tab.waitForFunction(() => window.focalfleetPage.fleet.facts !== null);
  await measureIdle("at rest");
  await dropFile(tab, "targets.csv", readFileSync(given.targets, "utf8"));
  await tab.click("#play-preview");
  await measure(tab, "a preview plays");
  await tab.click("#player-close");
  await tab.click("#apply");
  await tab.waitForFunction(([count, moving]) =>
    window.focalfleetPage.plate.state.filter((state) => state === moving).length > 0.5 * count,
      [given.count, kMoving]);
  await tab.waitForTimeout(kBegun_ms);
  await measure(tab, "all move");
  console.log(await textOf(tab, "#progress-text", /./));
  if (tab.faults.length > 0) console.log(tab.faults);
});
process.exit(0);
