// What happened, newest first, page by page. The list is asked for while it is open alone.

import {arrange, clock, find, make} from "/page/dom.js";

const kRowsOfPage = 20;
const kAlikeFrom = 4;     // fewer are lines of their own
const kAlikeShown = 50;   // of a line that is unfolded
const kEventsMax = 1000;  // that the daemon answers at once
const kAsksMax = 10;      // for one page
const kRunsBesides = 100;  // newer lines that push no older one out
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

const keyOf = ({at_ns, kind, name, text}) => `${at_ns} ${kind} ${name} ${text}`;

/**
 * The list keeps what somebody unfolded or paged to while newer events come on top. One question is
 * asked at a time.
 */
export class Events {
  /** `onNews()` is called when something has changed. */
  constructor(api, onNews) {
    Object.assign(this, {api, onNews});
    this.key = "";
    this.turn = Promise.resolve();  // the questions so far
    this.isDue = false;             // the newest are going to be asked for
    this.begin();
    find("events").addEventListener("toggle", () => {
      if (find("events").open) this.refresh();
    });
  }

  begin() {
    this.read = [];  // events of the list, the newest first
    this.runs_max = kRowsOfPage;
    this.reader = new EventReader(this.api);
    this.lines = new Map();  // by the oldest event of each
  }

  /** Something has changed that may have become an event. */
  note(facts) {
    const {configuration: c} = facts;
    const key = `${facts.alarms} ${c.id} ${c.state} ${facts.busy}`;
    if (key === this.key) return;
    this.key = key;
    if (find("events").open) this.refresh();
    this.onNews();
  }

  refresh() {
    if (this.isDue) return;
    this.isDue = true;
    this.next(() => {
      this.isDue = false;
      return this.read.length === 0 ? this.readOlder() : this.readNewer();
    });
  }

  next(act) {
    this.turn = this.turn.then(act).then(() => this.show()).catch((error) =>
      find("events-list").replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`)));
  }

  async readOlder() {
    const known = new Set(this.read.map(keyOf));
    for (let k = 0; k < kAsksMax && this.reader.isMore && runsOf(this.read).length <= this.runs_max; ++k) {
      const older = await this.reader.next(k === 0 ? 5 * kRowsOfPage : kEventsMax);
      this.read.push(...older.filter((event) => !known.has(keyOf(event))));
    }
    this.trim(this.runs_max);
  }

  /** Where too much has happened since, the list begins anew. */
  async readNewer() {
    const known = new Set(this.read.map(keyOf));
    const reader = new EventReader(this.api);
    const newer = [];
    const isKnown = () => newer.some((event) => known.has(keyOf(event)));
    for (let k = 0; k < kAsksMax && reader.isMore && !isKnown(); ++k)
      newer.push(...await reader.next(k === 0 ? 5 * kRowsOfPage : kEventsMax));
    if (!isKnown()) {
      this.begin();
      return this.readOlder();
    }
    const oldest_ns = this.read.at(-1).at_ns;
    const fresh = newer.filter((event) => event.at_ns >= oldest_ns && !known.has(keyOf(event)));
    this.read = [...fresh, ...this.read].sort((a, b) => b.at_ns - a.at_ns);
    this.trim(this.runs_max + kRunsBesides);
  }

  /** Lines beyond a number go, and can be asked for again. */
  trim(runs_max) {
    const runs = runsOf(this.read);
    if (runs.length <= runs_max) return;
    this.reader.through_ns = runs[runs_max][0].at_ns;
    this.reader.isMore = true;
    this.read = runs.slice(0, runs_max).flat();
  }

  show() {
    const before = this.lines;
    this.lines = new Map();
    for (const run of runsOf(this.read)) {
      const key = keyOf(run.at(-1));
      const known = before.get(key);
      const isSame = known?.length === run.length;
      const element = isSame ? known.element : runLine(run);
      if (!isSame && known?.element.open) element.open = true;
      this.lines.set(key, {element, length: run.length});
    }
    const more = make("button", {type: "button", class: "more", onclick: () => {
      more.disabled = true;
      this.runs_max = this.lines.size + kRowsOfPage;
      this.next(() => this.readOlder());
    }}, "Earlier");
    arrange(find("events-list"), [...[...this.lines.values()].map(({element}) => element),
      ...(this.read.length === 0 ? [make("p", {class: "hint"}, "Nothing has happened yet.")] : []),
      ...(this.reader.isMore ? [more] : [])]);
  }
}
