// Times of day to which alarms are muted, in UTC. Nobody tells the page where the telescope is: an
// operator gives the time of dawn once, and the browser keeps it until somebody gives another.

const kDawn = "focalfleet.dawn_utc";

/** A time of day as people write it (5:30, 0530, 05:30) as 05:30; null: it is none. */
export function timeOfDay(text) {
  const found = /^([01]?\d|2[0-3]):?([0-5]\d)$/.exec(text.trim());
  return found ? `${found[1].padStart(2, "0")}:${found[2]}` : null;
}

/** Seconds until it is that time of day in UTC: today, or tomorrow. Units: s. */
export function secondsUntil(time, now_ms) {
  const [hours, minutes] = time.split(":").map(Number);
  const at = new Date(now_ms);
  at.setUTCHours(hours, minutes, 0, 0);
  const rest_s = Math.ceil((at.getTime() - now_ms) / 1000);  // not a second too early
  return rest_s > 0 ? rest_s : rest_s + 24 * 3600;
}

/** The time of dawn that was given last; empty: none was, or the browser keeps nothing. */
export function dawn() {
  try {
    return localStorage.getItem(kDawn) ?? "";
  } catch {
    return "";
  }
}

export function keepDawn(time) {
  try {
    localStorage.setItem(kDawn, time);
  } catch {
    // It is asked for the next time.
  }
}
