// Who mends what until when, for those who have logged in: the list, the overdue ones marked, and the
// filter "assigned to", which holds for map and list.

import { byId, element, setText } from '../dom.js';
import { missingText } from '../format.js';
import { hazardOf } from '../hazard_record.js';
import { session } from '../session.js';
import { getJson } from '../zone_lists.js';

const RENEW_MS = 30000;
const MAX_ROWS = 100;
const EVERY = '';
const OVERDUE = ' overdue';

export class AssignmentList {
  /** `onFilter(ids)` shows only hazards with these ids, all with null; `onChoose(hazard)`;
   * `onLoaded()` is called when the assignments are known anew. */
  constructor(onFilter, onChoose, onLoaded) {
    this.onFilter = onFilter;
    this.onChoose = onChoose;
    this.onLoaded = onLoaded;
    this.assignments = [];
    this.filtered = null;
    /** Of which zones of a region nothing is known now, in a sentence. */
    this.missing = '';
    this.section = byId('work-section');
    this.select = byId('work-filter');
    this.list = byId('work-list');
    const isSeen = session.name !== null;
    this.section.hidden = !isSeen;
    this.select.addEventListener('change', () => this.show());
    this.list.addEventListener('click', (event) => {
      const row = event.target.closest('button');
      if (row) this.choose(row.dataset.hazard);
    });
    if (!isSeen) return;
    this.refresh();
    setInterval(() => { if (!document.hidden) this.refresh(); }, RENEW_MS);
  }

  teams() {
    return [...new Set(this.assignments.map(({ team }) => team))].sort((a, b) => a.localeCompare(b));
  }

  of(hazardId) {
    return this.assignments.find(({ hazard }) => hazard === hazardId) ?? null;
  }

  async refresh() {
    if (this.section.hidden) return;
    try {
      const told = await getJson('/api/v1/assignments');
      this.assignments = told.assignments;
      this.missing = missingText(told);
    } catch (failure) {
      setText(byId('work-note'), 'The assignments cannot be loaded.');
      return;
    }
    const teams = this.teams();
    const chosen = this.select.value;
    const options = [[EVERY, 'Everybody and nobody'], [OVERDUE, 'Overdue'],
      ...teams.map((team) => [team, team])];
    if (chosen !== EVERY && chosen !== OVERDUE && !teams.includes(chosen)) options.push([chosen, chosen]);
    this.select.replaceChildren(...options.map(([value, label]) => element('option', { value }, label)));
    this.select.value = chosen;
    this.show();
    this.onLoaded();
  }

  show() {
    const chosen = this.select.value;
    const shown = this.assignments.filter(({ team, overdue }) => chosen === EVERY
      || (chosen === OVERDUE ? overdue : team === chosen));
    const late = this.assignments.filter(({ overdue }) => overdue).length;
    setText(byId('work-count'), late > 0 ? `${late} overdue` : String(this.assignments.length));
    byId('work-count').classList.toggle('overdue', late > 0);
    this.list.replaceChildren(...shown.slice(0, MAX_ROWS).map((one) => this.row(one)));
    const note = shown.length === 0 ? 'Nothing is assigned here.'
      : shown.length > MAX_ROWS ? `The first ${MAX_ROWS} of ${shown.length}.` : '';
    setText(byId('work-note'), [note, this.missing].filter((text) => text !== '').join(' '));
    const ids = chosen === EVERY ? null : shown.map(({ hazard }) => hazard);
    if (JSON.stringify(ids) === JSON.stringify(this.filtered)) return;
    this.filtered = ids;
    this.onFilter(ids);
  }

  row({ hazard, team, due, overdue }) {
    const when = due === null ? 'no day set' : `${overdue ? 'overdue since' : 'due'} ${due}`;
    return element('li', {}, element('button', { type: 'button', class: 'row', 'data-hazard': hazard },
      element('span', { class: overdue ? 'work-dot overdue' : 'work-dot', 'aria-hidden': 'true' }),
      element('span', { class: 'row-label' }, team),
      element('span', { class: overdue ? 'row-facts overdue' : 'row-facts' }, when)));
  }

  async choose(id) {
    try {
      this.onChoose(hazardOf(await getJson(`/api/v1/hazards/${encodeURIComponent(id)}`)));
    } catch (failure) {
      setText(byId('work-note'), 'The zone does not know this hazard any more.');
    }
  }
}
