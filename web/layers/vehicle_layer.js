// Vehicles: a red marker whose tip points where it drives, behind it the trail of blue dots.

import { byId, element, setText, svgElement } from '../dom.js';
import { ago } from '../format.js';
import { nearLongitude, unitX } from '../mercator.js';
import { whenStill } from './still_map.js';
import { Trail, TrailCanvas, paintDots, paintRoad } from './trail_canvas.js';
import { VehiclePopup, isFresh, speedText } from '../popups/vehicle_popup.js';

const L = window.L;
const SPACING_M = 5;
const MAX_DOTS = 2000;
const MAX_ROAD_POINTS = 20000;
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
    const name = `Vehicle ${this.options.vehicle}`;
    const icon = element('button', { type: 'button', 'aria-label': name }, arrow);
    this._setIconStyles(icon, 'icon');
    icon.classList.add('sign');
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
    this.roads = new TrailCanvas('roads', (...canvas) => this.paintRoads(...canvas));
    this.trails = new TrailCanvas('trails', (...canvas) => this.paintTrails(...canvas));
    if (showRoads) this.roads.addTo(map);
    this.trails.addTo(map);
    map.on('dragstart', () => this.follow(null));
    map.on('moveend', () => this.moveIntoView());
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.roads.drawSoon());
  }

  /** Takes the list's feature with its trail, or the stream's without. */
  put(feature) {
    const { properties } = feature;
    const id = String(properties.vehicle);
    const vehicle = this.vehicles.get(id) ?? this.add(id);
    const [longitude, latitude] = feature.geometry.coordinates;
    const here = L.latLng(latitude, nearLongitude(longitude, this.map.getCenter().lng));
    vehicle.longitude = longitude;
    vehicle.latitude = latitude;
    if (properties.trail) this.replaceTrail(vehicle, properties.trail);
    this.extendTrail(vehicle, longitude, latitude);
    vehicle.heard = Date.parse(properties.heard);
    vehicle.speed = properties.speed_mps;
    vehicle.drive = String(properties.drive ?? '');
    vehicle.marker.setLatLng(here);
    this.updateStop(vehicle.marker);
    this.turn(vehicle, properties.course_rad);
    if (this.followed === id) this.map.panTo(here, { animate: false });
    this.updateRow(vehicle);
  }

  /** [longitude, latitude] of all that is drawn. */
  places() {
    return [...this.vehicles.values()].flatMap((vehicle) => [
      [vehicle.longitude, vehicle.latitude],
      ...vehicle.trail.points.map(({ longitude, latitude }) => [longitude, latitude]),
    ]);
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
    whenStill(this.map, () => {
      if (this.followed !== id) return;
      // At once: the popup would stop a map that still glides.
      this.map.setView(vehicle.marker.getLatLng(), Math.max(this.map.getZoom(), 16),
        { animate: false });
      vehicle.marker.openPopup();
    });
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
    const marker = L.marker([0, 0],
      { icon: new VehicleIcon({ vehicle: id }), zIndexOffset: 2000, keyboard: false });
    marker.bindTooltip(() => element('span', {}, id), { direction: 'top', offset: [0, -14] });
    marker.bindPopup(() => {
      vehicle.popup = new VehiclePopup(vehicle, this.extras(vehicle));
      return vehicle.popup.node;
    }, { minWidth: 240, maxWidth: 280, className: 'vehicle-window', offset: [0, -8] });
    // Enter clicks a button; Leaflet would open the popup for the key, and close it for the click.
    marker.off('keypress', marker._onKeyPress, marker);
    marker.on('popupopen', () => {
      // Once it is in view the map does not run after it, unless it is followed.
      marker.getPopup().options.autoPan = false;
      if (document.activeElement === marker.getElement()) {
        vehicle.popup.node.focus({ preventScroll: true });
      }
    });
    marker.on('popupclose', () => {
      marker.getPopup().options.autoPan = true;
      const held = vehicle.popup?.node.contains(document.activeElement);
      vehicle.popup = null;
      if (held || document.activeElement === document.body) {
        (this.followed === id ? button : marker.getElement())?.focus({ preventScroll: true });
      }
    });
    const facts = element('span', { class: 'row-facts' });
    const button = element('button', { type: 'button', class: 'row', 'aria-pressed': 'false',
      title: 'Follow this vehicle on the map' },
    element('span', { class: 'vehicle-dot', 'aria-hidden': 'true' }),
    element('span', { class: 'row-label' }, id), facts);
    const vehicle = { id, marker, trail: new Trail(), road: new Trail(), facts, button, heard: NaN,
      speed: null, drive: '', popup: null, longitude: NaN, latitude: NaN };
    button.addEventListener('click', () => this.follow(id));
    marker.addTo(this.map);
    this.vehicles.set(id, vehicle);
    byId('vehicles').append(element('li', {}, button));
    byId('vehicle-section').hidden = false;
    return vehicle;
  }

  updateRow(vehicle) {
    const speed = speedText(vehicle);
    setText(vehicle.facts, `${speed}${speed && ' \u00b7 '}${ago(vehicle.heard)}`);
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
    vehicle.trail = new Trail();
    vehicle.road = new Trail();
    for (const [longitude, latitude] of positions) {
      this.extendTrail(vehicle, longitude, latitude);
    }
  }

  extendTrail(vehicle, longitude, latitude) {
    const { points } = vehicle.trail;
    const last = points[points.length - 1];
    const step = last
      ? this.map.distance([last.latitude, last.longitude], [latitude, longitude]) : Infinity;
    if (step < SPACING_M) return;
    vehicle.trail.add(longitude, latitude, step > GAP_M);
    if (points.length > MAX_DOTS) points.shift();
    // The road stays when the dots' oldest go: it is this page's only map.
    if (this.showRoads) vehicle.road.add(longitude, latitude, step > GAP_M);
    if (vehicle.road.points.length > MAX_ROAD_POINTS) vehicle.road.points.shift();
    this.trails.drawSoon();
    if (this.showRoads) this.roads.drawSoon();
  }

  paintTrails(context, project, extent) {
    const centre = unitX(this.map.getCenter().lng);
    for (const { trail } of this.vehicles.values()) {
      paintDots(context, trail.points, trail.worlds(centre), project, extent);
    }
  }

  paintRoads(context, project, extent) {
    const centre = unitX(this.map.getCenter().lng);
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    const styles = [[17, colour('--road-edge')], [13, colour('--road')]];
    for (const { road } of this.vehicles.values()) {
      paintRoad(context, road.points, road.worlds(centre), project, extent, styles);
    }
  }

  /** Who went around the world by dragging finds the vehicles there, too. */
  moveIntoView() {
    const centre = this.map.getCenter().lng;
    for (const { marker } of this.vehicles.values()) {
      const { lat, lng } = marker.getLatLng();
      const near = nearLongitude(lng, centre);
      if (near !== lng) marker.setLatLng([lat, near]);
      this.updateStop(marker);
    }
  }

  /** Tab reaches what is in view, nothing else: the browser would scroll to it. */
  updateStop(marker) {
    const inView = this.map.getBounds().contains(marker.getLatLng());
    marker.getElement()?.setAttribute('tabindex', inView ? '0' : '-1');
  }
}
