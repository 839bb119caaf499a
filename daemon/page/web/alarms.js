// Alarms that are open: worst first, equal ones folded. They stay until somebody has seen them. While
// somebody points at the list or types in it, entries keep their places: new ones come below, and
// those that are over stay until the pointer has left.

import {AlarmEntry} from "/page/alarm_entry.js";
import {arrange, clock, counted, find, make, setText} from "/page/dom.js";

const kPeriod_ms = 10_000;  // others acknowledge, too
const kHold_ms = 10_000;    // after the last move of the pointer
const kRanks = {error: 0, warning: 1, info: 2};
const kUnitsOfMute = 6;
const kAsksMax = 3;   // of one acknowledgement
const kInvalid = 400;
const kOutcome_ms = 60_000;

/** Whether the alarm began while its kind was muted already. */
function isSince(alarm, mutes) {
  const mute = alarm.muted && alarm.state === "open" && mutes.find(({name}) => name === alarm.name);
  return Boolean(mute) && alarm.first > mute.since;
}

/** Alarms of one name and state, as one entry. */
function fold({alarms, mutes}) {
  const entries = new Map();
  for (const alarm of alarms) {
    const since = isSince(alarm, mutes);
    const key = `${alarm.name} ${alarm.state} ${alarm.muted} ${since}`;
    if (!entries.has(key))
      entries.set(key, {...alarm, key, since, ids: [], units: [], newest: null, total: 0});
    const entry = entries.get(key);
    entry.ids.push(alarm.id);
    entry.total += alarm.count;
    if (alarm.unit_id !== null) entry.units.push(alarm.unit_id);
    if (alarm.last >= entry.last)
      Object.assign(entry, {last: alarm.last, text: alarm.text, newest: alarm.unit_id});
  }
  for (const {units} of entries.values()) units.sort((a, b) => a - b);
  const rank = ({muted, since}) => muted && !since;
  return [...entries.values()].sort((a, b) => rank(a) - rank(b) ||
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
    this.entries = new Map();  // AlarmEntry by key, as the list has them
    this.answer = null;
    this.shownText = "";
    this.role = "";
    this.isLate = false;  // something has changed since the daemon was asked
    this.reading = null;  // until the list is as the daemon has it
    this.version = -1;
    this.isHeld = false;
    this.holdTimer = 0;
    this.outcome = "";  // of the last acknowledgement, where there is something to say
    this.outcomeAt_ms = 0;
    this.sound = new Sound();
    const list = find("alarms");
    for (const event of ["pointermove", "pointerdown", "keydown", "focusin"])
      list.addEventListener(event, () => this.hold());
    list.addEventListener("pointerleave", () => this.release());
    list.addEventListener("focusout", () => setTimeout(() => {
      if (!list.matches(":hover, :focus-within")) this.release();
    }));
    list.addEventListener("toggle", () => this.fitHeight(), true);
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

  /** The list as it is now, also where an earlier question is still open. */
  async refresh() {
    this.isLate = true;
    if (!this.access.may("alarms")) return;
    this.reading ??= this.read();
    await this.reading;
  }

  async read() {
    try {
      while (this.isLate) {
        this.isLate = false;
        this.show(await this.api.ask("alarms"));
      }
    } catch (error) {
      setText(find("alarms-summary"), `Not known: ${error.message}.`);
    } finally {
      this.reading = null;
    }
  }

  show(answer) {
    const since = answer.mutes.reduce((sum, {open_since}) => sum + open_since, 0);
    const muted = answer.muted === 0 ? "" : `, ${answer.muted} muted` +
        (since > 0 ? ` (${since} since)` : "");
    setText(find("alarms-summary"),
        (answer.open === 0 && !muted ? "None is open." : `${answer.open} open${muted}.`) +
        (Date.now() - this.outcomeAt_ms < kOutcome_ms ? this.outcome : ""));
    find("alarms-summary").classList.toggle("since", since > 0);
    this.sound.note(answer.alarms.filter(({state, muted: isMuted}) => state === "open" && !isMuted)
      .map(({id}) => id));
    document.title = answer.open > 0 ? `(${answer.open}) focalfleet` : "focalfleet";
    const text = JSON.stringify([answer, this.access.role]);
    if (text === this.shownText) return;  // nothing of the list is touched under the pointer
    this.shownText = text;
    this.answer = answer;
    this.render();
  }

  // ---- the list, whose entries keep their places meanwhile

  hold() {
    this.isHeld = true;
    clearTimeout(this.holdTimer);
    this.holdTimer = setTimeout(() => this.release(), kHold_ms);
  }

  release() {
    if (find("alarms").querySelector("input:focus, select:focus")) return;  // until focus goes
    clearTimeout(this.holdTimer);
    if (!this.isHeld) return;
    this.isHeld = false;
    if (this.answer) this.render();
  }

  render() {
    const folded = fold(this.answer);
    const keys = new Set(folded.map(({key}) => key));
    if (this.role !== this.access.role) this.entries.clear();  // other buttons
    this.role = this.access.role;
    const before = this.entries;
    const kept = this.isHeld ? [...before.values()] : [];
    this.entries = new Map(kept.map((entry) => [entry.key, entry]));
    for (const entry of kept) if (!keys.has(entry.key)) entry.end();
    for (const entry of folded) {
      const known = before.get(entry.key);
      const shown = known && !known.isOver ? known : new AlarmEntry(this, entry);
      shown.update(entry);
      this.entries.set(entry.key, shown);
    }
    arrange(find("alarms"), [...this.entries.values()].map(({item}) => item));
    find("mutes").replaceChildren(...this.answer.mutes.map((mute) => this.muteOf(mute)));
  }

  /** An entry that somebody unfolds gets more room. An alarm never does. */
  fitHeight() {
    find("alarms-box").classList.toggle("tall", Boolean(find("alarms").querySelector("details[open]")));
  }

  muteOf(mute) {
    const trouble = make("span", {class: "trouble", role: "status"});
    const units = this.answer.alarms.filter((alarm) => alarm.name === mute.name &&
        isSince(alarm, [mute]) && alarm.unit_id !== null).map(({unit_id}) => unit_id).sort((a, b) => a - b);
    const named = units.slice(0, kUnitsOfMute).join(", ") +
        (units.length > kUnitsOfMute ? ` and ${units.length - kUnitsOfMute} more` : "");
    const since = mute.open_since === 0 ? [] : [make("b", {}, `${mute.open_since} since` +
        (units.length === 0 ? "" : `: ${units.length === 1 ? "unit" : "units"} ${named}`)), " "];
    return make("li", {class: "hint"}, `${mute.name} is muted until ${clock(mute.until)} UTC by ` +
        `${mute.by}: ${mute.reason} (${counted(mute.open, "alarm")}). `, ...since,
    this.access.guard(make("button", {type: "button", "aria-label": `Unmute ${mute.name}`, onclick: () =>
      this.change(trouble, "alarms_unmute", {name: mute.name})}, "Unmute"), "alarms_unmute"),
    trouble);
  }

  /**
   * Acknowledges those of an entry's alarms that are open by now: the daemon refuses all where one of
   * them has ended, which one may do until it has the question.
   */
  async acknowledge(ids) {
    const say = (text) => Object.assign(this, {outcome: text, outcomeAt_ms: Date.now()});
    say("");
    try {
      for (let k = 1; ; ++k) {
        const open = new Set((await this.api.ask("alarms")).alarms
          .filter(({state}) => state === "open").map(({id}) => id));
        const standing = ids.filter((id) => open.has(id));
        const ended = ids.length - standing.length;
        try {
          if (standing.length > 0) await this.api.ask("alarms_ack", {ids: standing});
        } catch (error) {
          if (error.status !== kInvalid || k === kAsksMax) throw error;
          continue;
        }
        if (ended > 0)
          say(` ${counted(standing.length, "alarm")} acknowledged; ${ended} had ended meanwhile.`);
        break;
      }
    } catch (error) {
      say(` Not acknowledged: ${error.message}.`);
    }
    this.isHeld = false;
    await this.refresh();
    this.fitHeight();
  }

  /** A change by the operator, who then sees the list as it is. */
  async change(trouble, verb, args) {
    try {
      await this.api.ask(verb, args);
      this.isHeld = false;
      await this.refresh();
      this.fitHeight();
    } catch (error) {
      setText(trouble, error.message);
    }
  }
}
