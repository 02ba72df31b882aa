// Hazards that other zones tell their drivers of, right behind this zone's borders: outlined pins,
// and the way to the other zone's map, where officials decide about them.

import { element } from '../dom.js';
import { streetText } from '../format.js';
import { hazardOf } from '../hazard_record.js';
import { nearLongitude } from '../mercator.js';
import { facts, time } from '../popups/hazard_popup.js';
import { getJson } from '../zone_lists.js';
import { SignIcon } from './sign_layer.js';

const L = window.L;
const RENEW_MS = 5000;
/** Further away borders are a line, and pins would lie on each other. */
const LEAST_ZOOM = 13;

/** As those of the zone's own hazards. */
const POPUP = { minWidth: 296, maxWidth: 296, className: 'hazard-popup', offset: [0, -30] };

/** Only what a browser opens as a page becomes a link. */
function isWebAddress(text) {
  return /^https?:\/\//.test(text);
}

function popupOf(hazard, { zone_name: zone, map }, catalogue) {
  const street = streetText(hazard);
  const name = element('bdi', {}, zone);
  return element('article', { class: 'popup', role: 'dialog', tabindex: '-1', 'aria-label': hazard.label },
    element('h3', { class: 'popup-title' }, catalogue.badge(hazard.className, 'candidate'),
      element('span', {}, hazard.label)),
    facts([
      ['Zone', isWebAddress(map) ? element('a', { href: map, target: '_blank', rel: 'noopener' }, name) : name,
        element('span', { class: 'meaning' }, 'Another zone tells drivers of it and decides about it')],
      ...(street ? [['Street', street]] : []),
      ['Last seen', time(hazard.lastSeen)],
    ]));
}

export class NeighbourLayer {
  constructor(map, catalogue) {
    this.map = map;
    this.catalogue = catalogue;
    this.group = L.layerGroup();
    /** By zone and id: {marker, told}, told as the server's text. */
    this.markers = new Map();
    map.on('zoomend', () => this.showOrHide());
    this.showOrHide();
    this.renew();
    setInterval(() => { if (!document.hidden) this.renew(); }, RENEW_MS);
    document.addEventListener('visibilitychange', () => { if (!document.hidden) this.renew(); });
  }

  showOrHide() {
    if (this.map.getZoom() >= LEAST_ZOOM) this.group.addTo(this.map);
    else this.group.remove();
  }

  async renew() {
    // A zone that does not answer is shown by the page's own state; somebody may have to log in first.
    const answer = await getJson('/api/v1/neighbours').catch(() => null);
    if (answer === null) return;
    const wanted = new Set();
    for (const feature of answer.features) {
      const key = `${feature.properties.zone} ${feature.id}`;
      wanted.add(key);
      this.show(key, feature);
    }
    for (const [key, { marker }] of this.markers) {
      if (wanted.has(key)) continue;
      marker.remove();
      this.group.removeLayer(marker);
      this.markers.delete(key);
    }
  }

  show(key, feature) {
    const told = JSON.stringify(feature);
    const known = this.markers.get(key);
    if (known?.told === told) return;
    const hazard = hazardOf(feature);
    const place = [hazard.latitude, nearLongitude(hazard.longitude, this.map.getCenter().lng)];
    if (known) {
      known.told = told;
      known.marker.setLatLng(place).setPopupContent(popupOf(hazard, feature.properties, this.catalogue));
      return;
    }
    const icon = new SignIcon({
      name: `${hazard.label}, of zone ${feature.properties.zone_name}`,
      className: 'pin', iconSize: [34, 42], iconAnchor: [17, 40],
      build: (node) => {
        node.dataset.neighbour = feature.properties.zone;
        node.style.setProperty('--colour', this.catalogue.colour(hazard.className));
        node.append(this.catalogue.badge(hazard.className, 'candidate'));
      },
    });
    const marker = L.marker(place, { icon, keyboard: false })
      .bindPopup(popupOf(hazard, feature.properties, this.catalogue), POPUP);
    this.group.addLayer(marker);
    this.markers.set(key, { marker, told });
  }
}
