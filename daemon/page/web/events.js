// What happened, newest first, page by page. The list is asked for while it is open alone.

import {clock, find, make} from "/page/dom.js";

const kRowsOfPage = 20;

export class Events {
  constructor(api) {
    this.api = api;
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
  }

  /** Events before an instant; null: the newest. */
  async page(before) {
    const body = find("events-list");
    try {
      const {events} = await this.api.ask("events",
          {limit: kRowsOfPage, ...(before === null ? {} : {until_ns: before})});
      body.querySelector(".more")?.remove();
      if (before === null) body.replaceChildren();
      body.append(...events.reverse().map((event) => make("p", {class: `event ${event.severity}`},
          make("span", {class: "hint"}, `${clock(event.at)} `), event.name ? `${event.name}: ` : "",
          event.text)));
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
