// The runbook's own words about an alarm, from the file that the daemon was built with.

import {make} from "/page/dom.js";

let sections = null;

/** The sections of the runbook by their headings. */
async function load() {
  const answer = await fetch("/page/runbook.md");
  if (!answer.ok) throw new Error(`the daemon answered ${answer.status}`);
  const text = await answer.text();
  const found = new Map();
  for (const part of text.split(/^### /m).slice(1)) {
    const [name, ...lines] = part.split("\n");
    found.set(name.trim(), lines.join("\n").split(/^## /m)[0]);
  }
  return found;
}

/** Texts between backquotes are code, in which the unit has its number; links are their words. */
function proseOf(text, unit) {
  const codeOf = (part) => unit === null ? part : part.replace(/\bUNIT\b/g, String(unit));
  const plain = text.replace(/\[([^\]]*)\]\([^)]*\)/g, "$1").replace(/\s+/g, " ").trim();
  return plain.split("`").map((part, k) => k % 2 === 1 ? make("code", {}, codeOf(part)) : part);
}

/**
 * What the runbook has about the alarm, as elements; commands name the unit, if there is one.
 * null: the daemon did not give it.
 */
export async function runbookOf(name, unit) {
  const asked = sections ??= load();
  let text;
  try {
    text = (await asked).get(name);
  } catch {
    if (sections === asked) sections = null;  // the next alarm that is unfolded asks again
    return null;
  }
  if (!text) return [make("p", {class: "hint"}, "The runbook has no entry for it.")];
  const [prose, ...items] = text.split(/^- /m);
  return [make("p", {}, ...proseOf(prose, unit)),
    make("ul", {class: "runbook"}, ...items.map((item) => make("li", {}, ...proseOf(item, unit))))];
}
