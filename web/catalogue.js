// What the page knows about classes of hazards: label, icon and colour.

import { element } from './dom.js';

/** Icons in icons/; a class that asks for another gets 'hazard'. */
const ICONS = new Set([
  'barrier', 'construction_machine', 'debris', 'deer', 'hazard', 'pothole', 'road_work_sign',
  'stopped_accident', 'traffic_cone',
]);

export const OTHER_LABEL = 'Other kinds';

export class Catalogue {
  constructor(answer) {
    this.fallback = answer.default;
    this.classes = new Map(answer.classes.map((entry) => [entry.class, entry]));
  }

  /** Label and colour of the worker's group: 0 is of all classes that are not in the catalogue. */
  group(number) {
    return [...this.classes.values()][number - 1] ?? { ...this.fallback, label: OTHER_LABEL };
  }

  label(className) {
    return this.classes.get(className)?.label ?? className;
  }

  icon(className) {
    const name = (this.classes.get(className) ?? this.fallback).icon;
    return ICONS.has(name) ? name : 'hazard';
  }

  colour(className) {
    return (this.classes.get(className) ?? this.fallback).colour;
  }

  /** A coloured disc with the class's icon; hollow for a candidate, struck out when rejected. */
  badge(className, state = 'active') {
    const look = { candidate: ' hollow', rejected: ' struck' }[state] ?? '';
    const badge = element('span', { class: `badge${look}`, 'aria-hidden': 'true' },
      element('span', { class: `glyph glyph-${this.icon(className)}` }));
    badge.style.setProperty('--colour', this.colour(className));
    badge.style.setProperty('--on-colour', inkOn(this.colour(className)));
    return badge;
  }
}

/** Dark or white, whichever reads better on the colour (WCAG relative luminance). */
export function inkOn(colour) {
  const channels = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  const luminance = 0.2126 * channels[0] + 0.7152 * channels[1] + 0.0722 * channels[2];
  return luminance > 0.4 ? '#1b222c' : '#ffffff';
}
