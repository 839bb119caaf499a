// Who commanded what, by the daemon's audit, newest first, page by page.

import {justBefore} from "/page/api.js";
import {clock, counted, find, make} from "/page/dom.js";

const kRowsOfPage = 20;
const kUnitsNamed = 8;
const kStopsMax = 100;
const kStopAsksMax = 3;
const kStopWait_ms = 1000;  // the audit is written a little after the fleet has stopped

const numbersIn = (text) => [...text.matchAll(/\d+/g)].map(([number]) => Number(number));

/** What a request names. The audit keeps the front of a long one, which is no whole JSON then. */
export function objectOf({request, request_bytes}) {
  const list = /"unit_ids":\s*\[([\d,\s]*)/.exec(request);
  const one = /"unit_id":\s*(\d+)/.exec(request);
  const source = /"source":\s*("(?:[^"\\]|\\.)*")/.exec(request);
  const name = /"name":\s*("(?:[^"\\]|\\.)*")/.exec(request);
  const isCut = list !== null && list.index + list[0].length === request.length &&
      new TextEncoder().encode(request).length < request_bytes;
  const units = list ? numbersIn(list[1]) : one ? [Number(one[1])] : [];
  if (isCut) units.pop();  // its last digits may be cut off
  return {units, isCut, source: source ? JSON.parse(source[1]) : "", name: name ? JSON.parse(name[1]) : ""};
}

/** The same in words: `disable` of units 5, 7; `apply` of night-1.csv, configuration 3. */
function objectText(entry) {
  const {units, isCut, source, name} = objectOf(entry);
  const rest = units.length - kUnitsNamed;
  const more = isCut ? " and more" : rest > 0 ? ` and ${counted(rest, "unit")} more` : "";
  return [units.length === 0 ? "" : `${units.length === 1 ? "unit" : "units"} ` +
      units.slice(0, kUnitsNamed).join(", ") + more, source || name,
  entry.configuration > 0 ? `configuration ${entry.configuration}` : ""].filter(Boolean).join(", ");
}

const callerOf = ({name}) => name || "somebody";

/** Who stopped the configuration, and when, as a sentence; empty: it is not known to this role. */
export async function stopperOf(api, access, configuration) {
  if (!access.may("audit")) return "";
  for (let k = 0; k < kStopAsksMax; ++k) {
    if (k > 0) await new Promise((resolve) => setTimeout(resolve, kStopWait_ms));
    const {entries} = await api.ask("audit", {verb: "stop", limit: kStopsMax});
    const stop = entries.find((entry) => entry.taken && entry.configuration === configuration &&
        objectOf(entry).units.length === 0);  // the first of them: later ones found it stopped
    if (stop) return `Stopped by ${callerOf(stop)}, ${clock(stop.at)} UTC.`;
  }
  return "";
}

/** Commands and refusals; they take the role operator. */
export class Commands {
  constructor(api, access) {
    Object.assign(this, {api, access});
    this.asked = 0;
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
    const asked = ++this.asked;
    if (!this.access.may("audit"))
      return body.replaceChildren(make("p", {class: "hint"},
          `This takes the role operator; you are ${this.access.role}.`));
    try {
      const {entries} = await this.api.ask("audit",
          {limit: kRowsOfPage, ...(before === null ? {} : {until_ns: before})});
      if (asked !== this.asked) return;  // a later question has a newer answer
      entries.reverse();  // the newest first, as all lists have it
      body.querySelector(".more")?.remove();
      if (before === null) body.replaceChildren();
      body.append(...entries.map((entry) => this.lineOf(entry)));
      if (entries.length === 0 && before === null)
        body.append(make("p", {class: "hint"}, "Nothing was commanded yet."));
      if (entries.length === kRowsOfPage)
        body.append(make("button", {type: "button", class: "more",
          onclick: () => this.page(justBefore(entries.at(-1).at_ns))}, "Earlier"));
    } catch (error) {
      if (asked === this.asked)
        body.replaceChildren(make("p", {class: "hint"}, `Not known: ${error.message}.`));
    }
  }

  lineOf(entry) {
    const object = objectText(entry);
    return make("p", {class: `event ${entry.taken ? "" : "warning"}`},
        make("span", {class: "hint"}, `${clock(entry.at)} UTC `), make("b", {}, entry.verb),
        object ? ` (${object})` : "", ` by ${callerOf(entry)} (${entry.role}, ${entry.door})`,
        entry.taken ? "" : `: refused, ${entry.reason}`);
  }
}
