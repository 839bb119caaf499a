// What happened, and who commanded it, newest first, page by page. A list is asked for while it is
// open alone.

import {clock, find, make} from "/page/dom.js";

const kRowsOfPage = 20;
const kAlikeFrom = 4;     // fewer are lines of their own
const kAlikeShown = 50;   // of a line that is unfolded
const kEventsMax = 1000;  // that the daemon answers at once
const kAsksMax = 10;      // for one page

/** An event of the daemon as a line. */
export function eventLine(event) {
  return make("p", {class: `event ${event.severity}`}, make("span", {class: "hint"},
      `${clock(event.at)} UTC `), event.name ? `${event.name}: ` : "", event.text);
}

/** Equal but for numbers: many units did the same. */
const formOf = ({kind, name, severity, text}) => `${kind} ${name} ${severity} ${text.replace(/\d+/g, "#")}`;

/** Events that follow each other and are alike, as lists, from some on. */
function runsOf(events) {
  const runs = [];
  let form = "";
  for (const event of events) {
    if (formOf(event) !== form) runs.push([]);
    form = formOf(event);
    runs.at(-1).push(event);
  }
  return runs.flatMap((run) => run.length < kAlikeFrom ? run.map((event) => [event]) : [run]);
}

function runLine(run) {
  if (run.length === 1) return eventLine(run[0]);
  const rest = run.slice(1, 1 + kAlikeShown);
  const body = make("div");
  return make("details", {class: "run", ontoggle: () => {
    if (body.childElementCount > 0) return;
    body.append(...rest.map(eventLine));
    if (run.length - 1 > rest.length)
      body.append(make("p", {class: "hint"}, `and ${run.length - 1 - rest.length} more`));
  }}, make("summary", {}, eventLine(run[0]),
      make("span", {class: "hint"}, `and ${run.length - 1} more like it`)), body);
}

export class Events {
  /** `onNews()` is called when something has changed. */
  constructor(api, onNews) {
    Object.assign(this, {api, onNews});
    this.key = "";
    this.asked = 0;
    find("events").addEventListener("toggle", () => {
      if (find("events").open) this.page(null);
    });
  }

  /** Something has changed that may have become an event. */
  note(facts) {
    const {configuration: c} = facts;
    const key = `${facts.alarms} ${c.id} ${c.state} ${facts.busy}`;
    if (key === this.key) return;
    this.key = key;
    if (find("events").open) this.page(null);
    this.onNews();
  }

  /** Events before an instant; null: the newest. Those that are alike are one line. */
  async page(before) {
    const body = find("events-list");
    const asked = ++this.asked;
    try {
      const events = [];
      let isMore = true;
      let until_ns = before;
      for (let k = 0; k < kAsksMax && isMore && runsOf(events).length < kRowsOfPage; ++k) {
        const limit = k === 0 ? 5 * kRowsOfPage : kEventsMax;
        const answer = await this.api.ask("events", {limit, ...(until_ns === null ? {} : {until_ns})});
        events.push(...answer.events.reverse());
        isMore = answer.events.length === limit;
        until_ns = events.at(-1)?.at_ns;
      }
      if (asked !== this.asked) return;
      const runs = runsOf(events);
      const shown = runs.slice(0, kRowsOfPage);
      body.querySelector(".more")?.remove();
      if (before === null) body.replaceChildren();
      body.append(...shown.map(runLine));
      if (events.length === 0 && before === null)
        body.append(make("p", {class: "hint"}, "Nothing has happened yet."));
      if (isMore || runs.length > shown.length)
        body.append(make("button", {type: "button", class: "more",
          onclick: () => this.page(shown.at(-1).at(-1).at_ns)}, "Earlier"));
    } catch (error) {
      body.replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }
}

/** Commands and refusals by the daemon's audit, which takes the role operator. */
export class Commands {
  constructor(api, access) {
    Object.assign(this, {api, access});
    find("commands").addEventListener("toggle", () => {
      if (find("commands").open) this.page(null);
    });
  }

  /** Something has changed that may follow a command. */
  note() {
    if (find("commands").open) this.page(null);
  }

  async page(before) {
    const body = find("commands-list");
    if (!this.access.may("audit"))
      return body.replaceChildren(make("p", {class: "hint"},
          `This takes the role operator; you are ${this.access.role}.`));
    try {
      const {entries} = await this.api.ask("audit",
          {limit: kRowsOfPage, ...(before === null ? {} : {until_ns: before})});
      entries.reverse();  // the newest first, as all lists have it
      body.querySelector(".more")?.remove();
      if (before === null) body.replaceChildren();
      body.append(...entries.map((entry) => make("p", {class: `event ${entry.taken ? "" : "warning"}`},
          make("span", {class: "hint"}, `${clock(entry.at)} UTC `), make("b", {}, entry.verb), " by ",
          `${entry.name || "somebody"} (${entry.role}, ${entry.door})`,
          entry.taken ? "" : `: refused, ${entry.reason}`)));
      if (entries.length === 0 && before === null)
        body.append(make("p", {class: "hint"}, "Nothing was commanded yet."));
      if (entries.length === kRowsOfPage)
        body.append(make("button", {type: "button", class: "more",
          onclick: () => this.page(entries.at(-1).at_ns)}, "Earlier"));
    } catch (error) {
      body.replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }
}
