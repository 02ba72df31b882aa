// The live map's page: puts map, panel and live feed together.

import { addressOf } from './address.js';
import { Catalogue } from './catalogue.js';
import { ClassFilter, StateFilter } from './panel/class_filter.js';
import { ChangeView } from './panel/change_view.js';
import { DecisionList } from './panel/decision_list.js';
import { AttributionText, FitControl } from './layers/controls.js';
import { byId, nextTask, throttled } from './dom.js';
import { plural } from './format.js';
import { Graticule } from './layers/graticule.js';
import { AccountsView } from './desk/accounts_view.js';
import { AgeFilter } from './panel/age_filter.js';
import { AreaFilter } from './desk/area_filter.js';
import { AssignmentList } from './desk/assignment_list.js';
import { csvOf, geoJsonOf, saveFile } from './desk/export.js';
import { HazardOrders } from './desk/hazard_orders.js';
import { OrdersView } from './desk/orders_view.js';
import { StatisticsView } from './desk/statistics_view.js';
import { FrameRequests } from './desk/frame_request.js';
import { HazardHistory } from './desk/time_line.js';
import { WorkDialog } from './desk/work_dialog.js';
import { HazardLayer } from './layers/hazard_layer.js';
import { HazardList, hazardRow } from './panel/hazard_list.js';
import { popupContent } from './popups/hazard_popup.js';
import { nearLongitude } from './mercator.js';
import { NeighbourLayer } from './layers/neighbour_layer.js';
import { Officials } from './popups/officials.js';
import { ReviewQueue } from './panel/review_queue.js';
import { askToLogIn, session, startSession } from './session.js';
import { Sheet } from './panel/sheet.js';
import { unitBox } from './layers/sign_layer.js';
import { whenStill } from './layers/still_map.js';
import { StreetLayer } from './layers/street_layer.js';
import { VehicleLayer } from './layers/vehicle_layer.js';
import { ZoneData } from './zone_data.js';
import { ZoneView } from './panel/zone_view.js';
import { getJson } from './zone_lists.js';

const L = window.L;
const STATES = { connecting: 'Connecting', live: 'Live', offline: 'Reconnecting' };

/** The zone looks so rarely anew where most hazards are. */
const VIEW_AGE_MS = 11000;

function hasTiles(config) {
  return config.tile_url !== null || config.tiles !== null;
}

function createMap(config) {
  const map = L.map('map', {
    attributionControl: false, zoomControl: false, maxZoom: 21, minZoom: 3, zoomSnap: 0.5,
  });
  const [longitude, latitude] = config.centre;
  map.setView([latitude, longitude], 14);
  if (hasTiles(config)) {
    const { min_zoom: least, max_zoom: most } = config.tiles ?? { min_zoom: 0, max_zoom: 19 };
    L.tileLayer(config.tile_url ?? `${addressOf('/tiles/')}{z}/{x}/{y}`,
      { maxZoom: 21, minZoom: least, maxNativeZoom: most }).addTo(map);
  } else {
    new Graticule().addTo(map);
    map.getContainer().classList.add('without-tiles');
  }
  if (config.streets) {
    new StreetLayer(map);
    map.getContainer().classList.add('with-streets');
  }
  const credits = [hasTiles(config) && config.tile_attribution,
    config.streets && '\u00a9 OpenStreetMap contributors'].filter(Boolean);
  if (credits.length > 0) map.addControl(new AttributionText(credits.join(' \u00b7 ')));
  L.control.zoom({ position: 'bottomright' }).addTo(map);
  L.control.scale({ position: 'bottomleft', maxWidth: 140 }).addTo(map);
  return map;
}

class Page {
  constructor(map, data, config, classes) {
    this.data = data;
    this.catalogue = new Catalogue(classes);
    this.sheet = new Sheet();
    this.map = map;
    this.vehicles = new VehicleLayer(this.map, !hasTiles(config) && !config.streets,
      (vehicle) => this.officials.vehicleButtons(vehicle));
    this.layer = new HazardLayer(this.map, data, this.catalogue,
      (hazard) => popupContent(hazard, this.catalogue, config.streets, this.repair.rows(hazard),
        // A region tells a hazard's history to those alone who have logged in.
        [...this.frames.section(hazard),
          ...(config.region && session.name === null ? [] : [this.history.section(hazard)]),
          ...this.officials.buttons(hazard, this.work.button(hazard))]),
      (hazard) => hazardRow(this.catalogue, hazard),
      this.sheet.coveredHeight());
    this.repair = new HazardOrders(config.orders, {
      assignmentOf: (id) => this.assignments.of(id),
      openId: () => this.layer.popup?.id ?? null,
      onChange: (id, isFirst) => this.layer.redraw(id, isFirst),
    });
    this.history = new HazardHistory((id) => this.layer.redraw(id),
      (hazard, id) => this.officials.askUndo(hazard, id));
    this.frames = new FrameRequests({
      onDone: (text, hazard, id) => {
        this.officials.sayDoneAtDesk(text, hazard, id);
        this.history.renew(hazard);
      },
      openId: () => this.layer.popup?.id ?? null,
      onChange: (id) => this.layer.redraw(id, false),
    });
    this.work = new WorkDialog(map, this.catalogue, {
      onDone: (text, hazard, id) => {
        this.officials.sayDoneAtDesk(text, hazard, id);
        this.history.renew(hazard);
      },
      teams: () => this.assignments.teams(),
      onClosed: (hazard) => this.focusPopup({ hazard }, 'work'),
    });
    this.officials = new Officials(config.officials && session.role !== 'viewer', (text) => {
      this.say(text);
      this.trail.refresh();
      this.repair.renew();
      this.assignments.refresh();
    }, (subject, focus) => this.focusPopup(subject, focus));
    this.changes = new ChangeView(this.map, data, (change) => this.officials.changeButtons(change),
      this.sheet.coveredHeight(), () => this.stepAside(), (focus) => this.sheet.focusBack(focus));
    this.trail = new DecisionList((hazard, id) => this.officials.askUndo(hazard, id));
    this.review = new ReviewQueue((hazard) => this.choose(hazard), () => this.trail.refresh());
    this.statistics = new StatisticsView();
    this.accounts = new AccountsView();
    this.inView = byId('in-view');
    this.list = new HazardList(data, this.catalogue, (hazard) => this.choose(hazard),
      () => (this.inView.checked ? unitBox(this.map.getBounds()) : null));
    this.filter = new ClassFilter(data, this.catalogue, () => this.showAll());
    this.states = new StateFilter(data, () => this.showAll(),
      // What was rejected has left a region's map.
      config.officials && !config.region ? (shown) => this.showRejected(shown) : null);
    this.age = new AgeFilter((age) => {
      data.showAge(age);
      this.showAll();
    });
    this.assignments = new AssignmentList((ids) => {
      data.showOnly(ids);
      this.showAll();
    }, (hazard) => this.choose(hazard), () => this.layer.redraw(this.layer.popup?.id ?? null, false));
    this.orders = new OrdersView(config.orders, this.catalogue, (hazard) => this.choose(hazard), (text) => {
      this.say(text);
      this.trail.refresh();
      this.repair.renew();
    });
    this.area = new AreaFilter(this.map, (corners) => {
      data.showArea(corners);
      this.showAll();
    }, () => {
      this.stepAside();
      this.say('Tap the corners of the area on the map; the first one again ends it.');
    });
    this.announced = { count: 0, first: '' };
    this.announceSoon = throttled(() => this.announce(), 800);
    /** Until somebody moves the map, it shows what the zone says. */
    this.followsZone = true;
    this.hasLists = false;
    this.refitSoon = throttled(() => this.refit(), 1000);
    this.refitLater = throttled(() => this.refit(), VIEW_AGE_MS);
    this.zones = config.region ? new ZoneView(this.map, (text) => this.say(text)) : null;
    if (config.neighbours) new NeighbourLayer(this.map, this.catalogue);
    this.map.addControl(new FitControl(() => {
      this.followsZone = false;
      this.fitAll();
    }));
    keepControlsFirst(this.map);
    // At once: an animation would draw everything twice.
    if (config.view) this.fit(config.view, { animate: false });
    this.listen();
  }

  listen() {
    for (const gesture of ['pointerdown', 'wheel', 'keydown']) {
      this.map.getContainer().addEventListener(gesture, (event) => {
        // Tab only looks where things are.
        if (event.key !== 'Tab' && event.key !== 'Shift') this.followsZone = false;
      }, { passive: true, capture: true });
    }
    this.map.on('moveend', () => {
      if (this.inView.checked) this.list.refresh();
    });
    this.map.on('popupopen popupclose', ({ type, popup }) => {
      this.map.getContainer().classList.toggle('with-popup', type === 'popupopen');
      // At once: while Leaflet lets it fade, a click would still reach its buttons.
      if (type === 'popupclose') popup.getElement()?.remove();
    });
    this.inView.addEventListener('change', () => this.list.refresh());
    byId('export-geojson').addEventListener('click', () => this.saveList('hazards.geojson',
      'application/geo+json', geoJsonOf));
    byId('export-csv').addEventListener('click', () => this.saveList('hazards.csv', 'text/csv', csvOf));
    document.addEventListener('keydown', (event) => {
      if (event.key !== 'Escape' || document.querySelector('dialog[open]')) return;
      this.map.closePopup();
      this.sheet.toggle(false);
    });
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden && this.followsZone) this.refitSoon();
    });
    setInterval(() => {
      this.list.refresh();
      this.vehicles.updateRows();
      this.changes.updateSoon();
    }, 5000);
  }

  onState(state) {
    showState(state);
  }

  onLists() {
    // The first lists came with the view; later ones are of another store.
    if (this.hasLists && this.followsZone) this.refitSoon();
    this.hasLists = true;
    this.showAll();
  }

  onChanged({ news, vehicles }) {
    for (const feature of vehicles) this.vehicles.put(feature);
    for (const hazard of news.hazards) {
      this.layer.highlight(hazard);
      this.list.markFresh(hazard);
    }
    if (news.hazardCount > 0) {
      if (this.announced.count === 0) this.announced.first = news.hazards[0].label;
      this.announced.count += news.hazardCount;
      this.announceSoon();
    }
    if (news.changeCount > 0) {
      const { title } = news.changes[news.changes.length - 1];
      this.say(news.changeCount === 1 ? `New map change: ${title}`
        : `${news.changeCount} new map changes, the last: ${title}`);
    }
    this.keepInView([...news.hazards, ...news.changes]);
    this.showAll();
  }

  onWatched(kind, id, record) {
    const layer = kind === 'changes' ? this.changes.layer : this.layer;
    layer.onWatched(id, record);
  }

  /** For officials who look at what was rejected. From now on events keep it current. */
  async showRejected(shown) {
    const done = await this.data.showRejected(shown);
    this.showAll();
    if (!done) this.states.sayRejectedFailed();
  }

  showAll() {
    this.layer.refresh();
    this.list.refresh();
    this.changes.updateSoon();
    this.filter.update();
    this.states.update();
    const { hazards } = this.data.sizes;
    this.sheet.say(hazards === 0 ? 'No hazards yet' : plural(hazards, 'hazard'));
  }

  /** From the list: to the hazard on the map, with its popup open and focused. */
  choose(hazard) {
    this.stepAside();
    this.layer.open(hazard, () => this.sheet.focusBack(() => this.list.focusHazard(hazard.id)));
  }

  /** Nothing else moves or covers the map while somebody looks at one place. */
  stepAside() {
    this.sheet.toggle(false);
    this.followsZone = false;
    this.vehicles.follow(null);
  }

  /** After a decision, or without one: back to where it was asked for. */
  focusPopup({ hazard, change, vehicle }, focus) {
    if (hazard) this.layer.focusPopup(hazard.id, focus);
    else if (change) this.changes.focusPopup(change.id, focus);
    else this.vehicles.focusPopup(vehicle.id, focus);
  }

  /** Goes where the zone says that most hazards are: no vehicle decides it alone. The map of an empty
   * zone stays where it is. */
  async refit() {
    // Nobody sees it, and the browser would do all of it at once when somebody does.
    if (document.hidden) return;
    const config = await getJson('/api/v1/config').catch(() => null);
    if (!config?.view) return;
    whenStill(this.map, () => { if (this.followsZone) this.fit(config.view); });
  }

  /** Shows everything that there is. */
  async fitAll() {
    const box = await this.data.ask('bounds', 'hazards', { places: this.vehicles.places() });
    if (box) whenStill(this.map, () => this.fit(box));
  }

  /** East less than west: across 180 degrees. `options` are Leaflet's of fitBounds. */
  fit({ west, south, east, north }, options = {}) {
    const centre = nearLongitude(west, this.map.getCenter().lng);
    const width = east < west ? east + 360 - west : east - west;
    // Pins stand above their place, and on a phone the sheet covers the map's foot.
    this.map.fitBounds([[south, centre], [north, centre + width]], {
      paddingTopLeft: [40, 64], paddingBottomRight: [40, 40 + this.sheet.coveredHeight()],
      maxZoom: 18, ...options,
    });
  }

  /** What is new and not in view may change the zone's view, in a while. */
  keepInView(records) {
    if (!this.followsZone) return;
    const bounds = this.map.getBounds();
    if (records.every((record) => bounds.contains(this.layer.placeOf(record)))) return;
    this.refitSoon();
    this.refitLater();
  }

  announce() {
    const { count, first } = this.announced;
    this.say(count === 1 ? `New hazard: ${first}`
      : `${count.toLocaleString('en')} new hazards, the first: ${first}`);
    this.announced = { count: 0, first: '' };
  }

  /** What is listed, all of it, as a file. */
  async saveList(name, type, textOf) {
    const { rows } = await this.data.ask('rows', 'hazards', {
      offset: 0, limit: Infinity, box: this.list.box(), text: this.list.search.value,
    });
    saveFile(name, type, textOf(rows, (id) => this.assignments.of(id)));
    this.say(`${plural(rows.length, 'hazard')} exported`);
  }

  /** To those who listen instead of looking. */
  say(text) {
    byId('announcer').textContent = text;
  }
}

/** Where there is little room the list has it; a tap opens the rest. */
function makeRoomForList() {
  if (window.innerHeight >= 640 && window.innerWidth > 760) return;
  for (const section of document.querySelectorAll('details.section')) section.open = false;
}

/** Few buttons come before many signs, for those who go by Tab. */
function keepControlsFirst(map) {
  const container = map.getContainer();
  container.prepend(container.querySelector('.leaflet-control-container'));
}

function showState(state) {
  const node = byId('connection');
  if (node.dataset.state === 'live' && state === 'connecting') return;
  node.dataset.state = state;
  node.textContent = STATES[state];
}

/** The page is here already, the zone is perhaps not yet: tries until it answers. */
async function askUntilAnswered(path) {
  for (;;) {
    try {
      return await getJson(path);
    } catch (failure) {
      showState('offline');
      await new Promise((resolve) => { setTimeout(resolve, 1000); });
    }
  }
}

async function main() {
  makeRoomForList();
  startSession(await askUntilAnswered('/api/v1/session'));
  if (!session.sees.told) {
    askToLogIn('This map is for those who have an account.');
    return;
  }
  // The worker loads the hazards while the page asks for the rest.
  let page = null;
  const early = [];
  const later = (name) => (...told) => {
    if (page) page[name](...told);
    else early.push([name, told]);
  };
  const data = new ZoneData({
    onState: later('onState'), onLists: later('onLists'), onChanged: later('onChanged'),
    onWatched: later('onWatched'),
  });
  const wanted = ['config', 'classes', ...(session.sees.vehicles ? ['vehicles'] : [])];
  const [config, classes, vehicles = { features: [] }] = await Promise.all(
    wanted.map((name) => askUntilAnswered(`/api/v1/${name}`)));
  document.title = config.title;
  byId('title').textContent = config.title;
  // One after the other: all at a stretch, on a busy machine, is a freeze.
  const map = createMap(config);
  await nextTask();
  const built = new Page(map, data, config, classes);
  await nextTask();
  for (const feature of vehicles.features) built.vehicles.put(feature);
  for (const [name, told] of early) built[name](...told);
  page = built;
}

// The browser has enough to do with all these modules.
nextTask().then(main);
