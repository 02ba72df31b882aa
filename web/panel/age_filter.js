// Shows only hazards of some age: since when they are known, or since when nothing new was heard of them.

import { byId, element } from '../dom.js';

const DAY_MS = 86400000;
/** The ages move on while the page is open. */
const RENEW_MS = 60000;
/** `time`: of the hazard's record; `within` or `beyond`: so many days ago at most or at least. */
const AGES = [
  { label: 'Any age' },
  { label: 'First seen in the last 24 hours', time: 'firstSeen', within: 1 },
  { label: 'First seen in the last 7 days', time: 'firstSeen', within: 7 },
  { label: 'First seen in the last 30 days', time: 'firstSeen', within: 30 },
  { label: 'First seen more than 7 days ago', time: 'firstSeen', beyond: 7 },
  { label: 'First seen more than 30 days ago', time: 'firstSeen', beyond: 30 },
  { label: 'Nothing new for 24 hours', time: 'updated', beyond: 1 },
  { label: 'Nothing new for 7 days', time: 'updated', beyond: 7 },
];

export class AgeFilter {
  /** `onAge({time, after, before})` shows only hazards whose time lies between, all with null. */
  constructor(onAge) {
    this.onAge = onAge;
    this.select = byId('age-filter');
    this.select.replaceChildren(...AGES.map(({ label }, at) => element('option', { value: at }, label)));
    this.select.addEventListener('change', () => this.tell());
    setInterval(() => { if (this.select.value !== '0') this.tell(); }, RENEW_MS);
  }

  tell() {
    const { time, within, beyond } = AGES[Number(this.select.value)];
    if (time === undefined) {
      this.onAge(null);
      return;
    }
    const now = Date.now();
    this.onAge({ time, after: within === undefined ? -Infinity : now - within * DAY_MS,
      before: beyond === undefined ? Infinity : now - beyond * DAY_MS });
  }
}
