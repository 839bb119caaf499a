// Mouse, touch and keys on the plate: the wheel and two fingers zoom, dragging moves the view, a
// click selects.

const kDrag_px = 5;

export class Pointer {
  constructor(plate, onSelect, onView) {
    Object.assign(this, {plate, onSelect, onView});
    this.fingers = new Map();
    this.moved = false;
    const {canvas} = plate;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
    }, {passive: false});
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
      if (this.fingers.size === 1) {
        this.moved = false;
        this.down = [event.offsetX, event.offsetY];
      }
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.fingers.delete(event.pointerId));
    canvas.addEventListener("keydown", (event) => this.key(event));
    const buttons = {"zoom-in": () => this.zoom(1.5), "zoom-out": () => this.zoom(1 / 1.5),
      "zoom-all": () => this.all()};
    for (const [id, act] of Object.entries(buttons))
      document.getElementById(id).addEventListener("click", act);
  }

  changed() {
    this.plate.dirty = true;
    this.onView();
  }

  zoom(factor, x_px, y_px) {
    this.plate.view.zoom(factor, x_px, y_px);
    this.changed();
  }

  all() {
    this.plate.view.showAll();
    this.changed();
  }

  move(event) {
    const last = this.fingers.get(event.pointerId);
    if (!last) return;
    const now = [event.offsetX, event.offsetY];
    if (this.fingers.size === 2) {
      const [, other] = [...this.fingers].find(([id]) => id !== event.pointerId);
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      this.moved = true;
      this.plate.view.zoom(apart(now) / Math.max(1, apart(last)), (now[0] + other[0]) / 2,
          (now[1] + other[1]) / 2);
      this.changed();
    } else if (this.moved || Math.hypot(now[0] - this.down[0], now[1] - this.down[1]) > kDrag_px) {
      this.moved = true;
      this.plate.view.pan(now[0] - last[0], now[1] - last[1]);
      this.changed();
    }
    this.fingers.set(event.pointerId, now);
  }

  up(event) {
    if (!this.fingers.delete(event.pointerId) || this.moved || this.fingers.size > 0) return;
    this.onSelect(this.plate.unitAt(event.offsetX, event.offsetY));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = 60;
    const acts = {
      "+": () => this.zoom(1.5), "=": () => this.zoom(1.5), "-": () => this.zoom(1 / 1.5),
      "0": () => this.all(),
      ArrowLeft: () => this.pan(step, 0), ArrowRight: () => this.pan(-step, 0),
      ArrowUp: () => this.pan(0, step), ArrowDown: () => this.pan(0, -step),
      Escape: () => this.onSelect(-1),
    };
    if (!acts[event.key]) return;
    event.preventDefault();
    acts[event.key]();
  }

  pan(dx_px, dy_px) {
    this.plate.view.pan(dx_px, dy_px);
    this.changed();
  }
}
