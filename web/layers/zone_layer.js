// The zones of a region under the hazards: their outlines, one that is down in grey.

import { element, setText } from '../dom.js';
import { nearLongitude } from '../mercator.js';

const L = window.L;

export class ZoneLayer {
  constructor(map) {
    this.map = map;
    /** By the zone's id: {polygon, label}. */
    this.zones = new Map();
    map.createPane('zones').style.zIndex = 250;
  }

  /** `zones`: as ZoneView has them; one without an outline is not drawn. */
  show(zones) {
    const wanted = new Set(zones.map(({ id }) => id));
    for (const [id, { polygon }] of this.zones) {
      if (wanted.has(id)) continue;
      polygon.remove();
      this.zones.delete(id);
    }
    for (const zone of zones) {
      if (zone.outlines.length > 0) this.showOne(zone);
    }
  }

  showOne(zone) {
    let drawn = this.zones.get(zone.id);
    if (!drawn) {
      drawn = this.draw(zone);
      this.zones.set(zone.id, drawn);
    }
    drawn.polygon.getElement()?.classList.toggle('zone-down', zone.isDown);
    drawn.label.classList.toggle('zone-down', zone.isDown);
    setText(drawn.name, zone.name);
    setText(drawn.note, zone.isDown ? zone.note : '');
    // Leaflet puts it in the middle by the width that it has.
    drawn.polygon.getTooltip().update();
  }

  draw(zone) {
    const middle = this.map.getCenter().lng;
    const rings = zone.outlines.map((ring) => {
      // All of a ring on one side of the map.
      const shift = nearLongitude(ring[0][0], middle) - ring[0][0];
      return ring.map(([longitude, latitude]) => [latitude, longitude + shift]);
    });
    const polygon = L.polygon(rings, { pane: 'zones', interactive: false, className: 'zone-area' })
      .addTo(this.map);
    const name = element('span', { class: 'zone-name' });
    const note = element('span', { class: 'zone-note' });
    const label = element('div', { class: 'zone-label' }, name, note);
    polygon.bindTooltip(label, { permanent: true, direction: 'center', className: 'zone-tooltip',
      interactive: false, pane: 'zones' });
    return { polygon, label, name, note };
  }
}
