// The hazards that this page knows. Both the list at the start and every later event go through
// here; an event older than what is known changes nothing.

import { REJECTED } from './hazard_state.js';

/** A GeoJSON feature of the API as the flat object that the page works with. */
export function hazardOf(feature) {
  const { properties } = feature;
  const [longitude, latitude] = feature.geometry.coordinates;
  return {
    id: String(properties.id),
    className: String(properties.class),
    label: String(properties.label),
    latitude,
    longitude,
    confidence: properties.confidence,
    sightings: properties.sightings,
    state: String(properties.state),
    presence: properties.presence,
    vehicles: properties.vehicles,
    firstSeen: Date.parse(properties.first_seen),
    lastSeen: Date.parse(properties.last_seen),
    updated: Date.parse(properties.updated),
    sigma: properties.position_sigma_m,
    image: properties.image,
    sequence: properties.sequence,
  };
}

export class HazardStore {
  constructor() {
    this.hazards = new Map();
    this.hidden = new Set();
    this.hiddenStates = new Set();
    /** Whether rejected hazards are kept, too. */
    this.keepsRejected = false;
    /** How many hazards there are of each class and in each state, hidden ones included. */
    this.counts = new Map();
    this.stateCounts = new Map();
  }

  get size() {
    return this.hazards.size;
  }

  replaceAll(features) {
    this.hazards.clear();
    this.counts.clear();
    this.stateCounts.clear();
    for (const feature of features) this.put(hazardOf(feature));
  }

  /** Takes an event; answers what it meant: 'new', 'changed', 'gone' or null (old news). */
  apply(action, feature) {
    const hazard = hazardOf(feature);
    const known = this.hazards.get(hazard.id);
    if (known && known.sequence >= hazard.sequence) return null;
    if (action === 'removed' && this.keepsRejected && hazard.state === REJECTED.name) {
      this.put(hazard);
      return { change: 'changed', hazard };
    }
    if (action === 'removed') {
      if (!known) return null;
      this.hazards.delete(hazard.id);
      this.count(known, -1);
      return { change: 'gone', hazard: known };
    }
    this.put(hazard);
    return { change: known ? 'changed' : 'new', hazard };
  }

  /** Takes the list of rejected hazards; what an event told since is newer. */
  addRejected(features) {
    for (const hazard of features.map(hazardOf)) {
      const known = this.hazards.get(hazard.id);
      if (!known || known.sequence < hazard.sequence) this.put(hazard);
    }
  }

  dropRejected() {
    for (const hazard of [...this.hazards.values()]) {
      if (hazard.state !== REJECTED.name) continue;
      this.hazards.delete(hazard.id);
      this.count(hazard, -1);
    }
  }

  isShown(hazard) {
    return !this.hidden.has(hazard.className) && !this.hiddenStates.has(hazard.state);
  }

  shown() {
    return [...this.hazards.values()].filter((hazard) => this.isShown(hazard));
  }

  put(hazard) {
    const known = this.hazards.get(hazard.id);
    if (known) this.count(known, -1);
    this.hazards.set(hazard.id, hazard);
    this.count(hazard, 1);
  }

  count({ className, state }, change) {
    this.counts.set(className, (this.counts.get(className) ?? 0) + change);
    this.stateCounts.set(state, (this.stateCounts.get(state) ?? 0) + change);
  }
}
