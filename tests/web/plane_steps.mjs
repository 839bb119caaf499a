// The page of a plane's coordinator: the units of all sectors, and no more than it carries out.

import {readFileSync} from "node:fs";
import {armStop, assert, axeFindings, dropFile, given, isLive, openTab, signIn, textOf,
  world} from "./browser.mjs";

const targets = () => readFileSync(given.targets, "utf8");
const say = (text) => process.stdout.write(`${text}\n`);

export async function plane(browser) {
  const tab = await openTab(browser);
  say("a viewer sees the units of both sectors");
  await signIn(tab, "viewer");
  await isLive(tab);
  await textOf(tab, "#fleet-summary", `${given.count} units: ${given.count} standing`);
  await tab.selectOption("#theme", "sector");
  const counts = await tab.evaluate(() => [...document.querySelectorAll("#legend b")]
    .map(({textContent}) => Number(textContent)));
  assert.equal(counts.length, 2, "a colour for each sector");
  assert.ok(counts.every((count) => count > 0), `units by sector: ${counts}`);
  assert.equal(counts[0] + counts[1], given.count);
  await tab.selectOption("#theme", "state");

  say("what the coordinator does not carry out is not offered");
  for (const id of ["show-nights", "show-model", "show-diagnosis", "show-camera", "earlier-section",
    "events-section", "commands-section"])
    assert.ok(await tab.locator(`#${id}`).isHidden(), `${id} is offered`);
  assert.ok(await tab.locator("#show-curves").isVisible());
  await textOf(tab, "#alarms-summary", /No alarm|open/);

  say("a viewer moves nothing");
  await dropFile(tab, "targets.csv", targets());
  await textOf(tab, "#preview", "takes the role operator; you are viewer");
  const forbidden = await tab.evaluate(async () => {
    try {
      await window.focalfleetPage.api.ask("apply", {targets_csv: "unit_id,x_mm,y_mm\n"});
      return "taken";
    } catch (error) {
      return error.message;
    }
  });
  assert.match(forbidden, /may not apply/);

  say("a unit: state, sector, neighbours");
  await tab.fill("#find-id", "7");
  await tab.press("#find-id", "Enter");
  await textOf(tab, "#unit", /state\s*ready[\s\S]*sector\s*\d/);
  assert.ok(await tab.locator("#beside button").count() >= 2);

  say("an operator previews, sees the plan in motion, and applies with a correction");
  await signIn(tab, "operator");
  await dropFile(tab, "night-1.csv", targets());
  await textOf(tab, "#preview", `of ${given.count} targets`);
  await textOf(tab, "#preview", /at most \d+ W/);
  await tab.click("#play-preview");
  await textOf(tab, "#player-title", "not live: nothing moves");
  await tab.click("#player-close");
  await tab.selectOption("#preview select", "1");
  await tab.click("#apply");
  await textOf(tab, "#configuration", /night-1.csv is under way/);
  await textOf(tab, "#progress-text", /planned end|behind its plan|uploading|planning/);
  await textOf(tab, "#configuration", /night-1.csv \(configuration 1\) is done/);
  await textOf(tab, "#configuration", /after correction 1/);
  await tab.screenshot({path: `${given.out}/plane.png`});
  const known = await tab.evaluate(() => window.focalfleetPage.fleet.witness
    .every((witness) => witness === 4));
  assert.ok(known, "every place is a measured one");

  say("a stop during motion stops both sectors");
  await world("targets 7");
  await dropFile(tab, "night-2.csv", targets());
  await textOf(tab, "#preview", `of ${given.count} targets`);
  await armStop(tab);
  await tab.click("#apply");
  await textOf(tab, "#configuration", /night-2.csv .*is stopped/);
  await textOf(tab, "#stop-state", "the daemon has it");
  const {fleet} = await tab.evaluate(() => {
    const {outcome, sector} = window.focalfleetPage.fleet;
    return {fleet: {outcome: [...outcome], sector: [...sector]}};
  });
  const kStopped = 5;  // frames.js, kOutcomes
  for (const sector of [0, 1])
    assert.ok(fleet.outcome.some((outcome, u) => outcome === kStopped && fleet.sector[u] === sector),
        `no unit of sector ${sector} was stopped`);

  say("a sector that is not heard has no places on the plate");
  await world("stop-sector 1");
  const silent = fleet.sector.filter((sector) => sector === 1).length;
  await textOf(tab, "#fleet-summary", `${silent} not heard`);
  assert.deepEqual(await axeFindings(tab), []);
  await tab.screenshot({path: `${given.out}/plane-silent.png`});
}
