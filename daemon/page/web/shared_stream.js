// One stream for all tabs of a browser that show the same token. A tab holds a lock and reads the
// stream, and hands every frame on to the others. When it is closed, the lock goes to another tab,
// which asks for a stream of its own. Tabs with other tokens share nothing, so that a token that is
// revoked ends all that it had opened. Where the browser has no locks each tab has its stream.

import {snapshotOf} from "/page/frames.js";
import {Stream} from "/page/stream.js";

const kSilence_ms = 3500;

async function nameOf(token) {
  const bytes = new TextEncoder().encode(`focalfleet ${token}`);
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return `focalfleet ${[...digest].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

export class SharedStream {
  /** As Stream; `fleet()` is the fleet as this tab has it. */
  constructor(api, onFrame, onState, fleet) {
    Object.assign(this, {api, onFrame, onState, fleet});
    this.leads = false;
    this.hasFollowers = false;
    this.joined = 0;
    this.channel = null;
    this.leave = () => {};
    this.stream = new Stream(api, (frame) => this.take(frame), (state, text) => {
      this.onState(state, text);
      this.post({state, text});
    });
  }

  get bytes() { return this.stream.bytes; }

  post(message) {
    if (this.leads && this.channel) this.channel.postMessage(message);
  }

  take(frame) {
    this.onFrame(frame);
    // A frame is a part of a longer buffer, which a message would carry whole.
    if (this.hasFollowers) this.post({frame: frame.slice()});
  }

  /** Joins the tabs of the token that the page has now. */
  async run() {
    const turn = ++this.joined;
    this.leave();
    this.leads = false;
    if (!navigator.locks || !window.BroadcastChannel || !window.crypto?.subtle)
      return this.lead(turn);
    const name = await nameOf(this.api.token);
    if (turn !== this.joined) return;
    this.open(name);
    const abort = new AbortController();
    let release = null;
    this.leave = () => {
      abort.abort();
      release?.();
      this.stream.end();
      clearTimeout(this.watchdog);
      this.channel?.close();
      this.channel = null;
    };
    try {
      await navigator.locks.request(name, {signal: abort.signal}, () => new Promise((resolve) => {
        release = resolve;
        this.lead(turn);
      }));
    } catch {
      // Left before the lock came.
    }
  }

  restart() {
    return this.run();
  }

  lead(turn) {
    if (turn !== this.joined) return;
    this.leads = true;
    clearTimeout(this.watchdog);
    this.stream.run();
  }

  open(name) {
    this.channel = new BroadcastChannel(name);
    this.channel.onmessage = ({data}) => {
      if (this.leads) {
        if (data.hello) this.greet();
      } else {
        this.follow(data);
      }
    };
    this.isBehind = true;
    this.channel.postMessage({hello: true});
    this.watch();
  }

  /** A tab that has just come needs a whole fleet before frames go onto it. */
  greet() {
    const fleet = this.fleet();
    this.hasFollowers = true;
    if (fleet && fleet.number > 0) this.post({frame: snapshotOf(fleet), whole: true});
  }

  watch() {
    clearTimeout(this.watchdog);
    this.watchdog = setTimeout(() => {
      if (this.leads) return;
      this.onState("waiting", "No link to the daemon. It is tried again.");
      this.ask();
    }, kSilence_ms);
  }

  ask() {
    this.isBehind = true;
    this.channel?.postMessage({hello: true});
    this.watch();
  }

  follow(data) {
    if (data.state !== undefined) {
      if (data.state !== "live") this.onState(data.state, data.text);
      return;
    }
    if (data.frame === undefined) return;
    this.watch();
    const isSnapshot = data.frame[0] === 1;
    if (this.isBehind && !isSnapshot) return;
    if (data.whole && !this.isBehind) return;  // for another tab
    try {
      this.onFrame(data.frame);
      this.isBehind = false;
      this.onState("live", "");
    } catch {
      this.ask();
    }
  }
}
