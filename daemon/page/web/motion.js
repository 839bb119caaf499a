// Motions of plans as the daemon sends them (daemon/page/plan_motion.h).

const kFormat = 1;
const kUnitBytes = 16;
const kRowBytes = 12;

/** Rows of an axis: [begin_s, end_s, turn_rad] each. */
function rowsAt(view, at, count) {
  const rows = [];
  for (let k = 0; k < count; ++k)
    rows.push([view.getFloat32(at + k * kRowBytes, true),
      view.getFloat32(at + k * kRowBytes + 4, true), view.getFloat32(at + k * kRowBytes + 8, true)]);
  return rows;
}

const endOf = (begin, rows) => rows.reduce((angle, [, , turn]) => angle + turn, begin);

function motionAt(view, offset) {
  if (view.getUint8(offset + 4) !== kFormat) throw new Error("the daemon speaks another version");
  const count = view.getUint32(offset + 8, true);
  const motion = {end_s: view.getFloat32(offset + 12, true), units: new Map()};
  let at = offset + 16;
  for (let k = 0; k < count; ++k) {
    const begin = [view.getFloat32(at + 4, true), view.getFloat32(at + 8, true)];
    const theta = rowsAt(view, at + kUnitBytes, view.getUint8(at + 12));
    const phi = rowsAt(view, at + kUnitBytes + kRowBytes * theta.length, view.getUint8(at + 13));
    motion.units.set(view.getUint32(at, true), {begin, rows: [theta, phi],
      end: [endOf(begin[0], theta), endOf(begin[1], phi)],
      end_s: Math.max(theta.at(-1)?.[1] ?? 0, phi.at(-1)?.[1] ?? 0)});
    at += kUnitBytes + kRowBytes * (theta.length + phi.length);
  }
  return motion;
}

/** All motions of an answer, the oldest first: {end_s, units: Map(place -> {begin, end, rows})}. */
export function motionsIn(buffer) {
  const view = new DataView(buffer);
  const motions = [];
  for (let offset = 0; offset + 16 <= buffer.byteLength;) {
    motions.push(motionAt(view, offset));
    offset += 4 + view.getUint32(offset, true);
  }
  return motions;
}
