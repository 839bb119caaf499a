// The stream of frames: one request whose answer goes on. A stream that breaks, or is silent, is
// asked for again, and then begins with a snapshot.

const kSilence_ms = 3500;  // the daemon shows a sign of life each second
const kWaits_ms = [250, 500, 1000, 2000, 4000];

/** Splits bytes into frames by the lengths before them. */
export class FrameSplitter {
  constructor() {
    this.parts = [];
    this.bytes = 0;
  }

  /** The frames that are whole with these bytes, without their lengths. */
  push(chunk) {
    this.parts.push(chunk);
    this.bytes += chunk.length;
    const frames = [];
    while (this.bytes >= 4) {
      const head = this.joined();
      const length = new DataView(head.buffer, head.byteOffset, 4).getUint32(0, true);
      if (this.bytes < 4 + length) break;
      frames.push(head.subarray(4, 4 + length));
      this.parts = [head.subarray(4 + length)];
      this.bytes -= 4 + length;
    }
    return frames;
  }

  joined() {
    if (this.parts.length > 1) {
      const all = new Uint8Array(this.bytes);
      let at = 0;
      for (const part of this.parts) {
        all.set(part, at);
        at += part.length;
      }
      this.parts = [all];
    }
    return this.parts[0];
  }
}

export class Stream {
  /**
   * `onFrame(bytes)`, `onState(state, text)` with state "live", "waiting" (it is tried again),
   * "token" (a valid token is needed) or "full".
   */
  constructor(api, onFrame, onState) {
    this.api = api;
    this.onFrame = onFrame;
    this.onState = onState;
    this.bytes = 0;
    this.tries = 0;
    this.abort = null;
    this.wake = null;
    this.turn = 0;  // a run that is no longer the newest ends
  }

  async run() {
    const turn = ++this.turn;
    for (;;) {
      await this.once();
      if (turn !== this.turn) return;
      const wait_ms = kWaits_ms[Math.min(this.tries++, kWaits_ms.length - 1)];
      await new Promise((resolve) => {
        this.wake = resolve;
        setTimeout(resolve, wait_ms);
      });
      if (turn !== this.turn) return;
    }
  }

  /** No stream any more. */
  end() {
    ++this.turn;
    this.tries = 0;
    if (this.abort) this.abort.abort();
    if (this.wake) this.wake();
  }

  async once() {
    const abort = this.abort = new AbortController();
    const {turn} = this;
    const say = (state, text) => {
      if (turn === this.turn) this.onState(state, text);
    };
    let watchdog = 0;
    const watch = () => {
      clearTimeout(watchdog);
      watchdog = setTimeout(() => abort.abort(), kSilence_ms);
    };
    try {
      watch();
      const answer = await fetch("/stream", {headers: this.api.headers(), cache: "no-store",
        signal: abort.signal});
      if (!answer.ok) return this.refused(answer, say);
      const reader = answer.body.getReader();
      const splitter = new FrameSplitter();
      for (;;) {
        const {done, value} = await reader.read();
        if (done) break;
        watch();
        this.bytes += value.length;
        for (const frame of splitter.push(value)) {
          if (turn !== this.turn) return;
          this.onFrame(frame);
          this.tries = 0;
          say("live", "");
        }
      }
      say("waiting", "The daemon has ended the stream. It is asked again.");
    } catch (error) {
      const text = error instanceof TypeError || error.name === "AbortError"
        ? "No link to the daemon. It is tried again." : `The stream broke: ${error.message}.`;
      say("waiting", text);
    } finally {
      clearTimeout(watchdog);
    }
  }

  async refused(answer, say) {
    const text = await this.api.errorOf(answer);
    if (answer.status === 401 || answer.status === 403) say("token", text);
    else if (answer.status === 503) say("full", text);
    else say("waiting", text);
  }
}
