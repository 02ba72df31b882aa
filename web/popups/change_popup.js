// What a click on a map change shows.

import { changeBadge } from '../layers/change_layer.js';
import { element } from '../dom.js';
import { percent, plural, position } from '../format.js';
import { facts, time } from './hazard_popup.js';

/** The zone counts so many vehicles. */
const MOST_VEHICLES = 16;

const STATES = {
  proposed: { label: 'Proposed', meaning: 'One vehicle says so' },
  confirmed: { label: 'Confirmed', meaning: 'Two vehicles say so, or an official' },
  undone: { label: 'Undone', meaning: 'The opposite was told later' },
  dismissed: { label: 'Dismissed', meaning: 'An official says it is none' },
};

export function changeStateLabel(name) {
  return STATES[name]?.label ?? name;
}

function vehicles(change) {
  if (change.vehicles >= MOST_VEHICLES) return `${MOST_VEHICLES} vehicles or more`;
  return change.vehicles === 0 ? 'no vehicle that counts' : plural(change.vehicles, 'vehicle');
}

/** The popup's content as a detached element; `extras` are what people can do with it. */
export function changePopup(change, extras) {
  const sigma = change.sigma === null ? '' : ` \u00b1 ${change.sigma.toFixed(1)} m`;
  const state = element('span', { class: `state change-${change.state}` },
    changeStateLabel(change.state));
  return element('article', {
    class: 'popup', role: 'dialog', tabindex: '-1', 'aria-label': change.title,
    'data-change': change.id,
  },
  element('h3', { class: 'popup-title' }, changeBadge(change),
    element('span', {}, change.title)),
  facts([
    ['State', state, element('span', { class: 'meaning' }, STATES[change.state]?.meaning ?? '')],
    ['What happened', change.vanished
      ? 'It vanished: earlier drives had it' : 'It appeared: earlier drives had it not'],
    ['Position', element('span', { class: 'copyable' },
      position(change.latitude, change.longitude)), sigma],
    ['First seen', time(change.firstSeen)],
    ['Last seen', time(change.lastSeen)],
    ['Told by', `${vehicles(change)}, ${plural(change.drives, 'drive')}`],
    ...(change.against === 0 ? [] : [['Against it', plural(change.against, 'vehicle')]]),
    ['Confidence', percent(change.confidence)],
  ]),
  ...extras);
}
