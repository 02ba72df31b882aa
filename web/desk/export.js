// The hazards that the filters leave, as a file: GeoJSON (RFC 7946) or CSV (RFC 4180).

const COLUMNS = ['id', 'class', 'label', 'state', 'latitude', 'longitude', 'confidence', 'presence',
  'sightings', 'vehicles', 'updated', 'street', 'near', 'direction', 'team', 'due'];

/** What is known of one; `assignment` may be null. */
function valuesOf(hazard, assignment) {
  return {
    id: hazard.id, class: hazard.className, label: hazard.label, state: hazard.state,
    latitude: hazard.latitude, longitude: hazard.longitude, confidence: hazard.confidence,
    presence: hazard.presence, sightings: hazard.sightings, vehicles: hazard.vehicles,
    updated: new Date(hazard.updated).toISOString(), street: hazard.street ?? null,
    near: hazard.near ?? null, direction: hazard.bound ?? null, team: assignment?.team ?? null,
    due: assignment?.due ?? null,
  };
}

/** A spreadsheet takes a text that begins so for a formula: it gets an apostrophe. */
function cell(value) {
  if (value === null || value === undefined) return '';
  if (typeof value === 'number') return String(value);
  const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

export function csvOf(hazards, assignmentOf) {
  const lines = hazards.map((hazard) => {
    const values = valuesOf(hazard, assignmentOf(hazard.id));
    return COLUMNS.map((name) => cell(values[name])).join(',');
  });
  return [COLUMNS.join(','), ...lines, ''].join('\r\n');
}

export function geoJsonOf(hazards, assignmentOf) {
  return JSON.stringify({
    type: 'FeatureCollection',
    features: hazards.map((hazard) => {
      const { latitude, longitude, ...properties } = valuesOf(hazard, assignmentOf(hazard.id));
      return { type: 'Feature', id: hazard.id,
        geometry: { type: 'Point', coordinates: [longitude, latitude] }, properties };
    }),
  });
}

export function saveFile(name, type, text) {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  // The browser has taken it by then.
  setTimeout(() => URL.revokeObjectURL(url), 60000);
}
