// The list beside the map: the newest hazards, by keyboard as well as by mouse.

import { byId, element } from './dom.js';
import { ago, percent, plural, utcTime } from './format.js';
import { REJECTED, stateLabel } from './hazard_state.js';
import { keepOneTabStop, moveFocus } from './list_focus.js';

const MAX_ROWS = 200;

export class HazardList {
  /** `onChoose(hazard)` is called for a click or Enter on a row. */
  constructor(catalogue, onChoose) {
    this.catalogue = catalogue;
    this.list = byId('hazard-list');
    this.count = byId('list-count');
    this.note = byId('list-note');
    this.fresh = new Set();
    this.rows = new Map();
    this.list.addEventListener('click', (event) => {
      const row = event.target.closest('button');
      if (row) onChoose(this.rows.get(row.dataset.hazard).hazard);
    });
    this.list.addEventListener('keydown', (event) => moveFocus(this.list, event));
  }

  /** Lights up the hazard's row when it is shown the next time. */
  markFresh(hazard) {
    this.fresh.add(hazard.id);
  }

  show(hazards, total) {
    const newest = hazards.sort((a, b) => b.updated - a.updated || b.sequence - a.sequence)
      .slice(0, MAX_ROWS);
    const focused = document.activeElement?.dataset?.hazard;
    this.arrange(newest);
    this.fresh.clear();
    const keeps = this.rows.get(focused);
    if (keeps && document.activeElement !== keeps.button) {
      keeps.button.focus({ preventScroll: true });
    }
    keepOneTabStop(this.list);
    this.count.textContent = hazards.length.toLocaleString('en');
    this.note.textContent = noteText(hazards.length, total);
  }

  focusHazard(id) {
    this.rows.get(id)?.button.focus();
  }

  /** Rows that stay keep their nodes and, unless overtaken, their place: a click on one of them
   * is never lost because something else changed meanwhile. */
  arrange(hazards) {
    const wanted = new Set(hazards.map((hazard) => hazard.id));
    for (const [id, row] of this.rows) {
      if (wanted.has(id)) continue;
      row.item.remove();
      this.rows.delete(id);
    }
    let next = this.list.firstChild;
    for (const hazard of hazards) {
      const row = this.rows.get(hazard.id) ?? this.add(hazard);
      this.fill(row, hazard);
      if (row.item === next) next = next.nextSibling;
      else this.list.insertBefore(row.item, next);
    }
  }

  add(hazard) {
    const time = element('time');
    const facts = element('span', { class: 'row-facts' });
    const badge = this.catalogue.badge(hazard.className, hazard.state);
    const button = element('button', {
      type: 'button', tabindex: '-1', 'data-hazard': hazard.id,
      class: this.fresh.has(hazard.id) ? 'row fresh' : 'row',
    },
    badge, element('span', { class: 'row-label' }, hazard.label), time, facts);
    const row = { item: element('li', {}, button), button, badge, time, facts, hazard };
    this.rows.set(hazard.id, row);
    return row;
  }

  fill(row, hazard) {
    row.hazard = hazard;
    row.time.dateTime = new Date(hazard.updated).toISOString();
    row.time.title = utcTime(hazard.updated);
    setText(row.time, ago(hazard.updated));
    row.badge.classList.toggle('hollow', hazard.state === 'candidate');
    row.badge.classList.toggle('struck', hazard.state === REJECTED.name);
    const state = hazard.state === 'active' ? '' : `${stateLabel(hazard.state)} \u00b7 `;
    setText(row.facts,
      `${state}${plural(hazard.sightings, 'report')} \u00b7 ${percent(hazard.confidence)} sure`);
  }
}

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function noteText(shown, total) {
  if (total === 0) return 'No hazards yet. They appear here the moment a vehicle reports one.';
  if (shown === 0) return 'No hazard matches the filters here.';
  return shown > MAX_ROWS ? `The newest ${MAX_ROWS} of ${shown.toLocaleString('en')}.` : '';
}
