// What happened, and who commanded it, newest first, page by page. A list is asked for while it is
// open alone.

import {clock, find, make} from "/page/dom.js";

const kRowsOfPage = 20;

/** An event of the daemon as a line. */
export function eventLine(event) {
  return make("p", {class: `event ${event.severity}`}, make("span", {class: "hint"},
      `${clock(event.at)} `), event.name ? `${event.name}: ` : "", event.text);
}

export class Events {
  /** `onNews()` is called when something has changed. */
  constructor(api, onNews) {
    Object.assign(this, {api, onNews});
    this.key = "";
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

  /** Events before an instant; null: the newest. */
  async page(before) {
    const body = find("events-list");
    try {
      const {events} = await this.api.ask("events",
          {limit: kRowsOfPage, ...(before === null ? {} : {until_ns: before})});
      body.querySelector(".more")?.remove();
      if (before === null) body.replaceChildren();
      body.append(...events.reverse().map(eventLine));
      if (events.length === 0 && before === null)
        body.append(make("p", {class: "hint"}, "Nothing has happened yet."));
      if (events.length === kRowsOfPage)
        body.append(make("button", {type: "button", class: "more",
          onclick: () => this.page(events.at(-1).at_ns)}, "Earlier"));
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
          make("span", {class: "hint"}, `${clock(entry.at)} `), make("b", {}, entry.verb), " by ",
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
