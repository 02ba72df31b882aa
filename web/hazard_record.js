// Hazards and map changes as the page works with them, whichever way the zone told them.

export const PLAIN = '#6b766a';

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
    street: properties.street,
    near: properties.near,
    bound: properties.direction,
    streetNote: properties.street_note,
  };
}

/** The same of the lines that loadPoints brings; what they lack is undefined. `labelOf(class)`
 * answers the class's label. */
export function hazardsOf({ columns, rows }, labelOf) {
  const at = Object.fromEntries(columns.map((name, index) => [name, index]));
  return rows.map((row) => {
    const className = String(row[at.class]);
    return {
      id: String(row[at.id]),
      className,
      label: labelOf(className),
      latitude: row[at.latitude],
      longitude: row[at.longitude],
      confidence: row[at.confidence],
      sightings: row[at.sightings],
      state: String(row[at.state]),
      presence: row[at.presence],
      vehicles: row[at.vehicles],
      firstSeen: 1000 * row[at.first_seen_s],
      updated: 1000 * row[at.updated_s],
      sequence: row[at.sequence],
      street: row[at.street],
      near: row[at.near],
      bound: row[at.direction],
    };
  });
}

export function changeOf(feature) {
  const { properties } = feature;
  const [longitude, latitude] = feature.geometry.coordinates;
  const vanished = properties.direction === 'vanished';
  const colour = String(properties.colour);
  return {
    id: String(properties.id),
    label: String(properties.label),
    title: `${properties.label} ${vanished ? 'vanished' : 'appeared'}`,
    direction: vanished ? 'vanished' : 'appeared',
    vanished,
    colour: /^#[0-9a-f]{6}$/i.test(colour) ? colour : PLAIN,
    state: String(properties.state),
    latitude,
    longitude,
    confidence: properties.confidence,
    vehicles: properties.vehicles,
    drives: properties.drives,
    against: properties.against,
    firstSeen: Date.parse(properties.first_seen),
    lastSeen: Date.parse(properties.last_seen),
    updated: Date.parse(properties.updated),
    sigma: properties.position_sigma_m,
    sequence: properties.sequence,
  };
}
