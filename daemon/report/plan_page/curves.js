// Curves draws the power curves under the plate: total above, rails below, with the time as a
// cursor. The parts that do not change with time are drawn once to a separate canvas, and copied.

const kCurveMargins_px = {left: 52, right: 14, top: 16, bottom: 22, between: 16};

/** A round step of which about `count` fill the range. */
function roundStep(range, count) {
  const power = 10 ** Math.floor(Math.log10(range / count));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => range / step <= count);
}

class Curves {
  constructor(canvas, motion, power) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.still = document.createElement("canvas");
    this.makespan_s = Math.max(motion.makespan_s, 1e-9);
    this.power = power;
    this.emphasised = null;  // a rail's number
    this.resize();
  }

  resize() {
    Object.assign(this, fitCanvas(this.canvas));
    this.still.width = this.canvas.width;
    this.still.height = this.canvas.height;
    this.colours = readColours(this.canvas);
    this.drawStill();
  }

  x(t_s) {
    const {left, right} = kCurveMargins_px;
    return left + (this.width - left - right) * t_s / this.makespan_s;
  }

  timeAt(x_px) {
    const {left, right} = kCurveMargins_px;
    const share = (x_px - left) / Math.max(1, this.width - left - right);
    return this.makespan_s * Math.min(1, Math.max(0, share));
  }

  railColour(place) { return this.colours[`s${place % 7}`]; }

  /** The panels from top to bottom: curves with their colours and limits, and their space. */
  panels() {
    const {top, bottom, between} = kCurveMargins_px;
    const {total, rails} = this.power;
    const all = {title: "all rails, W", lines: [{curve: total, colour: this.colours.ink}]};
    const each = {
      title: rails.length === 1 ? `rail ${rails[0].rail}, W` : "each rail, W",
      lines: rails.map(({rail, curve, limit_W}, k) => ({
        curve, limit_W, colour: this.railColour(k), dashed: k % 14 >= 7,
        faint: this.emphasised !== null && this.emphasised !== rail,
        strong: this.emphasised === rail})),
    };
    const shown = rails.length > 1 ? [all, each] : [each];
    const shares = rails.length > 1 ? [0.4, 0.6] : [1];
    let top_px = top;
    shown.forEach((panel, k) => {
      const top_W = Math.max(1e-9, ...panel.lines.map(({curve, limit_W}) =>
        Math.max(curve.peak_W, limit_W || 0)));
      const height = shares[k] * (this.height - top - bottom - between * (shown.length - 1));
      Object.assign(panel, {top_px, height_px: height, max_W: 1.06 * top_W});
      panel.y = (watts) => panel.top_px + height * (1 - watts / panel.max_W);
      top_px += height + between;
    });
    return shown;
  }

  drawStill() {
    const context = this.still.getContext("2d");
    const ratio = this.canvas.width / Math.max(1, this.width);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = this.colours.paper;
    context.fillRect(0, 0, this.width, this.height);
    context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    const panels = this.panels();
    for (const panel of panels) this.drawPanel(context, panel);
    this.drawTimeAxis(context);
  }

  drawPanel(context, panel) {
    const {left, right} = kCurveMargins_px;
    const step = roundStep(panel.max_W, Math.max(2, panel.height_px / 22));
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (let k = 0; k * step <= panel.max_W; ++k) {
      const y = Math.round(panel.y(k * step)) + 0.5;
      this.strokeLine(context, [left, y, this.width - right, y], {colour: this.colours.grid});
      context.fillStyle = this.colours.muted;
      context.fillText(String(Number((k * step).toPrecision(6))), left - 6, y);
    }
    const lines = [...panel.lines].sort((a, b) => Boolean(a.strong) - Boolean(b.strong));
    for (const line of lines) this.drawSteps(context, panel, line);
    for (const line of panel.lines) this.drawLimit(context, panel, line);
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.fillStyle = this.colours.ink;
    context.fillText(panel.title, left, panel.top_px - 1);
  }

  strokeLine(context, [x0, y0, x1, y1], {colour, width = 1, dash = []}) {
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
  }

  drawLimit(context, panel, {limit_W, colour, faint}) {
    if (limit_W === undefined) return;
    const {left, right} = kCurveMargins_px;
    const y = panel.y(limit_W);
    context.globalAlpha = faint ? 0.25 : 1;
    this.strokeLine(context, [left, y, this.width - right, y],
        {colour, width: 1.4, dash: [8, 4]});
    context.globalAlpha = 1;
  }

  // Within one column of pixels only the lowest, the highest and the last step are drawn. No peak
  // is lost, and the path stays short.
  drawSteps(context, panel, {curve, colour, dashed, faint, strong}) {
    context.beginPath();
    context.moveTo(this.x(0), panel.y(0));
    let column = -1;
    let low = 0;
    let high = 0;
    let last = 0;
    const endColumn = () => {
      if (column < 0) return;
      context.lineTo(column, panel.y(low));
      context.lineTo(column, panel.y(high));
      context.lineTo(column, panel.y(last));
    };
    for (let k = 0; k < curve.time_s.length; ++k) {
      const x = Math.round(2 * this.x(curve.time_s[k])) / 2;
      const watts = curve.watts[k];
      if (x !== column) {
        endColumn();
        context.lineTo(x, panel.y(last));
        column = x;
        low = Math.min(last, watts);
        high = Math.max(last, watts);
      }
      low = Math.min(low, watts);
      high = Math.max(high, watts);
      last = watts;
    }
    endColumn();
    context.globalAlpha = faint ? 0.25 : 1;
    context.strokeStyle = colour;
    context.lineWidth = strong ? 2.4 : 1.3;
    context.lineJoin = "round";
    context.setLineDash(dashed ? [6, 3] : []);
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  drawTimeAxis(context) {
    const y = this.height - kCurveMargins_px.bottom;
    const step = roundStep(this.makespan_s, Math.max(2, this.width / 90));
    context.textAlign = "center";
    context.textBaseline = "top";
    context.fillStyle = this.colours.muted;
    for (let k = 0; k * step <= this.makespan_s * (1 + 1e-9); ++k) {
      const x = Math.round(this.x(k * step)) + 0.5;
      this.strokeLine(context, [x, y, x, y + 4], {colour: this.colours.muted});
      context.fillText(`${Number((k * step).toPrecision(6))} s`, x, y + 6);
    }
  }

  draw(t_s) {
    const {context} = this;
    context.drawImage(this.still, 0, 0, this.width, this.height);
    const x = this.x(t_s);
    const {top, bottom} = kCurveMargins_px;
    this.strokeLine(context, [x, top - 6, x, this.height - bottom],
        {colour: this.colours.moving, width: 2});
    for (const panel of this.panels()) {
      for (const {curve, colour, faint} of panel.lines) {
        if (faint) continue;
        context.beginPath();
        context.arc(x, panel.y(curve.at(t_s)), 3, 0, kFullCircle);
        context.fillStyle = colour;
        context.fill();
      }
    }
  }
}
