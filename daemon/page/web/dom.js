// Small steps with the document. Texts from outside become text nodes, never markup.

export const find = (id) => document.getElementById(id);

/** An element with attributes and children: texts or elements. */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && typeof value !== "string") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** These are the children now. One that stays in its place keeps the focus. */
export function arrange(parent, elements) {
  let at = parent.firstElementChild;
  for (const element of elements) {
    if (element === at) at = at.nextElementSibling;
    else parent.insertBefore(element, at);
  }
  while (at) {
    const gone = at;
    at = at.nextElementSibling;
    gone.remove();
  }
}

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Sets a property where it has another value. A browser lays a page out anew for a class or a value
 * that is written again, and each second of it is felt at rest.
 */
export function set(element, name, value) {
  if (element[name] !== value) element[name] = value;
}

/** Seconds in words that are easy to read: 8.4 s, 3 min 20 s, 2 h 5 min. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** A count with its noun: 1 unit, 5,000 units. */
export function counted(count, one, many = `${one}s`) {
  return `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
}

export function micrometres(um) {
  if (!Number.isFinite(um)) return "–";
  return um < 1000 ? `${um.toFixed(um < 10 ? 1 : 0)} µm` : `${(um / 1000).toFixed(1)} mm`;
}

/** The time of day of an instant of the daemon, in UTC like its logs. */
export function clock(iso) {
  return iso ? `${iso.slice(0, 10)} ${iso.slice(11, 19)}` : "–";
}

/** The same without the year, where there is little room. */
export function dayAndClock(iso) {
  return clock(iso).slice(5);
}
