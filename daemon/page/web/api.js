// Verbs of the daemon over HTTP. The token stays in this object: it is gone with the tab.

export class ApiError extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
  }
}

const kApart_ns = 512;  // times of this century are 256 ns apart in a browser's numbers

/** The `until_ns` of an older page, which has nothing of that instant again though it was rounded. */
export function justBefore(at_ns) {
  return at_ns - kApart_ns;
}

export class Api {
  constructor() {
    this.token = "";
  }

  headers() {
    return this.token ? {Authorization: `Bearer ${this.token}`} : {};
  }

  async errorOf(answer) {
    try {
      return (await answer.json()).error.text;
    } catch {
      return `the daemon answered ${answer.status}`;
    }
  }

  async layout() {
    const answer = await fetch("/layout", {headers: this.headers(), cache: "no-store"});
    if (!answer.ok) throw new ApiError(answer.status, await this.errorOf(answer));
    return answer.json();
  }

  /** What the daemon answers to a GET, as JSON. Throws an ApiError with the daemon's own words. */
  async get(path) {
    return (await this.fetched(path)).json();
  }

  /** The same as bytes; null: the daemon does not keep them, or no longer. */
  async bytes(path) {
    const answer = await this.fetched(path, 404);
    return answer.status === 404 ? null : answer.arrayBuffer();
  }

  async fetched(path, accepted = 200) {
    let answer;
    try {
      answer = await fetch(path, {headers: this.headers(), cache: "no-store"});
    } catch {
      throw new ApiError(0, "no link to the daemon");
    }
    if (!answer.ok && answer.status !== accepted)
      throw new ApiError(answer.status, await this.errorOf(answer));
    return answer;
  }

  /** The answer to a POST beside the verbs. Throws an ApiError with the daemon's own words. */
  post(path, args) {
    return this.sent(path, args);
  }

  /** The result of a verb. Throws an ApiError with the daemon's own words. */
  ask(verb, args = {}) {
    return this.sent(`/api/${verb}`, args);
  }

  async sent(path, args) {
    let answer;
    try {
      answer = await fetch(path, {method: "POST", body: JSON.stringify(args),
        headers: {...this.headers(), "Content-Type": "application/json"}, cache: "no-store"});
    } catch {
      throw new ApiError(0, "no link to the daemon");
    }
    if (!answer.ok) throw new ApiError(answer.status, await this.errorOf(answer));
    return answer.json();
  }
}
