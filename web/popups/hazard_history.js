// What happened to a hazard: fetched when somebody opens the history in its popup.

import { element } from '../dom.js';
import { localTime, utcTime } from '../format.js';
import { stateLabel } from '../hazard_state.js';
import { getJson } from '../zone_lists.js';

const MOST_EVENTS = 50;

export class HazardHistory {
  /** `onChange(id)` is called when the hazard's popup must be drawn anew. */
  constructor(onChange) {
    this.onChange = onChange;
    this.openId = null;
    this.sequence = null;
    this.events = null;
    this.failed = false;
  }

  /** The part of a popup that can be opened. */
  section(hazard) {
    const open = this.openId === hazard.id;
    if (open && this.sequence !== hazard.sequence) this.load(hazard);
    const details = element('details', { class: 'history', open: open ? '' : null },
      element('summary', { 'data-focus': 'history' }, 'History'), ...(open ? [this.content()] : []));
    details.ontoggle = ({ currentTarget }) => {
      if (currentTarget.open === (this.openId === hazard.id)) return;
      this.openId = currentTarget.open ? hazard.id : null;
      this.sequence = null;
      this.events = null;
      this.failed = false;
      this.onChange(hazard.id);
    };
    return details;
  }

  async load(hazard) {
    const { id, sequence } = hazard;
    this.sequence = sequence;
    let events = null;
    try {
      events = (await getJson(`/api/v1/hazards/${id}/events?limit=${MOST_EVENTS}`)).events;
    } catch (failure) {
      // Shown instead of the list.
    }
    if (this.openId !== id || this.sequence !== sequence) return;
    this.failed = events === null;
    this.events = events ?? this.events;
    this.onChange(id);
  }

  content() {
    if (this.failed) return element('p', { class: 'history-note' }, 'The history cannot be loaded');
    if (this.events === null) return element('p', { class: 'history-note' }, 'Loading');
    return element('ol', { class: 'history-list', tabindex: '0', 'aria-label': 'Newest first' },
      ...[...this.events].reverse().map(line));
  }
}

function line(event) {
  const time = Date.parse(event.time);
  const step = event.from === null || event.from === event.to
    ? stateLabel(event.to) : `${stateLabel(event.from)} \u2192 ${stateLabel(event.to)}`;
  return element('li', {},
    element('time', { datetime: event.time, title: utcTime(time) }, localTime(time)),
    element('span', { class: 'history-step' }, step),
    element('span', { class: 'history-reason' }, event.reason));
}
