// The live map's page: puts map, panel and live feed together.

import { Catalogue } from './catalogue.js';
import { ClassFilter, StateFilter } from './class_filter.js';
import { ChangeView } from './change_view.js';
import { AttributionText, FitControl } from './controls.js';
import { byId, throttled } from './dom.js';
import { plural } from './format.js';
import { Graticule } from './graticule.js';
import { HazardHistory } from './hazard_history.js';
import { HazardLayer } from './hazard_layer.js';
import { HazardList } from './hazard_list.js';
import { popupContent } from './hazard_popup.js';
import { HazardStore } from './hazard_store.js';
import { LiveFeed, getJson, loadHazards } from './live_feed.js';
import { Officials } from './officials.js';
import { Sheet } from './sheet.js';
import { VehicleLayer } from './vehicle_layer.js';

const L = window.L;
const STATES = { connecting: 'Connecting', live: 'Live', offline: 'Reconnecting' };

/** Markers are for the mouse; by keyboard one goes through the list, which has one tab stop. */
L.Marker.mergeOptions({ keyboard: false });

function createMap(config) {
  const map = L.map('map', {
    attributionControl: false, zoomControl: false, maxZoom: 21, minZoom: 3, preferCanvas: true,
    zoomSnap: 0.5, worldCopyJump: true,
  });
  const [longitude, latitude] = config.centre;
  map.setView([latitude, longitude], 14);
  if (config.tile_url) {
    L.tileLayer(config.tile_url, { maxZoom: 21, maxNativeZoom: 19 }).addTo(map);
    if (config.tile_attribution) map.addControl(new AttributionText(config.tile_attribution));
  } else {
    new Graticule().addTo(map);
    map.getContainer().classList.add('without-tiles');
  }
  L.control.zoom({ position: 'bottomright' }).addTo(map);
  L.control.scale({ position: 'bottomleft', maxWidth: 140 }).addTo(map);
  return map;
}

class Page {
  constructor(config, classes) {
    this.catalogue = new Catalogue(classes);
    this.store = new HazardStore();
    this.sheet = new Sheet();
    this.map = createMap(config);
    this.vehicles = new VehicleLayer(this.map, !config.tile_url,
      (vehicle) => this.officials.vehicleButtons(vehicle));
    this.layer = new HazardLayer(this.map, this.catalogue,
      (hazard) => popupContent(hazard, this.catalogue,
        [this.history.section(hazard), ...this.officials.buttons(hazard)]),
      this.sheet.coveredHeight());
    this.history = new HazardHistory((id) => this.layer.refresh(id));
    this.officials = new Officials(config.officials, (text) => this.say(text),
      (subject, focus) => this.focusPopup(subject, focus));
    this.changes = new ChangeView(this.map, (change) => this.officials.changeButtons(change),
      this.sheet.coveredHeight(), () => this.stepAside());
    this.list = new HazardList(this.catalogue, (hazard) => this.choose(hazard));
    this.filter = new ClassFilter(this.store, this.catalogue, () => this.showAll());
    this.states = new StateFilter(this.store, () => this.showAll(),
      config.officials ? (shown) => this.showRejected(shown) : null);
    this.inView = byId('in-view');
    this.updateSoon = throttled(() => this.updatePanel(), 120);
    this.announced = [];
    this.announceSoon = throttled(() => this.announce(), 800);
    /** Until somebody moves the map, it keeps everything in view. */
    this.keepsAllInView = true;
    this.chosen = null;
    this.map.addControl(new FitControl(() => {
      this.keepsAllInView = true;
      this.fit();
    }));
    this.listen();
  }

  listen() {
    for (const gesture of ['pointerdown', 'wheel', 'keydown']) {
      this.map.getContainer().addEventListener(gesture, () => { this.keepsAllInView = false; },
        { passive: true, capture: true });
    }
    this.map.on('moveend', () => {
      if (this.inView.checked) this.updateSoon();
    });
    this.map.on('popupopen', (event) => this.onPopupOpen(event.popup));
    this.map.on('popupclose', (event) => this.onPopupClose(event.popup));
    this.inView.addEventListener('change', () => this.updatePanel());
    document.addEventListener('keydown', (event) => {
      if (event.key !== 'Escape' || this.officials.isAsking()) return;
      this.map.closePopup();
      this.sheet.toggle(false);
    });
    setInterval(() => {
      this.updateSoon();
      this.vehicles.updateRows();
      this.changes.updateSoon();
    }, 5000);
  }

  start() {
    const feed = new LiveFeed({
      onList: (features) => this.onList(features),
      onHazard: (action, feature) => this.onHazard(action, feature),
      onChangeList: (features) => this.changes.replaceAll(features),
      onChange: (action, feature) => this.onChange(action, feature),
      onVehicle: (feature) => {
        this.vehicles.put(feature);
        this.keepInView(feature);
      },
      onState: (state) => showState(state),
    });
    return feed.start();
  }

  onList(features) {
    this.store.replaceAll(features);
    this.showAll();
    if (this.store.keepsRejected) this.showRejected(true);
    if (this.keepsAllInView) this.fit();
  }

  onHazard(action, feature) {
    const result = this.store.apply(action, feature);
    if (!result) return;
    const { change, hazard } = result;
    if (change === 'gone') this.layer.remove(hazard);
    else if (this.store.isShown(hazard)) this.layer.put(hazard);
    else this.layer.remove(hazard);
    if (change === 'new' && this.store.isShown(hazard)) {
      this.layer.highlight(hazard);
      this.list.markFresh(hazard);
      this.announced.push(hazard.label);
      this.announceSoon();
    }
    if (change === 'new') this.keepInView(feature);
    this.updateSoon();
  }

  onChange(action, feature) {
    const fresh = this.changes.apply(action, feature);
    if (!fresh) return;
    this.say(`New map change: ${fresh.title}`);
    this.keepInView(feature);
  }

  /** For officials who look at what was rejected. From now on events keep it current. */
  async showRejected(shown) {
    this.store.keepsRejected = shown;
    if (shown) {
      try {
        const list = await loadHazards('rejected');
        if (this.store.keepsRejected) this.store.addRejected(list.features);
      } catch (failure) {
        this.store.keepsRejected = false;
      }
    }
    if (!this.store.keepsRejected) this.store.dropRejected();
    this.showAll();
    if (shown && !this.store.keepsRejected) this.states.sayRejectedFailed();
  }

  showAll() {
    this.layer.show(this.store.shown());
    this.updatePanel();
  }

  updatePanel() {
    const shown = this.store.shown();
    const bounds = this.map.getBounds();
    const listed = this.inView.checked
      ? shown.filter((hazard) => bounds.contains([hazard.latitude, hazard.longitude]))
      : shown;
    this.list.show(listed, this.store.size);
    this.filter.update();
    this.states.update();
    this.sheet.say(this.store.size === 0 ? 'No hazards yet' : plural(shown.length, 'hazard'));
  }

  /** From the list: to the hazard on the map, with its popup open and focused. */
  choose(hazard) {
    this.stepAside();
    this.chosen = hazard.id;
    this.layer.open(hazard);
  }

  /** Nothing else moves or covers the map while somebody looks at one place. */
  stepAside() {
    this.sheet.toggle(false);
    this.keepsAllInView = false;
    this.vehicles.follow(null);
  }

  /** After a decision, or without one: back to where it was asked for. */
  focusPopup({ hazard, change, vehicle }, focus) {
    if (hazard) this.layer.focusPopup(hazard.id, focus);
    else if (change) this.changes.focusPopup(change.id, focus);
    else this.vehicles.focusPopup(vehicle.id, focus);
  }

  onPopupOpen(popup) {
    const content = popup.getElement().querySelector('.popup');
    if (this.chosen !== null && content?.dataset.hazard === this.chosen) {
      content.focus({ preventScroll: true });
    }
  }

  onPopupClose(popup) {
    const held = popup.getElement()?.contains(document.activeElement);
    if (this.chosen !== null && (held || document.activeElement === document.body)) {
      this.list.focusHazard(this.chosen);
    }
    this.chosen = null;
  }

  /** Shows everything that there is; an empty map stays where the zone lies. */
  fit() {
    const bounds = this.vehicles.bounds().extend(this.changes.bounds());
    for (const hazard of this.store.hazards.values()) {
      bounds.extend([hazard.latitude, hazard.longitude]);
    }
    if (!bounds.isValid()) return;
    // Pins stand above their place, and on a phone the sheet covers the map's foot.
    this.map.fitBounds(bounds, {
      paddingTopLeft: [40, 64], paddingBottomRight: [40, 40 + this.sheet.coveredHeight()],
      maxZoom: 18,
    });
  }

  keepInView(feature) {
    const [longitude, latitude] = feature.geometry.coordinates;
    if (this.keepsAllInView && !this.map.getBounds().contains([latitude, longitude])) this.fit();
  }

  announce() {
    const [first] = this.announced;
    this.say(this.announced.length === 1
      ? `New hazard: ${first}` : `${this.announced.length} new hazards, the first: ${first}`);
    this.announced = [];
  }

  /** To those who listen instead of looking. */
  say(text) {
    byId('announcer').textContent = text;
  }
}

function showState(state) {
  const node = byId('connection');
  if (node.dataset.state === 'live' && state === 'connecting') return;
  node.dataset.state = state;
  node.textContent = STATES[state];
}

async function main() {
  let answers;
  try {
    answers = await Promise.all(
      ['config', 'classes', 'vehicles'].map((name) => getJson(`/api/v1/${name}`)));
  } catch (failure) {
    // The page is here already, the zone is not yet: try until it answers.
    showState('offline');
    setTimeout(main, 2000);
    return;
  }
  const [config, classes, vehicles] = answers;
  document.title = config.title;
  byId('title').textContent = config.title;
  const page = new Page(config, classes);
  for (const feature of vehicles.features) page.vehicles.put(feature);
  await page.start();
}

main();
