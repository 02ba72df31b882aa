// Vehicles: a red marker whose tip points where it drives, behind it the trail of blue dots.

import { byId, element, svgElement } from './dom.js';
import { ago } from './format.js';
import { VehiclePopup, isFresh, speedText } from './vehicle_popup.js';

const L = window.L;
const SPACING_M = 5;
const MAX_DOTS = 2000;
/** A greater jump between two positions is no road that was driven. */
const GAP_M = 250;

const VehicleIcon = L.Icon.extend({
  options: { className: 'vehicle', iconSize: [34, 34], iconAnchor: [17, 17] },

  createIcon() {
    const arrow = svgElement('svg', { viewBox: '0 0 34 34', width: 34, height: 34 },
      svgElement('path', { class: 'vehicle-drop',
        d: 'M17 0 C19 6 26.5 9 26.5 17 A9.5 9.5 0 0 1 7.5 17 C7.5 9 15 6 17 0 Z' }),
      svgElement('circle', { class: 'vehicle-disc', cx: 17, cy: 17, r: 8.5 }),
      svgElement('circle', { class: 'vehicle-eye', cx: 17, cy: 17, r: 3.5 }));
    const icon = element('div', {}, arrow);
    this._setIconStyles(icon, 'icon');
    return icon;
  },

  createShadow() {
    return null;
  },
});

export class VehicleLayer {
  /** `showRoads` draws the driven way as a road under the dots, where no map tiles do.
   * `extras(vehicle)` answers what people can do with it, for its popup. */
  constructor(map, showRoads, extras) {
    this.map = map;
    this.showRoads = showRoads;
    this.extras = extras;
    this.vehicles = new Map();
    this.followed = null;
    map.createPane('roads').style.zIndex = 350;
    map.createPane('trails').style.zIndex = 410;
    this.roadCanvas = L.canvas({ pane: 'roads', padding: 0.5 });
    this.trailCanvas = L.canvas({ pane: 'trails', padding: 0.5 });
    map.on('dragstart', () => this.follow(null));
  }

  /** Takes the list's feature with its trail, or the stream's without. */
  put(feature) {
    const { properties } = feature;
    const id = String(properties.vehicle);
    const vehicle = this.vehicles.get(id) ?? this.add(id);
    const [longitude, latitude] = feature.geometry.coordinates;
    const here = L.latLng(latitude, longitude);
    if (properties.trail) this.replaceTrail(vehicle, properties.trail);
    this.extendTrail(vehicle, here);
    vehicle.heard = Date.parse(properties.heard);
    vehicle.speed = properties.speed_mps;
    vehicle.drive = String(properties.drive ?? '');
    vehicle.marker.setLatLng(here);
    this.turn(vehicle, properties.course_rad);
    if (this.followed === id) this.map.panTo(here, { animate: false });
    this.updateRow(vehicle);
  }

  bounds() {
    const bounds = L.latLngBounds([]);
    for (const vehicle of this.vehicles.values()) {
      for (const dot of vehicle.dots) bounds.extend(dot.getLatLng());
      bounds.extend(vehicle.marker.getLatLng());
    }
    return bounds;
  }

  follow(id) {
    this.followed = this.followed === id ? null : id;
    for (const vehicle of this.vehicles.values()) {
      vehicle.button.setAttribute('aria-pressed', String(vehicle.id === this.followed));
    }
    const vehicle = this.vehicles.get(this.followed);
    if (!vehicle) {
      this.vehicles.get(id)?.marker.closePopup();
      return;
    }
    // At once: the popup would stop a map that still glides.
    this.map.setView(vehicle.marker.getLatLng(), Math.max(this.map.getZoom(), 16),
      { animate: false });
    vehicle.marker.openPopup();
  }

  /** The control of this name in the vehicle's open popup, else the popup itself. */
  focusPopup(id, name) {
    const node = this.vehicles.get(id)?.popup?.node;
    (node?.querySelector(`[data-focus="${name}"]`) ?? node)?.focus({ preventScroll: true });
  }

  updateRows() {
    for (const vehicle of this.vehicles.values()) this.updateRow(vehicle);
  }

  add(id) {
    const marker = L.marker([0, 0], { icon: new VehicleIcon(), zIndexOffset: 2000, keyboard: false });
    marker.bindTooltip(() => element('span', {}, id), { direction: 'top', offset: [0, -14] });
    marker.bindPopup(() => {
      vehicle.popup = new VehiclePopup(vehicle, this.extras(vehicle));
      return vehicle.popup.node;
    }, { minWidth: 240, maxWidth: 280, className: 'vehicle-window', offset: [0, -8] });
    // Once it is in view the map does not run after it, unless it is followed.
    marker.on('popupopen', () => { marker.getPopup().options.autoPan = false; });
    marker.on('popupclose', () => {
      marker.getPopup().options.autoPan = true;
      vehicle.popup = null;
    });
    const facts = element('span', { class: 'row-facts' });
    const button = element('button', { type: 'button', class: 'row', 'aria-pressed': 'false',
      title: 'Follow this vehicle on the map' },
    element('span', { class: 'vehicle-dot', 'aria-hidden': 'true' }),
    element('span', { class: 'row-label' }, id), facts);
    const vehicle = { id, marker, dots: [], road: null, facts, button, heard: NaN, speed: null,
      drive: '', popup: null };
    button.addEventListener('click', () => this.follow(id));
    marker.addTo(this.map);
    this.vehicles.set(id, vehicle);
    byId('vehicles').append(element('li', {}, button));
    byId('vehicle-section').hidden = false;
    return vehicle;
  }

  updateRow(vehicle) {
    const speed = speedText(vehicle);
    vehicle.facts.textContent = `${speed}${speed && ' \u00b7 '}${ago(vehicle.heard)}`;
    vehicle.marker.getElement()?.classList.toggle('silent', !isFresh(vehicle));
    vehicle.popup?.update(vehicle);
  }

  turn(vehicle, course) {
    const node = vehicle.marker.getElement()?.firstElementChild;
    if (!node) return;
    const known = Number.isFinite(course);
    node.classList.toggle('standing', !known);
    if (known) node.style.transform = `rotate(${course}rad)`;
  }

  replaceTrail(vehicle, positions) {
    for (const dot of vehicle.dots) dot.remove();
    vehicle.dots = [];
    vehicle.road?.remove();
    vehicle.road = null;
    for (const [longitude, latitude] of positions) {
      this.extendTrail(vehicle, L.latLng(latitude, longitude));
    }
  }

  extendTrail(vehicle, here) {
    const last = vehicle.dots[vehicle.dots.length - 1]?.getLatLng();
    const step = last ? this.map.distance(last, here) : Infinity;
    if (step < SPACING_M) return;
    const dot = L.circleMarker(here, {
      renderer: this.trailCanvas, radius: 3, weight: 1, color: '#ffffff', opacity: 0.9,
      fillColor: '#1f6feb', fillOpacity: 1, interactive: false,
    });
    vehicle.dots.push(dot.addTo(this.map));
    if (this.showRoads) this.extendRoad(vehicle, here, step > GAP_M);
    if (vehicle.dots.length > MAX_DOTS) vehicle.dots.shift().remove();
  }

  /** The road stays when the dots' oldest go: it is this page's only map. */
  extendRoad(vehicle, here, jump) {
    if (!vehicle.road || jump) {
      const style = getComputedStyle(document.documentElement);
      const line = (weight, name) => L.polyline([here], {
        renderer: this.roadCanvas, weight, color: style.getPropertyValue(name).trim(),
        interactive: false, smoothFactor: 1.5,
      }).addTo(this.map);
      vehicle.road = L.layerGroup([line(17, '--road-edge'), line(13, '--road')]);
      return;
    }
    vehicle.road.eachLayer((line) => line.addLatLng(here));
  }
}
