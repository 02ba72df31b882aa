// The zones of a region: which is up, and since when one that is down was not heard; their outlines
// on the map, and the list of them.

import { byId, element, setText } from '../dom.js';
import { ago, localTime, plural, utcTime } from '../format.js';
import { ZoneLayer } from '../layers/zone_layer.js';
import { getJson } from '../zone_lists.js';

const RENEW_MS = 5000;

/** A zone as the page shows it, of a feature of the API. */
function zoneOf({ id, geometry, properties }) {
  const heard = properties.last_heard === null ? null : Date.parse(properties.last_heard);
  const isDown = properties.state !== 'up';
  return {
    id, isDown, heard, name: properties.name, hazards: properties.hazards,
    outlines: geometry === null ? [] : geometry.coordinates,
    note: heard === null ? 'Down, never heard' : `Down, last heard at ${localTime(heard)}`,
  };
}

export class ZoneView {
  /** `say(text)` tells it to those who listen. */
  constructor(map, say) {
    this.say = say;
    this.layer = new ZoneLayer(map);
    this.list = byId('zones');
    /** By id, as the page last showed them. */
    this.zones = new Map();
    this.rows = new Map();
    byId('zone-section').hidden = false;
    this.renew();
    setInterval(() => { if (!document.hidden) this.renew(); }, RENEW_MS);
    document.addEventListener('visibilitychange', () => { if (!document.hidden) this.renew(); });
  }

  async renew() {
    // A region that does not answer is shown by the page's own state.
    const answer = await getJson('/api/v1/zones').catch(() => null);
    if (answer === null) return;
    const zones = answer.features.map(zoneOf);
    this.layer.show(zones);
    this.showRows(zones);
    this.announce(zones);
    this.zones = new Map(zones.map((zone) => [zone.id, zone]));
  }

  showRows(zones) {
    const down = zones.filter(({ isDown }) => isDown).length;
    setText(byId('zone-count'), down === 0 ? String(zones.length)
      : `${down} of ${zones.length} down`);
    for (const zone of zones) this.showRow(zone);
    const wanted = new Set(zones.map(({ id }) => id));
    for (const [id, row] of this.rows) {
      if (wanted.has(id)) continue;
      row.node.remove();
      this.rows.delete(id);
    }
  }

  showRow(zone) {
    let row = this.rows.get(zone.id);
    if (!row) {
      row = { name: element('span', { class: 'row-label' }), note: element('span', { class: 'row-facts' }) };
      row.node = element('li', { class: 'zone-row', 'data-zone': zone.id },
        element('span', { class: 'zone-dot', 'aria-hidden': 'true' }), row.name, row.note);
      this.rows.set(zone.id, row);
      this.list.append(row.node);
    }
    row.node.dataset.state = zone.isDown ? 'down' : 'up';
    setText(row.name, zone.name);
    const since = zone.isDown && zone.heard !== null ? ` (${ago(zone.heard)})` : '';
    const hazards = plural(zone.hazards, 'hazard');
    setText(row.note, zone.isDown ? `${zone.note}${since} \u00b7 ${hazards}` : `Up \u00b7 ${hazards}`);
    row.note.title = zone.heard === null ? '' : utcTime(zone.heard);
  }

  announce(zones) {
    for (const zone of zones) {
      const known = this.zones.get(zone.id);
      if (!known || known.isDown === zone.isDown) continue;
      this.say(zone.isDown ? `Zone ${zone.name} is down` : `Zone ${zone.name} is up again`);
    }
  }
}
