// What a click on a vehicle shows. The vehicle goes on driving while it is open, so the facts change
// in place and the buttons stay.

import { element } from '../dom.js';
import { ago, localTime, utcTime } from '../format.js';

/** Without news for so long a vehicle may be elsewhere and otherwise fast. */
const FRESH_MS = 15000;

export function isFresh(vehicle, now = Date.now()) {
  return now - vehicle.heard < FRESH_MS;
}

/** "36 km/h"; empty when it is unknown or was a while ago. */
export function speedText(vehicle) {
  if (!Number.isFinite(vehicle.speed) || !isFresh(vehicle)) return '';
  return `${Math.round(vehicle.speed * 3.6)} km/h`;
}

export class VehiclePopup {
  /** `extras` are what people can do with the vehicle. */
  constructor(vehicle, extras) {
    this.speed = element('dd');
    this.heard = element('time');
    this.node = element('article', { class: 'popup vehicle-popup', role: 'dialog', tabindex: '-1',
      'aria-label': vehicle.id, 'data-vehicle': vehicle.id },
    element('h3', { class: 'popup-title' },
      element('span', { class: 'vehicle-dot', 'aria-hidden': 'true' }),
      element('span', {}, vehicle.id)),
    element('dl', { class: 'facts' },
      ...(vehicle.drive ? [element('dt', {}, 'Drive'), element('dd', {}, vehicle.drive)] : []),
      element('dt', {}, 'Speed'), this.speed,
      element('dt', {}, 'Last heard'), element('dd', {}, this.heard)),
    ...extras);
    this.update(vehicle);
  }

  update(vehicle) {
    this.speed.textContent = speedText(vehicle) || 'not known now';
    this.heard.textContent = ago(vehicle.heard);
    this.heard.title = `${localTime(vehicle.heard)}, ${utcTime(vehicle.heard)}`;
  }
}
