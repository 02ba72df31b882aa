// Map changes on the map: squares, so that nobody takes them for hazards, with a plus for what
// appeared and a minus for what vanished, in the colour of the class.

import { inkOn } from './catalogue.js';
import { element, svgElement } from './dom.js';
import { HazardLayer } from './hazard_layer.js';

const L = window.L;
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

const ChangeIcon = L.Icon.extend({
  options: { className: 'change', iconSize: [26, 26], iconAnchor: [13, 13], popupAnchor: [0, -12] },

  createIcon() {
    const { change } = this.options;
    const node = element('div', { title: change.title }, changeBadge(change));
    this._setIconStyles(node, 'icon');
    return node;
  },

  createShadow() {
    return null;
  },
});

const ChangeClusterIcon = L.Icon.extend({
  options: { className: 'change-cluster', iconSize: [34, 34] },

  createIcon() {
    const { count } = this.options;
    const node = element('div', { title: `${count} map changes` }, String(count));
    this._setIconStyles(node, 'icon');
    return node;
  },

  createShadow() {
    return null;
  },
});

/** Moves, opens and gathers markers as the layer of hazards does. */
export class ChangeLayer extends HazardLayer {
  setVisible(visible) {
    if (visible) this.group.addTo(this.map);
    else this.group.remove();
  }

  icon(change) {
    return new ChangeIcon({ change });
  }

  clusterIcon(cluster) {
    return new ChangeClusterIcon({ count: cluster.getChildCount() });
  }
}
