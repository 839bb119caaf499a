// Alarms that are open: worst first, equal ones folded, with the runbook's words. They stay until
// somebody has seen them.

import {clock, counted, find, make, setText} from "/page/dom.js";
import {runbookOf} from "/page/runbook.js";

const kPeriod_ms = 10_000;  // others acknowledge, too
const kRanks = {error: 0, warning: 1, info: 2};
const kUnitsNamed = 8;

/** Seconds until it is that time of day in UTC: today, or tomorrow. Units: s. */
export function secondsUntil(time, now_ms) {
  const [hours, minutes] = time.split(":").map(Number);
  const at = new Date(now_ms);
  at.setUTCHours(hours, minutes, 0, 0);
  const rest_s = Math.ceil((at.getTime() - now_ms) / 1000);  // not a second too early
  return rest_s > 0 ? rest_s : rest_s + 24 * 3600;
}

/** Alarms of one name and state, as one entry. */
function fold(alarms) {
  const entries = new Map();
  for (const alarm of alarms) {
    const key = `${alarm.name} ${alarm.state} ${alarm.muted}`;
    if (!entries.has(key)) entries.set(key, {...alarm, ids: [], units: [], total: 0});
    const entry = entries.get(key);
    entry.ids.push(alarm.id);
    entry.total += alarm.count;
    if (alarm.unit_id !== null) entry.units.push(alarm.unit_id);
    if (alarm.last >= entry.last) Object.assign(entry, {last: alarm.last, text: alarm.text});
  }
  return [...entries.values()].sort((a, b) => a.muted - b.muted ||
      kRanks[a.severity] - kRanks[b.severity] || (a.last < b.last ? 1 : -1));
}

/** A short tone for each alarm that is new, where somebody wants it. */
class Sound {
  constructor() {
    this.context = null;  // a browser gives one to somebody who asked for it
    this.played = 0;
    this.known = null;
    find("sound").addEventListener("click", () => {
      this.context = this.context ? null : new AudioContext();
      find("sound").setAttribute("aria-pressed", String(Boolean(this.context)));
      setText(find("sound"), this.context ? "Sound is on" : "Sound is off");
      if (this.context) this.play();
    });
  }

  note(ids) {
    const isNew = this.known !== null && ids.some((id) => !this.known.has(id));
    this.known = new Set(ids);
    if (isNew) this.play();
  }

  play() {
    if (!this.context) return;
    ++this.played;
    const tone = this.context.createOscillator();
    const volume = this.context.createGain();
    volume.gain.value = 0.15;
    tone.frequency.value = 660;
    tone.connect(volume).connect(this.context.destination);
    tone.start();
    tone.stop(this.context.currentTime + 0.4);
  }
}

export class Alarms {
  constructor(api, access, onUnit) {
    this.api = api;
    this.access = access;
    this.onUnit = onUnit;
    this.open = new Set();  // entries that are unfolded
    this.drafts = new Map();
    this.shownText = "";
    this.busy = false;
    this.version = -1;
    this.sound = new Sound();
    setInterval(() => {
      if (!document.hidden) this.refresh();
    }, kPeriod_ms);
  }

  /** The stream says that there is a new alarm. */
  note(version) {
    if (version === this.version) return;
    this.version = version;
    this.refresh();
  }

  async refresh() {
    if (!this.access.may("alarms") || this.busy) return;
    this.busy = true;
    try {
      this.show(await this.api.ask("alarms"));
    } catch (error) {
      setText(find("alarms-summary"), `Not known: ${error.message}.`);
    } finally {
      this.busy = false;
    }
  }

  show(answer) {
    const muted = answer.muted > 0 ? `, ${answer.muted} muted` : "";
    setText(find("alarms-summary"),
        answer.open === 0 && !muted ? "None is open." : `${answer.open} open${muted}.`);
    this.sound.note(answer.alarms.filter(({state, muted}) => state === "open" && !muted)
      .map(({id}) => id));
    document.title = answer.open > 0 ? `(${answer.open}) focalfleet` : "focalfleet";
    const text = JSON.stringify([answer, this.access.role]);
    if (text === this.shownText) return;  // nothing of the list is rebuilt under the pointer
    this.shownText = text;
    find("alarms").replaceChildren(...fold(answer.alarms).map((entry) => this.entryOf(entry)));
    find("mutes").replaceChildren(...answer.mutes.map((mute) => this.muteOf(mute)));
  }

  entryOf(entry) {
    const key = entry.name;
    const body = make("div");
    const open = async () => {
      if (body.childElementCount > 0) return;
      body.append(...await runbookOf(key), this.unitsOf(entry), this.actionsOf(entry));
    };
    const details = make("details", {ontoggle: () => {
      if (details.open) this.open.add(key);
      else this.open.delete(key);
      if (details.open) open();
    }},
    make("summary", {}, make("span", {class: "severity"}, entry.severity), ` ${entry.name}`,
        entry.muted ? " (muted)" : "", entry.state === "over" ? " (over, not seen yet)" : "",
        entry.total > 1 ? ` ×${entry.total}` : "",
        make("br"), entry.text, make("br"),
        make("span", {class: "hint"}, `${clock(entry.last)} UTC`)),
    body);
    details.open = this.open.has(key);
    const item = make("li", {class: `alarm ${entry.severity}${entry.muted ? " quiet" : ""}`},
        details);
    item.append(make("div", {class: "buttons"}, this.access.guard(
        make("button", {type: "button", onclick: () => this.acknowledge(entry)}, "Acknowledge"),
        "alarms_ack")));
    return item;
  }

  unitsOf(entry) {
    if (entry.units.length === 0) return "";
    const rest = entry.units.length - kUnitsNamed;
    return make("p", {}, "Units: ", ...entry.units.slice(0, kUnitsNamed).flatMap((unit) => [
      make("button", {type: "button", class: "row-button", onclick: () => this.onUnit(unit)},
          String(unit)), " "]), rest > 0 ? `and ${rest} more` : "");
  }

  actionsOf(entry) {
    // The list is made anew when an alarm comes: what is half typed must not be gone then.
    const draft = this.drafts.get(entry.name) ?? {reason: "", period: "3600", until: ""};
    this.drafts.set(entry.name, draft);
    const reason = make("input", {size: 16, "aria-label": "Reason to mute",
      placeholder: "reason", value: draft.reason});
    reason.addEventListener("input", () => {
      draft.reason = reason.value;
      setText(trouble, "");
    });
    reason.addEventListener("keydown", (event) => {
      if (event.key === "Enter") mute.click();
    });
    const period = make("select", {"aria-label": "How long it is muted"},
        ...[["1 h", "3600"], ["4 h", "14400"], ["12 h", "43200"], ["until, UTC", "until"]]
          .map(([text, seconds]) => make("option", {value: seconds}, text)));
    period.value = draft.period;
    const until = make("input", {type: "time", "aria-label": "Muted until, UTC",
      hidden: period.value !== "until", value: draft.until});
    until.addEventListener("input", () => { draft.until = until.value; });
    period.addEventListener("change", () => {
      draft.period = period.value;
      until.hidden = period.value !== "until";
      if (!until.hidden) until.focus();
    });
    const trouble = make("span", {class: "trouble", role: "status"});
    const mute = make("button", {type: "button", onclick: async () => {
      if (reason.value.trim() === "") {
        setText(trouble, "Give a reason: others will wonder.");
        return reason.focus();
      }
      if (period.value === "until" && until.value === "") {
        setText(trouble, "Until when?");
        return until.focus();
      }
      const for_s = period.value === "until" ? secondsUntil(until.value, Date.now())
        : Number(period.value);
      await this.change(trouble, "alarms_mute", {name: entry.name, for_s,
        reason: reason.value.trim()});
    }}, `Mute all ${entry.name}`);
    return make("div", {class: "buttons"}, period, until, reason, this.access.guard(mute, "alarms_mute"),
        trouble);
  }

  muteOf(mute) {
    const trouble = make("span", {class: "trouble", role: "status"});
    return make("li", {class: "hint"}, `${mute.name} is muted until ${clock(mute.until)} UTC by ` +
        `${mute.by}: ${mute.reason} (${counted(mute.open, "alarm")}) `,
    this.access.guard(make("button", {type: "button", onclick: () =>
      this.change(trouble, "alarms_unmute", {name: mute.name})}, "Unmute"), "alarms_unmute"),
    trouble);
  }

  acknowledge(entry) {
    return this.change(find("alarms-summary"), "alarms_ack", {ids: entry.ids});
  }

  async change(trouble, verb, args) {
    try {
      await this.api.ask(verb, args);
      this.busy = false;
      await this.refresh();
    } catch (error) {
      setText(trouble, error.message);
    }
  }
}
