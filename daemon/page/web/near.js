// The near view: up to some thousand units as shapes, with targets and ids. Shapes say the state
// without colour: a square is disabled, a diamond not served, a cross a fault, a ring not known or
// not heard.

import {State} from "/page/colours.js";

const kFullCircle = 2 * Math.PI;
const kMuchOfPath = 64;  // pieces of a path; longer ones are slow to paint without a graphics card

export class Near {
  constructor(plate) {
    this.plate = plate;
    this.context = plate.context;
  }

  draw(visible) {
    const {context, plate} = this;
    context.setTransform(plate.view.ratio, 0, 0, plate.view.ratio, 0, 0);
    context.fillStyle = plate.colours.plate;
    context.fillRect(0, 0, plate.view.width, plate.view.height);
    this.visible = visible;
    this.drawObstacles();
    if (plate.view.pitch_px > 40 && plate.ways && !plate.film) this.drawWays(plate.ways);
    this.drawThetaArms();
    this.drawPhiArms();
    this.drawBases();
    if (plate.view.pitch_px > 18) this.drawTargets();
    if (plate.view.pitch_px > 60) this.drawIds();
  }

  circle(x, y, radius) {
    this.context.moveTo(x + radius, y);
    this.context.arc(x, y, radius, 0, kFullCircle);
  }

  /** Paints (stroke or fill) the pieces that `add(u)` makes; it returns whether there was one. */
  paint(how, add) {
    const {context} = this;
    let pieces = 0;
    context.beginPath();
    for (const u of this.visible) {
      if (!add(u) || ++pieces % kMuchOfPath !== 0) continue;
      context[how]();
      context.beginPath();
    }
    context[how]();
  }

  drawObstacles() {
    const {context, plate: {view, fleet, colours}} = this;
    context.beginPath();
    for (const {x_mm, y_mm, radius_mm} of fleet.obstacles)
      this.circle(view.screenX(x_mm), view.screenY(y_mm), Math.max(3, radius_mm * view.scale));
    context.fillStyle = colours.obstacle;
    context.fill();
    context.lineWidth = 1;
    context.strokeStyle = colours.ink;
    context.stroke();
  }

  /** Where the fibres will go. */
  drawWays(ways) {
    const {context, plate} = this;
    const {view, colours} = plate;
    context.lineWidth = 1.2;
    context.strokeStyle = colours.moving;
    context.globalAlpha = 0.5;
    this.paint("stroke", (u) => {
      const way = plate.state[u] === State.moving ? ways.of(u) : null;
      if (!way) return false;
      context.moveTo(view.screenX(way[0]), view.screenY(way[1]));
      for (let k = 2; k < way.length; k += 2)
        context.lineTo(view.screenX(way[k]), view.screenY(way[k + 1]));
      return true;
    });
    context.globalAlpha = 1;
  }

  drawThetaArms() {
    const {context, plate} = this;
    const {view, fleet} = plate;
    context.lineCap = "butt";
    context.lineWidth = Math.min(4, Math.max(1, 0.025 * view.pitch_px));
    context.strokeStyle = plate.colours.link;
    this.paint("stroke", (u) => {
      if (Number.isNaN(plate.elbow_x[u])) return false;
      context.moveTo(view.screenX(fleet.x_mm[u]), view.screenY(fleet.y_mm[u]));
      context.lineTo(view.screenX(plate.elbow_x[u]), view.screenY(plate.elbow_y[u]));
      return true;
    });
  }

  drawPhiArms() {
    const {context, plate} = this;
    const {view, fleet} = plate;
    context.lineCap = "round";
    plate.theme.entries.forEach((entry, index) => {
      const width_mm = 2 * fleet.half_width_mm[0];
      context.strokeStyle = plate.colours[entry.colour];
      context.lineWidth = Math.max(1.5, width_mm * view.scale);
      this.paint("stroke", (u) => {
        if (plate.index[u] !== index || Number.isNaN(plate.fibre_x[u])) return false;
        context.moveTo(view.screenX(plate.elbow_x[u]), view.screenY(plate.elbow_y[u]));
        context.lineTo(view.screenX(plate.fibre_x[u]), view.screenY(plate.fibre_y[u]));
        return true;
      });
    });
  }

  drawBases() {
    const {context, plate} = this;
    const {view, fleet, colours} = plate;
    const size = Math.min(9, Math.max(2.5, 0.07 * view.pitch_px));
    const at = (u) => [view.screenX(fleet.x_mm[u]), view.screenY(fleet.y_mm[u])];
    const shapes = {
      [State.disabled]: (x, y) => context.rect(x - size, y - size, 2 * size, 2 * size),
      [State.unserved]: (x, y) => {
        context.moveTo(x, y - 1.4 * size);
        context.lineTo(x + 1.4 * size, y);
        context.lineTo(x, y + 1.4 * size);
        context.lineTo(x - 1.4 * size, y);
        context.closePath();
      },
    };
    const outlines = {
      [State.lost]: (x, y) => this.circle(x, y, size),
      [State.silent]: (x, y) => this.circle(x, y, size),
      [State.fault]: (x, y) => {
        context.moveTo(x - size, y - size);
        context.lineTo(x + size, y + size);
        context.moveTo(x - size, y + size);
        context.lineTo(x + size, y - size);
      },
    };
    context.fillStyle = colours.ink;
    this.paint("fill", (u) => {
      if (shapes[plate.state[u]] || outlines[plate.state[u]]) return false;
      this.circle(...at(u), Math.max(1, Math.min(6, 0.035 * view.pitch_px)));
      return true;
    });
    const names = {[State.disabled]: "disabled", [State.unserved]: "unserved", [State.lost]: "lost",
      [State.silent]: "silent", [State.fault]: "fault"};
    for (const [list, how] of [[shapes, "fill"], [outlines, "stroke"]]) {
      for (const state of Object.keys(list).map(Number)) {
        context.fillStyle = context.strokeStyle = colours[names[state]];
        context.lineWidth = Math.max(2, size / 3);
        this.paint(how, (u) => {
          if (plate.state[u] !== state) return false;
          list[state](...at(u));
          return true;
        });
      }
    }
  }

  drawTargets() {
    const {context, plate} = this;
    const {view, colours} = plate;
    const radius = Math.min(7, Math.max(1.5, 0.05 * view.pitch_px));
    context.lineWidth = radius < 3 ? 0.8 : 1.3;
    context.strokeStyle = colours.ink;
    this.paint("stroke", (u) => {
      const [x_mm, y_mm] = plate.targetOf(u);
      if (Number.isNaN(x_mm)) return false;
      this.circle(view.screenX(x_mm), view.screenY(y_mm), radius);
      return true;
    });
  }

  drawIds() {
    const {context, plate} = this;
    const {view, fleet, colours} = plate;
    context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    context.textAlign = "center";
    context.textBaseline = "top";
    context.lineJoin = "round";
    context.lineWidth = 3;
    for (const u of this.visible) {
      const x = view.screenX(fleet.x_mm[u]);
      const y = view.screenY(fleet.y_mm[u]) + Math.min(12, 0.06 * view.pitch_px) + 3;
      context.strokeStyle = colours.plate;
      context.strokeText(String(fleet.id[u]), x, y);
      context.fillStyle = colours.ink;
      context.fillText(String(fleet.id[u]), x, y);
    }
  }
}
