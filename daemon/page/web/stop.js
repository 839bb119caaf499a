// Stop: one press sends it, without a question. Each press sends it again.

import {find, make, setText} from "/page/dom.js";

export class Stop {
  constructor(api, access) {
    this.api = api;
    this.access = access;
    this.sent = 0;
    this.configuration = 0;  // the newest
    this.answeredIn = null;  // the configuration that was the newest at the last stop
    find("stop").addEventListener("click", () => this.send());
    window.addEventListener("keydown", (event) => {
      const typing = event.target.matches?.("input, select, textarea");
      if (event.shiftKey && event.code === "KeyS" && !event.ctrlKey && !event.metaKey && !typing) {
        event.preventDefault();
        this.send();
      }
    });
  }

  /** A stop is over once a later configuration moves: its answer beside it would mislead. */
  note({id, state}) {
    this.configuration = id;
    if (this.answeredIn === null || id === this.answeredIn || state !== "moving") return;
    this.answeredIn = null;
    setText(find("stop-state"), "");
  }

  async send() {
    this.answeredIn = null;
    const number = ++this.sent;
    const say = (text, command = "") => {
      if (number !== this.sent) return;
      find("stop-state").replaceChildren(text, ...(command ? [make("code", {}, command)] : []));
      find("stop-state").classList.toggle("trouble", command !== "");
    };
    say("Stop is sent …");
    try {
      await this.api.ask("stop");
      say(`Stop: the daemon has it (${new Date().toISOString().slice(11, 19)} UTC).`);
      this.answeredIn = this.configuration;
    } catch (error) {
      say(`NOT STOPPED: ${error.message}. At the host: `, "focalfleet stop --direct");
      if (error.status === 401) this.access.open("Stop needs a token: any role may stop.");
    }
  }
}
