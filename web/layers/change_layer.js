// Map changes on the map: squares, so that nobody takes them for hazards, with a plus for what
// appeared and a minus for what vanished, in the colour of the class.

import { inkOn } from '../catalogue.js';
import { element, svgElement } from '../dom.js';
import { plural } from '../format.js';
import { changeOf } from '../hazard_record.js';
import { SignLayer } from './sign_layer.js';
import { getJson } from '../zone_lists.js';

const PLUS = 'M3 10h14M10 3v14';
const MINUS = 'M3 10h14';

/** The square with its sign; dashed while only one vehicle says so. */
export function changeBadge(change) {
  const badge = element('span', {
    class: 'change-badge', 'aria-hidden': 'true', 'data-state': change.state,
    'data-direction': change.direction,
  }, svgElement('svg', { viewBox: '0 0 20 20', width: 14, height: 14 },
    svgElement('path', { d: change.vanished ? MINUS : PLUS, fill: 'none', stroke: 'currentColor',
      'stroke-width': 3.5, 'stroke-linecap': 'round' })));
  badge.style.setProperty('--colour', change.colour);
  badge.style.setProperty('--on-colour', inkOn(change.colour));
  return badge;
}

function lookOf(content, row) {
  return {
    offset: [0, -12],
    colour: ({ colour }) => colour,
    popup: content,
    load: async (id) => changeOf(await getJson(`/api/v1/changes/${id}`)),
    row,
    many: (count) => plural(count, 'map change'),

    sign(change) {
      return {
        name: change.title, className: 'change', iconSize: [26, 26], iconAnchor: [13, 13],
        build: (node) => node.append(changeBadge(change)),
      };
    },

    ring({ count }) {
      return {
        name: plural(count, 'map change'), className: 'change-cluster', iconSize: [34, 34],
        build: (node) => node.append(count.toLocaleString('en')),
      };
    },
  };
}

export class ChangeLayer extends SignLayer {
  /** As HazardLayer's. */
  constructor(map, data, content, row, coveredHeight) {
    super(map, data, 'changes', lookOf(content, row), coveredHeight);
  }
}
