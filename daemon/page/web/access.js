// Who looks on, and what they may do. Buttons ask the same table as the daemon does.

import {find, setText} from "/page/dom.js";

export class Access {
  constructor(api, onChange) {
    this.api = api;
    this.onChange = onChange;
    this.role = "none";
    this.verbs = new Map();
    const dialog = find("token-dialog");
    find("sign-in").addEventListener("click", () => this.open(""));
    find("token-cancel").addEventListener("click", () => dialog.close());
    dialog.addEventListener("keydown", (event) => {
      if (event.key === "Escape") dialog.close();
    });
    find("token-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.use(find("token").value.trim());
    });
  }

  open(reason) {
    setText(find("token-reason"), reason);
    const dialog = find("token-dialog");
    if (!dialog.open) dialog.show();  // stop stays at hand
    find("token").focus();
  }

  async use(token) {
    const before = this.api.token;
    this.api.token = token;
    await this.refresh();
    if (this.role === "none") {
      const {why} = this;
      this.api.token = before;  // a slip of the hand ends no stream
      if (before) await this.refresh();
      setText(find("token-reason"), `Not signed in: ${why}.`);
      return;
    }
    find("token").value = "";
    find("token-dialog").close();
    this.onChange();
  }

  /** Asks the daemon which role it is. */
  async refresh() {
    try {
      const access = await this.api.ask("access");
      this.role = access.role;
      this.why = "";
      this.verbs = new Map(access.verbs.map((verb) => [verb.verb, verb]));
      setText(find("role"), `${access.role}, ${access.name}`);
      setText(find("sign-in"), this.api.token ? "Other token" : "Sign in");
    } catch (error) {
      this.role = "none";
      this.why = error.message;
      this.verbs = new Map();
      setText(find("role"), "not signed in");
    }
  }

  may(verb) {
    return Boolean(this.verbs.get(verb)?.allowed);
  }

  /** The daemon carries the verb out for some role: a coordinator of a plane has fewer of them. */
  has(verb) {
    return this.verbs.has(verb);
  }

  /** A button of a verb: disabled, with the reason, where the role does not suffice. */
  guard(button, verb) {
    const least = this.verbs.get(verb)?.least ?? "operator";
    button.disabled = !this.may(verb);
    if (button.disabled) button.title = `This takes the role ${least}; you are ${this.role}.`;
    return button;
  }
}
