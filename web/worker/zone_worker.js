// Off the page's own thread: loads and follows what is in the zone, keeps it, and answers what is to
// be drawn, what is to be listed and how much there is of what. The page never holds more than it
// shows.

import { changeOf, hazardOf, hazardsOf } from '../hazard_record.js';
import { REJECTED, STATES } from '../hazard_state.js';
import { LiveFeed } from './live_feed.js';
import { latitudeOf, longitudeOf, shortestStretch, unitX, unitY } from '../mercator.js';
import { PointTable } from './point_table.js';
import { findSigns } from './sign_finder.js';
import { loadPoints } from '../zone_lists.js';

/** Events that come in a burst are told together. */
const TELL_MS = 100;
/** Of these one sees where they are; of the others only that they came. */
const MAX_FRESH = 20;
/** Group 0 is of all classes that the catalogue does not have. */
const MAX_GROUPS = 255;
const STATE_NUMBERS = new Map([...STATES, REJECTED].map(({ name }, index) => [name, index + 1]));

class Zone {
  constructor() {
    this.groups = new Map();
    this.labels = new Map();
    this.hazards = new PointTable(({ className }) => this.groups.get(className) ?? 0,
      ({ state }) => STATE_NUMBERS.get(state) ?? 0);
    this.changes = new PointTable(() => 0, () => 0);
    this.keepsRejected = false;
    /** Sequences, by id, of what left while rejected hazards are loaded; else null. */
    this.removals = null;
    this.watched = { kind: null, id: null };
    this.news = { hazards: [], hazardCount: 0, changes: [], changeCount: 0 };
    /** The newest of each vehicle since the page was told, by id. */
    this.vehicles = new Map();
    this.timer = null;
    this.feed = new LiveFeed({
      onLists: (lists) => this.replaceAll(lists),
      onHazard: (action, feature) => this.onHazard(action, hazardOf(feature)),
      onChange: (action, feature) => this.onChange(action, changeOf(feature)),
      onVehicle: (feature) => this.onVehicle(feature),
      onState: (state) => {
        // What came before "live" is there when the page says so.
        if (state === 'live') this.tell();
        postMessage({ type: 'state', state });
      },
    });
  }

  replaceAll({ classes, points, changes }) {
    this.groups = new Map(classes.classes.slice(0, MAX_GROUPS)
      .map((entry, index) => [entry.class, index + 1]));
    this.labels = new Map(classes.classes.map((entry) => [entry.class, entry.label]));
    this.hazards.replaceAll(this.hazardsOf(points));
    this.changes.replaceAll(changes.features.map(changeOf));
    if (this.keepsRejected) this.showRejected(true);
    this.tell();
    postMessage({ type: 'lists' });
  }

  hazardsOf(points) {
    return hazardsOf(points, (name) => this.labels.get(name) ?? name);
  }

  onHazard(action, hazard) {
    const known = this.hazards.get(hazard.id);
    if (known && known.sequence >= hazard.sequence) return;
    const isKept = action !== 'removed'
      || (this.keepsRejected && hazard.state === REJECTED.name);
    if (isKept) this.hazards.put(hazard);
    else this.forget(hazard);
    this.tellWatched('hazards', isKept ? hazard : null, hazard.id);
    if (isKept && !known && action !== 'removed'
        && this.hazards.isShown(this.hazards.slots.get(hazard.id))) {
      this.news.hazardCount += 1;
      if (this.news.hazards.length < MAX_FRESH) this.news.hazards.push(hazard);
    }
    this.tellSoon();
  }

  forget(hazard) {
    this.hazards.remove(hazard.id);
    this.removals?.set(hazard.id, hazard.sequence);
  }

  onChange(action, change) {
    const known = this.changes.get(change.id);
    if (known && known.sequence >= change.sequence) return;
    const isKept = action !== 'removed';
    if (isKept) this.changes.put(change);
    else this.changes.remove(change.id);
    this.tellWatched('changes', isKept ? change : null, change.id);
    if (isKept && !known) {
      this.news.changeCount += 1;
      if (this.news.changes.length < MAX_FRESH) this.news.changes.push(change);
    }
    this.tellSoon();
  }

  /** One that carries the trail comes once, and is followed by others without. */
  onVehicle(feature) {
    const { properties } = feature;
    const trail = properties.trail ?? this.vehicles.get(properties.vehicle)?.properties.trail;
    if (trail) properties.trail = trail;
    this.vehicles.set(properties.vehicle, feature);
    this.tellSoon();
  }

  tellWatched(kind, record, id) {
    if (this.watched.kind === kind && this.watched.id === id) {
      postMessage({ type: 'watched', kind, id, record });
    }
  }

  tellSoon() {
    this.timer ??= setTimeout(() => this.tell(), TELL_MS);
  }

  tell() {
    clearTimeout(this.timer);
    this.timer = null;
    const groupCounts = new Map([['', this.hazards.groupCounts[0]]]);
    for (const [name, group] of this.groups) groupCounts.set(name, this.hazards.groupCounts[group]);
    const stateCounts = new Map();
    for (const [name, number] of STATE_NUMBERS) {
      stateCounts.set(name, this.hazards.stateCounts[number]);
    }
    postMessage({ type: 'changed', hazards: this.hazards.size, changes: this.changes.size,
      groupCounts, stateCounts, news: this.news, vehicles: [...this.vehicles.values()] });
    this.news = { hazards: [], hazardCount: 0, changes: [], changeCount: 0 };
    this.vehicles.clear();
  }

  filter({ classes, states, onlyIds, area, age }) {
    this.hazards.onlyIds = onlyIds === null ? null : new Set(onlyIds);
    this.hazards.area = area;
    this.hazards.age = age;
    this.hazards.hiddenGroups.fill(0);
    this.hazards.hiddenStates.fill(0);
    for (const name of classes) {
      const group = name === '' ? 0 : this.groups.get(name);
      if (group !== undefined) this.hazards.hiddenGroups[group] = 1;
    }
    for (const name of states) this.hazards.hiddenStates[STATE_NUMBERS.get(name)] = 1;
  }

  /** For officials who look at what was rejected. From now on events keep it current. Answers false
   * where it could not be loaded. */
  async showRejected(shown) {
    this.keepsRejected = shown;
    let done = true;
    if (shown) {
      this.removals = new Map();
      try {
        const points = await loadPoints(REJECTED.name);
        if (this.keepsRejected) this.addRejected(this.hazardsOf(points));
      } catch (failure) {
        this.keepsRejected = false;
        done = false;
      }
      this.removals = null;
    }
    if (!this.keepsRejected) this.dropRejected();
    this.tell();
    return done;
  }

  /** What an event told since is newer, also that one left. There may be very many: all at once. */
  addRejected(hazards) {
    const all = new Map(this.hazards.all().map((hazard) => [hazard.id, hazard]));
    for (const hazard of hazards) {
      const told = all.get(hazard.id)?.sequence ?? this.removals?.get(hazard.id) ?? -1;
      if (told < hazard.sequence) all.set(hazard.id, hazard);
    }
    this.hazards.replaceAll([...all.values()]);
  }

  dropRejected() {
    const kept = this.hazards.all().filter(({ state }) => state !== REJECTED.name);
    if (kept.length < this.hazards.size) this.hazards.replaceAll(kept);
  }

  /** The smallest box in degrees, east perhaps beyond 180, that holds everything and the `places`
   * ([longitude, latitude]); null where there is nothing. */
  bounds({ places }) {
    const xs = places.map(([longitude]) => unitX(longitude));
    let north = 1;
    let south = 0;
    for (const [, latitude] of places) {
      north = Math.min(north, unitY(latitude));
      south = Math.max(south, unitY(latitude));
    }
    for (const table of [this.hazards, this.changes]) {
      for (const slot of table.slots.values()) {
        xs.push(table.x[slot]);
        north = Math.min(north, table.y[slot]);
        south = Math.max(south, table.y[slot]);
      }
    }
    const stretch = shortestStretch(xs);
    if (stretch === null) return null;
    return { west: longitudeOf(stretch[0]), east: longitudeOf(stretch[1]),
      south: latitudeOf(south), north: latitudeOf(north) };
  }

  answer(what, kind, details) {
    const table = kind === 'changes' ? this.changes : this.hazards;
    switch (what) {
      case 'signs': return findSigns(table, details);
      case 'rows': return table.rows(details);
      case 'record': return table.get(details.id);
      case 'bounds': return this.bounds(details);
      case 'rejected': return this.showRejected(details.shown);
      default: throw new Error(`unknown question '${what}'`);
    }
  }
}

const zone = new Zone();

onmessage = async ({ data }) => {
  switch (data.type) {
    case 'filter': zone.filter(data); break;
    case 'watch': zone.watched = data; break;
    case 'hidden': zone.feed.setHidden(data.hidden); break;
    case 'ask':
      try {
        postMessage({ type: 'answer', id: data.id,
          answer: await zone.answer(data.what, data.kind, data.details) });
      } catch (failure) {
        postMessage({ type: 'answer', id: data.id, wrong: String(failure) });
      }
      break;
    default:
  }
};
addEventListener('online', () => zone.feed.retryNow());
zone.feed.start();
