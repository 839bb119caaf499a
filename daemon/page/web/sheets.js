// The views of the page: one of them at a time beside the fleet's panel. Stop is in all of them.

import {find} from "/page/dom.js";

const kNames = ["plate", "curves", "nights", "model", "diagnosis", "camera"];

export class Sheets {
  /** `opened` has a function for views that fetch something when they are shown. */
  constructor(opened) {
    this.opened = opened;
    this.shown = "plate";
    for (const name of kNames)
      find(`show-${name}`).addEventListener("click", () => {
        this.show(name);
        window.scrollTo(0, 0);  // a small screen has more below
      });
  }

  show(name) {
    this.shown = name;
    for (const other of kNames) {
      find(`show-${other}`).setAttribute("aria-pressed", String(other === name));
      find(`sheet-${other}`).hidden = other !== name;
    }
    this.opened[name]?.();
  }
}
