// The list beside the map: the newest hazards, by keyboard as well as by mouse.

import { byId, element } from './dom.js';
import { ago, percent, plural, utcTime } from './format.js';

const MAX_ROWS = 200;

export class HazardList {
  /** `onChoose(hazard)` is called for a click or Enter on a row. */
  constructor(catalogue, onChoose) {
    this.catalogue = catalogue;
    this.list = byId('hazard-list');
    this.count = byId('list-count');
    this.note = byId('list-note');
    this.fresh = new Set();
    this.byRow = new Map();
    this.list.addEventListener('click', (event) => {
      const row = event.target.closest('button');
      if (row) onChoose(this.byRow.get(row.dataset.hazard));
    });
    this.list.addEventListener('keydown', (event) => this.moveFocus(event));
  }

  /** Marks a hazard so that its row lights up when it is drawn the next time. */
  markFresh(hazard) {
    this.fresh.add(hazard.id);
  }

  show(hazards, total) {
    const newest = hazards.sort((a, b) => b.updated - a.updated || b.sequence - a.sequence)
      .slice(0, MAX_ROWS);
    const focused = document.activeElement?.dataset?.hazard;
    this.byRow = new Map(newest.map((hazard) => [hazard.id, hazard]));
    this.list.replaceChildren(...newest.map((hazard) => this.row(hazard)));
    this.fresh.clear();
    const rows = [...this.list.querySelectorAll('button')];
    const keeps = rows.find((row) => row.dataset.hazard === focused);
    (keeps ?? rows[0])?.setAttribute('tabindex', '0');
    keeps?.focus({ preventScroll: true });
    this.count.textContent = hazards.length.toLocaleString('en');
    this.note.textContent = noteText(hazards.length, total);
  }

  focusHazard(id) {
    this.rowOf(id)?.focus();
  }

  rowOf(id) {
    return [...this.list.querySelectorAll('button')].find((row) => row.dataset.hazard === id);
  }

  row(hazard) {
    const facts = [plural(hazard.sightings, 'sighting'), percent(hazard.confidence)];
    const when = element('time', {
      datetime: new Date(hazard.updated).toISOString(), title: utcTime(hazard.updated),
    }, ago(hazard.updated));
    return element('li', {}, element('button', {
      type: 'button', tabindex: '-1', 'data-hazard': hazard.id,
      class: this.fresh.has(hazard.id) ? 'row fresh' : 'row',
    },
    this.catalogue.badge(hazard.className),
    element('span', { class: 'row-label' }, hazard.label), when,
    element('span', { class: 'row-facts' }, facts.join(' \u00b7 '))));
  }

  /** One tab stop for the whole list; the arrows move within it. */
  moveFocus(event) {
    const rows = [...this.list.querySelectorAll('button')];
    const at = rows.indexOf(document.activeElement);
    const to = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: rows.length - 1 }[event.key];
    if (to === undefined || at < 0 || !rows[to]) return;
    event.preventDefault();
    rows[at].setAttribute('tabindex', '-1');
    rows[to].setAttribute('tabindex', '0');
    rows[to].focus();
  }
}

function noteText(shown, total) {
  if (total === 0) return 'No hazards yet. They appear here the moment a vehicle reports one.';
  if (shown === 0) return 'No hazard matches the filters here.';
  return shown > MAX_ROWS ? `The newest ${MAX_ROWS} of ${shown.toLocaleString('en')}.` : '';
}
