// What became of hazards, per class, street and week, for those who have logged in.

import { byId, element } from '../dom.js';
import { missingText, percent, plural } from '../format.js';
import { session } from '../session.js';
import { getJson } from '../zone_lists.js';

const SPANS = [[4, '4 weeks'], [12, '12 weeks'], [52, 'a year']];
const HOUR_S = 3600;
const DAY_S = 86400;

/** "3.5 days". */
export function durationText(seconds) {
  if (seconds < 2 * HOUR_S) return plural(Math.round(seconds / 60), 'minute');
  if (seconds < 2 * DAY_S) return plural(Math.round(seconds / HOUR_S), 'hour');
  return `${(seconds / DAY_S).toFixed(1)} days`;
}

function value(node, why) {
  return node === null ? element('abbr', { title: why }, '\u2013') : node;
}

function line(name, counts) {
  const { opened, confirmed, rejected, repaired, median_repair_s: median, precision } = counts;
  return element('tr', {}, element('th', { scope: 'row' }, name),
    ...[opened, confirmed, rejected, repaired].map((count) => element('td', {}, count.toLocaleString('en'))),
    element('td', {}, value(median === null ? null : durationText(median), counts.why_no_median_repair)),
    element('td', {}, value(precision === null ? null : percent(precision), counts.why_no_precision)));
}

function table(caption, first, lines) {
  const names = [first, 'Opened', 'Confirmed', 'Rejected', 'Repaired', 'Median to repair', 'Precision'];
  return element('table', { class: 'statistics' }, element('caption', {}, caption),
    element('thead', {}, element('tr', {}, ...names.map((name) => element('th', { scope: 'col' }, name)))),
    element('tbody', {}, ...lines));
}

export class StatisticsView {
  constructor() {
    const open = byId('statistics-open');
    open.hidden = session.name === null;
    open.addEventListener('click', () => this.open());
    this.dialog = null;
  }

  make() {
    this.span = element('select', { id: 'statistics-weeks' }, ...SPANS.map(
      ([weeks, label]) => element('option', { value: weeks }, label)));
    this.span.value = '12';
    this.body = element('div', { id: 'statistics-body', class: 'statistics-body', tabindex: '0' });
    const close = element('button', { class: 'decide', type: 'button', id: 'statistics-close' }, 'Close');
    this.dialog = element('dialog', { id: 'statistics', class: 'decision statistics-dialog',
      'aria-labelledby': 'statistics-title' },
    element('h2', { id: 'statistics-title' }, 'Statistics'),
    element('p', {}, element('label', { for: 'statistics-weeks' }, 'The last'), this.span),
    this.body, element('div', { class: 'decisions' }, close));
    document.body.append(this.dialog);
    this.span.addEventListener('change', () => this.load());
    close.addEventListener('click', () => this.dialog.close());
  }

  open() {
    if (this.dialog === null) this.make();
    this.dialog.showModal();
    this.load();
  }

  async load() {
    const weeks = this.span.value;
    this.body.replaceChildren(element('p', {}, 'Loading'));
    let told;
    try {
      told = await getJson(`/api/v1/statistics?weeks=${weeks}`);
    } catch (failure) {
      this.body.replaceChildren(element('p', { class: 'decision-error' }, 'The statistics cannot be loaded.'));
      return;
    }
    if (this.span.value !== weeks) return;
    this.body.replaceChildren(
      element('p', { class: 'decision-note' }, 'Precision is the share of the judged hazards that an '
        + 'official confirmed: confirmed / (confirmed + rejected). Each decision counts in its own week. '
        + missingText(told)),
      table('By class', 'Class', [...told.classes.map((one) => line(one.label, one)), line('All', told.all)]),
      table('By week, from Monday', 'Week', told.weeks.map((one) => line(one.week, one))),
      table(told.streets_cut ? 'By street, those with the most' : 'By street', 'Street',
        told.streets.map((one) => line(one.street ?? 'Not known', one))));
  }
}
