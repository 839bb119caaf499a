// The last exposure: how far each fibre is from its target and whither, and who was not found.

import {clock, counted, find, make, micrometres} from "/page/dom.js";

const kWorstShown = 12;
const kNotFoundShown = 40;
const kArrow_px = 26;  // of the arrow that stands for the length below

/** A round length that some arrows exceed: the 90th percentile. */
function roundLength(sorted_um) {
  const most = sorted_um[Math.floor(0.9 * (sorted_um.length - 1))] || 1;
  const power = 10 ** Math.floor(Math.log10(most));
  return [1, 2, 5, 10].map((k) => k * power).find((length) => length >= most);
}

export class Camera {
  constructor(api, plate, onUnit) {
    Object.assign(this, {api, plate, onUnit});
    this.rows = [];
    new ResizeObserver(() => this.draw()).observe(find("residuals"));
  }

  async show() {
    const body = find("camera");
    try {
      const {exposure, measurements} = await this.api.ask("measurements");
      this.rows = measurements;
      find("residuals").hidden = false;
      this.say(exposure, measurements);
      this.draw();
    } catch (error) {
      this.rows = [];
      find("residuals").hidden = true;
      body.replaceChildren(make("p", {class: "hint"}, `No exposure: ${error.message}.`));
    }
  }

  unitButton(id) {
    return make("button", {type: "button", class: "row-button", onclick: () => this.onUnit(id)},
        String(id));
  }

  say(exposure, rows) {
    const off = rows.filter(({error_um}) => error_um !== null).sort((a, b) => b.error_um - a.error_um);
    const notFound = rows.filter(({status}) => status !== "measured" && status !== "did_not_move");
    const counts = new Map();
    for (const {status} of notFound) counts.set(status, (counts.get(status) ?? 0) + 1);
    const median = off.length > 0 ? off[Math.floor(off.length / 2)].error_um : NaN;
    find("camera").replaceChildren(
        make("p", {}, make("b", {}, `Exposure ${exposure}`), rows.length > 0
          ? `, ${clock(rows[0].at)} UTC, configuration ${rows[0].configuration}. ` : ". ",
        `${counted(off.length, "fibre")} measured against a target: median ${micrometres(median)}, ` +
        `worst ${micrometres(off[0]?.error_um ?? NaN)}.`),
        make("p", {class: notFound.length > 0 ? "trouble" : "good"}, notFound.length === 0
          ? "All were found." : `${counted(notFound.length, "unit")} not found, or not for certain: ` +
            [...counts].map(([status, count]) => `${count} ${status.replaceAll("_", " ")}`).join(", ")),
        make("p", {}, ...notFound.slice(0, kNotFoundShown).flatMap(({unit_id}) =>
          [this.unitButton(unit_id), " "]), notFound.length > kNotFoundShown ? "…" : ""),
        ...(off.length === 0 ? [] : [make("h3", {}, "Farthest from their targets"), make("table", {},
            make("thead", {}, make("tr", {}, ...["unit", "x", "y", "off by"].map((text) =>
              make("th", {scope: "col"}, text)))),
            make("tbody", {}, ...off.slice(0, kWorstShown).map((row) => make("tr", {},
                make("td", {}, this.unitButton(row.unit_id)),
                make("td", {}, micrometres(1000 * (row.x_mm - row.target_x_mm))),
                make("td", {}, micrometres(1000 * (row.y_mm - row.target_y_mm))),
                make("td", {}, micrometres(row.error_um))))))]));
  }

  /** Arrows from target to fibre, longer than life; squares where a unit was not found. */
  draw() {
    const canvas = find("residuals");
    const {clientWidth: width, clientHeight: height} = canvas;
    if (width === 0 || this.rows.length === 0) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const {colours, view: {box}, fleet} = this.plate;
    context.fillStyle = colours.plate;
    context.fillRect(0, 0, width, height);
    const scale = 0.94 * Math.min(width / (box[1] - box[0]), height / (box[3] - box[2]));
    const at = (x, y) => [width / 2 + (x - (box[0] + box[1]) / 2) * scale,
      height / 2 - (y - (box[2] + box[3]) / 2) * scale];
    const seen = this.rows.filter(({error_um}) => error_um !== null);
    const length_um = roundLength(seen.map(({error_um}) => error_um).sort((a, b) => a - b));
    const perMm = kArrow_px / (length_um / 1000);
    context.strokeStyle = colours.s0;
    context.fillStyle = colours.s0;
    context.lineWidth = 1.2;
    context.beginPath();
    for (const row of seen) {
      const [x, y] = at(row.target_x_mm, row.target_y_mm);
      let dx = (row.x_mm - row.target_x_mm) * perMm;
      let dy = -(row.y_mm - row.target_y_mm) * perMm;
      const cut = Math.min(1, 3 * kArrow_px / Math.hypot(dx, dy));  // the worst must not hide others
      dx *= cut;
      dy *= cut;
      context.moveTo(x, y);
      context.lineTo(x + dx, y + dy);
      context.rect(x - 0.7, y - 0.7, 1.4, 1.4);
    }
    context.stroke();
    context.strokeStyle = colours.fault;
    context.lineWidth = 2;
    context.beginPath();
    for (const {unit_id, status} of this.rows) {
      const u = fleet.placeOf.get(unit_id);
      if (u === undefined || status === "measured" || status === "did_not_move") continue;
      const [x, y] = at(fleet.x_mm[u], fleet.y_mm[u]);
      context.rect(x - 4, y - 4, 8, 8);
    }
    context.stroke();
    context.strokeStyle = colours.ink;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(12, height - 12);
    context.lineTo(12 + kArrow_px, height - 12);
    context.stroke();
    context.fillStyle = colours.ink;
    context.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    context.fillText(`${length_um} µm, from target to fibre`, 18 + kArrow_px, height - 8);
  }
}
