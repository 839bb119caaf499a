// One entry of the list of alarms: its text, and unfolded what can be done about it, with the
// runbook's words. The entry stays the same element while its alarms change.

import {clock, make, setText} from "/page/dom.js";
import {dawn, keepDawn, secondsUntil, timeOfDay} from "/page/mute_time.js";
import {runbookOf} from "/page/runbook.js";

const kUnitsNamed = 8;

/** A few units by name, and how many there are besides. */
function someOf(units) {
  const rest = units.length - kUnitsNamed;
  return units.slice(0, kUnitsNamed).join(", ") + (rest > 0 ? ` and ${rest} more` : "");
}

export class AlarmEntry {
  constructor(alarms, {key, name, severity, muted, since}) {
    Object.assign(this, {alarms, key, entry: null, shownText: "", runbookKey: "",
      isOver: false});
    this.summary = make("summary");
    this.units = make("p");
    this.runbook = make("div");
    this.body = make("div");
    const details = make("details", {ontoggle: () => {
      if (details.open) this.fill();
    }}, this.summary, this.body);
    this.acknowledge = this.alarms.access.guard(make("button", {type: "button", class: "acknowledge",
      "aria-label": `Acknowledge ${name}`, onclick: () =>
        this.alarms.acknowledge(this.entry.ids)},
    "Acknowledge"), "alarms_ack");
    this.details = details;
    this.item = make("li", {class: `alarm ${severity}${muted && !since ? " quiet" : ""}`}, this.acknowledge,
        details);
  }

  update(entry) {
    const text = JSON.stringify(entry);
    if (text === this.shownText) return;
    this.shownText = text;
    this.entry = entry;
    const {severity, name, state, muted, since, total} = entry;
    this.summary.replaceChildren(make("span", {class: "severity"}, severity), ` ${name}`,
        since ? " (since it was muted)" : muted ? " (muted)" : "",
        state === "over" ? " (over, not seen yet)" : "", total > 1 ? ` ×${total}` : "",
        make("span", {class: "alarm-text"}, entry.text),
        make("span", {class: "hint"}, `${clock(entry.last)} UTC`));
    if (this.body.childElementCount > 0) this.showUnits();
  }

  /** Its alarms are over. The element stays until the pointer has left. */
  end() {
    if (this.isOver) return;
    this.isOver = true;
    this.item.classList.add("quiet");
    for (const button of this.item.querySelectorAll("button")) button.disabled = true;
    this.summary.querySelector(".hint").append(", no longer open");
  }

  fill() {
    if (this.body.childElementCount === 0) this.body.append(this.actions(), this.units, this.runbook);
    this.showUnits();
  }

  async showUnits() {
    const {units, newest, name} = this.entry;
    const rest = units.length - kUnitsNamed;
    this.units.replaceChildren(...(units.length === 0 ? [] : ["Units: ",
      ...units.slice(0, kUnitsNamed).flatMap((unit) => [make("button", {type: "button",
        class: "row-button", onclick: () => this.alarms.onUnit(unit)}, String(unit)), " "]),
      rest > 0 ? `and ${rest} more` : ""]));
    const about = units.length > 1
      ? `Commands name unit ${newest}, the newest; they go for each of ${someOf(units)}.` : "";
    const key = `${newest} ${about}`;
    if (key === this.runbookKey) return;
    this.runbookKey = key;
    const words = await runbookOf(name, newest);
    if (key !== this.runbookKey) return;
    if (!words) {
      this.runbookKey = "";
      this.runbook.replaceChildren(make("p", {class: "hint"}, "The runbook did not come: unfold the alarm again."));
    } else {
      this.runbook.replaceChildren(...(about ? [make("p", {class: "hint"}, about)] : []), ...words);
    }
  }

  // ---- mute

  actions() {
    const {name} = this.entry;
    const reason = make("input", {size: 14, "aria-label": "Reason to mute", placeholder: "reason"});
    const period = make("select", {"aria-label": "How long it is muted"},
        ...[["1 h", "3600"], ["4 h", "14400"], ["12 h", "43200"], ["until dawn", "dawn"],
          ["until", "until"]].map(([text, value]) => make("option", {value}, text)));
    // A field for a time shows 12 or 24 hours as the browser's language has it; UTC has 24.
    const until = make("input", {size: 5, maxlength: 5, placeholder: "HH:MM", inputmode: "numeric",
      autocomplete: "off", "aria-label": "Muted until, UTC"});
    const zone = make("span", {class: "time"}, until, " UTC");
    const trouble = make("span", {class: "trouble", role: "status"});
    const takesTime = () => period.value === "dawn" || period.value === "until";
    zone.hidden = true;
    period.addEventListener("change", () => {
      zone.hidden = !takesTime();
      until.value = period.value === "dawn" ? dawn() : "";
      setText(trouble, "");
      if (takesTime() && until.value === "") until.focus();
    });
    for (const field of [reason, until]) {
      field.addEventListener("input", () => setText(trouble, ""));
      field.addEventListener("keydown", (event) => {
        if (event.key === "Enter") mute.click();
      });
    }
    const refuse = (text, field) => {
      setText(trouble, text);
      field.focus();
    };
    const mute = make("button", {type: "button", onclick: async () => {
      if (reason.value.trim() === "") return refuse("Give a reason: others will wonder.", reason);
      const time = timeOfDay(until.value);
      if (takesTime() && time === null)
        return refuse(period.value === "dawn" ? "When is dawn, UTC (HH:MM)? This browser keeps it."
          : "Until when, UTC (HH:MM)?", until);
      if (period.value === "dawn") keepDawn(time);
      await this.alarms.change(trouble, "alarms_mute", {name, reason: reason.value.trim(),
        for_s: takesTime() ? secondsUntil(time, Date.now()) : Number(period.value)});
    }}, `Mute all ${name}`);
    return make("div", {class: "buttons"}, period, zone, reason,
        this.alarms.access.guard(mute, "alarms_mute"), trouble);
  }
}
