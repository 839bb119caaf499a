// What happened, and who commanded it, newest first, page by page. A list is asked for while it is
// open alone.

import {justBefore} from "/page/api.js";
import {clock, find, make} from "/page/dom.js";

const kRowsOfPage = 20;
const kAlikeFrom = 4;     // fewer are lines of their own
const kAlikeShown = 50;   // of a line that is unfolded
const kEventsMax = 1000;  // that the daemon answers at once
const kAsksMax = 10;      // for one page
const kNearby_ns = 1024;  // more than a browser's numbers round times by

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
  const atLeast = run.some(({isCut}) => isCut) ? "at least " : "";
  return make("details", {class: "run", ontoggle: () => {
    if (body.childElementCount > 0) return;
    body.append(...rest.map(eventLine));
    if (run.length - 1 > rest.length)
      body.append(make("p", {class: "hint"}, `and ${run.length - 1 - rest.length} more`));
  }}, make("summary", {}, eventLine(run[0]),
      make("span", {class: "hint"}, `and ${atLeast}${run.length - 1} more like it`)), body);
}

/**
 * Reads events, the newest first. A start of the daemon has hundreds at one instant: where an answer
 * ends within an instant, the next one has it as a whole.
 */
class EventReader {
  constructor(api) {
    Object.assign(this, {api, through_ns: Infinity, isMore: true});
  }

  async next(limit) {
    const {through_ns} = this;
    const {events} = await this.api.ask("events", {limit,
      ...(through_ns === Infinity ? {} : {until_ns: through_ns + kNearby_ns})});
    this.isMore = events.length === limit;
    const found = events.reverse().filter(({at_ns}) => at_ns <= through_ns);
    if (!this.isMore) return found;
    const oldest_ns = found.at(-1)?.at_ns ?? through_ns;
    const whole = found.filter(({at_ns}) => at_ns > oldest_ns);
    if (whole.length === 0 && limit < kEventsMax) return this.next(kEventsMax);
    this.through_ns = whole.length > 0 ? oldest_ns : oldest_ns - kNearby_ns;
    if (whole.length > 0) return whole;
    return found.map((event) => ({...event, isCut: true}));  // more than the daemon answers at once
  }
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

  /**
   * Events, of which those that are alike are one line. `earlier`: a reader, and what it has read and
   * nobody has seen; null: the newest.
   */
  async page(earlier) {
    const body = find("events-list");
    const asked = ++this.asked;
    const reader = earlier?.reader ?? new EventReader(this.api);
    const events = [...earlier?.unseen ?? []];
    try {
      for (let k = 0; k < kAsksMax && reader.isMore && runsOf(events).length <= kRowsOfPage; ++k)
        events.push(...await reader.next(k === 0 ? 5 * kRowsOfPage : kEventsMax));
      if (asked !== this.asked) return;
      const runs = runsOf(events);
      const unseen = runs.slice(kRowsOfPage).flat();
      body.querySelector(".more")?.remove();
      if (earlier === null) body.replaceChildren();
      body.append(...runs.slice(0, kRowsOfPage).map(runLine));
      if (events.length === 0 && earlier === null)
        body.append(make("p", {class: "hint"}, "Nothing has happened yet."));
      if (!reader.isMore && unseen.length === 0) return;
      const more = make("button", {type: "button", class: "more", onclick: () => {
        more.disabled = true;  // the reader goes on from where it is
        this.page({reader, unseen});
      }}, "Earlier");
      body.append(more);
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
          onclick: () => this.page(justBefore(entries.at(-1).at_ns))}, "Earlier"));
    } catch (error) {
      body.replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }
}
