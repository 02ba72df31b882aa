// How numbers and times read for people.

const dateTime = new Intl.DateTimeFormat(undefined, { dateStyle: 'medium', timeStyle: 'medium' });
const relative = new Intl.RelativeTimeFormat('en', { numeric: 'always', style: 'short' });

const STEPS = [
  ['year', 31536000], ['month', 2592000], ['day', 86400], ['hour', 3600], ['minute', 60],
];

/** "5 min. ago"; everything within the last ten seconds is "just now". */
export function ago(time, now = Date.now()) {
  const seconds = Math.round((time - now) / 1000);
  if (Math.abs(seconds) < 10) return 'just now';
  for (const [unit, length] of STEPS) {
    if (Math.abs(seconds) >= length) return relative.format(Math.trunc(seconds / length), unit);
  }
  return relative.format(seconds, 'second');
}

export function localTime(time) {
  return Number.isFinite(time) ? dateTime.format(time) : 'unknown';
}

export function utcTime(time) {
  return Number.isFinite(time) ? new Date(time).toISOString().replace('T', ' ').replace('Z', ' UTC') : '';
}

/** "40.44330° N, 79.94360° W"; five digits are a metre. */
export function position(latitude, longitude, digits = 5) {
  return `${coordinate(latitude, 'N', 'S', digits)}, ${coordinate(longitude, 'E', 'W', digits)}`;
}

export function coordinate(degrees, positive, negative, digits) {
  return `${Math.abs(degrees).toFixed(digits)}\u00b0 ${degrees < 0 ? negative : positive}`;
}

/** "87 %", kept on one line. */
export function percent(share) {
  return `${Math.round(share * 100)}\u00a0%`;
}

export function plural(count, singular, many = `${singular}s`) {
  return `${count.toLocaleString('en')} ${count === 1 ? singular : many}`;
}

/** Which zones of a region a list lacks, because they are down or did not answer in time; empty for
 * none. A zone's own lists have no `missing`. */
export function missingText({ missing = [] }) {
  return missing.length === 0 ? '' : `Not heard: ${missing.join(', ')}.`;
}

/** Where on the streets a hazard lies: "Forbes Ave, near S Craig St, eastbound"; empty where nothing is
 * known of it. */
export function streetText({ street, near, bound }) {
  return [street, near && `near ${near}`, bound].filter(Boolean).join(', ');
}
