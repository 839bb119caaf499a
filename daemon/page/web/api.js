// Verbs of the daemon over HTTP. The token stays in this object: it is gone with the tab.

export class ApiError extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
  }
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

  /** The result of a verb. Throws an ApiError with the daemon's own words. */
  async ask(verb, args = {}) {
    let answer;
    try {
      answer = await fetch(`/api/${verb}`, {method: "POST", body: JSON.stringify(args),
        headers: {...this.headers(), "Content-Type": "application/json"}, cache: "no-store"});
    } catch {
      throw new ApiError(0, "no link to the daemon");
    }
    if (!answer.ok) throw new ApiError(answer.status, await this.errorOf(answer));
    return answer.json();
  }
}
