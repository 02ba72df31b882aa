// What officials decided, the newest first, for those who have logged in. A decision about a hazard
// that still stands can be taken back here.

import { OF_ORDERS } from '../desk/time_line.js';
import { byId, element } from '../dom.js';
import { ago, localTime, missingText, plural } from '../format.js';
import { hazardOf } from '../hazard_record.js';
import { session } from '../session.js';
import { getJson } from '../zone_lists.js';

const PAGE = 20;
const DONE = {
  confirm: 'Confirmed', reject: 'Rejected', dismiss: 'Dismissed', distrust: 'Distrusted',
  trust: 'Trusted again', undo: 'Took back a decision about', comment: 'Commented on',
  assign: 'Assigned', close: 'Closed as repaired', class: 'Changed the class of', move: 'Moved',
  merge: 'Merged', frame: 'Asked for a whole frame of', forget: 'Forgot',
  close_order: 'Closed a work order of', retry_order: 'Sent again a work order of',
};
const SUBJECTS = { hazard: 'a hazard', map_change: 'a map change' };

export class DecisionList {
  /** `onUndo(hazard, id)` asks whether the decision about the hazard is to be taken back. */
  constructor(onUndo) {
    this.onUndo = onUndo;
    this.section = byId('trail-section');
    this.list = byId('trail');
    this.note = byId('trail-note');
    this.more = byId('trail-more');
    this.next = null;
    this.section.hidden = session.name === null;
    this.section.addEventListener('toggle', () => { if (this.section.open) this.refresh(); });
    this.more.addEventListener('click', () => this.load(this.next));
  }

  /** After a decision, and when the list is opened. */
  refresh() {
    if (!this.section.hidden && this.section.open) this.load(null);
  }

  async load(before) {
    let told;
    try {
      told = await getJson(
        `/api/v1/decisions?limit=${PAGE}${before === null ? '' : `&before=${before}`}`);
    } catch (failure) {
      this.note.textContent = 'The decisions cannot be loaded.';
      return;
    }
    if (before === null) this.list.replaceChildren();
    this.list.append(...told.decisions.map((decision) => this.row(decision)));
    this.next = told.next;
    this.more.hidden = this.next === null;
    this.note.textContent = [this.list.childElementCount === 0 ? 'Nobody has decided anything yet.' : '',
      missingText(told)].filter((text) => text !== '').join(' ');
  }

  row(decision) {
    const time = Date.parse(decision.time);
    const subject = decision.decision === 'forget' ? 'a vehicle' : SUBJECTS[decision.about] ?? decision.subject;
    const changed = decision.about === 'vehicle' && decision.hazards > 0 ? `, ${plural(decision.hazards, 'hazard')} changed` : '';
    const detail = decision.detail ? ` ${decision.detail}` : '';
    const isUndone = decision.undone_by !== null;
    const row = element('li', { class: isUndone ? 'trail-row trail-undone' : 'trail-row',
      'data-decision': decision.id },
    element('span', { class: 'trail-what' }, `${DONE[decision.decision] ?? decision.decision} ${
      subject}${detail}${changed}`),
    element('time', { datetime: decision.time, title: localTime(time) }, ago(time)),
    element('span', { class: 'trail-who' }, [decision.official, decision.reason,
      isUndone ? 'taken back' : ''].filter((text) => text !== '').join(' \u00b7 ')));
    const mayUndo = session.decides() && !isUndone && decision.about === 'hazard'
      && decision.decision !== 'undo' && !OF_ORDERS.includes(decision.decision);
    if (mayUndo) {
      const undo = element('button', { class: 'quiet', type: 'button' }, 'Undo\u2026');
      undo.addEventListener('click', () => this.undo(decision));
      row.append(undo);
    }
    return row;
  }

  async undo({ id, subject }) {
    try {
      this.onUndo(hazardOf(await getJson(`/api/v1/hazards/${encodeURIComponent(subject)}`)), id);
    } catch (failure) {
      this.note.textContent = 'The zone does not know this hazard any more.';
    }
  }
}
