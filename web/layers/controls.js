// Leaflet controls of our own: a button that shows everything, and the tiles' attribution.

import { element, svgElement } from '../dom.js';

const L = window.L;

export const FitControl = L.Control.extend({
  options: { position: 'bottomright' },

  initialize(onClick) {
    this.onClick = onClick;
  },

  onAdd() {
    const button = element('button', { type: 'button', title: 'Show everything',
      'aria-label': 'Show everything' },
    svgElement('svg', { viewBox: '0 0 18 18', width: 18, height: 18, 'aria-hidden': 'true' },
      svgElement('path', { d: 'M2 6.5V2h4.5M11.5 2H16v4.5M16 11.5V16h-4.5M6.5 16H2v-4.5',
        fill: 'none', stroke: 'currentColor', 'stroke-width': 2 })));
    button.addEventListener('click', this.onClick);
    const bar = element('div', { class: 'leaflet-bar fit-control' }, button);
    L.DomEvent.disableClickPropagation(bar);
    return bar;
  },
});

/** Leaflet's own control takes HTML; this one takes text. */
export const AttributionText = L.Control.extend({
  options: { position: 'bottomright' },

  initialize(text) {
    this.text = text;
  },

  onAdd() {
    return element('div', { class: 'attribution' }, this.text);
  },
});
