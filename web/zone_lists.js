// Fetches what stands in the zone.

import { addressOf } from './address.js';

const PAGE = 10000;
/** Without an answer for so long the zone is asked anew. */
const PATIENCE_MS = 60000;

export async function getJson(path) {
  const answer = await fetch(addressOf(path),
    { cache: 'no-store', signal: AbortSignal.timeout(PATIENCE_MS) });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer.json();
}

/** The streets of a box [west, south, east, north] in degrees at a zoom: GeoJSON. They change only with
 * the zone's file, so the browser may keep them for a while. */
export async function getStreets(box, zoom) {
  const path = `/api/v1/streets?bbox=${box.join(',')}&zoom=${zoom}`;
  const answer = await fetch(addressOf(path), { signal: AbortSignal.timeout(PATIENCE_MS) });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer.json();
}

/** All map changes that are on the map: {sequence, features}. With `none` there are none to be seen,
 * up to any sequence. */
export async function loadChanges(none = false) {
  if (none) return { sequence: Infinity, features: [] };
  const path = `/api/v1/changes?limit=${PAGE}`;
  let page = await getJson(path);
  const latest = new Map();
  for (;;) {
    for (const feature of page.features) {
      if (feature.properties.action === 'removed') latest.delete(feature.id);
      else latest.set(feature.id, feature);
    }
    if (!page.truncated) return { sequence: page.sequence, features: [...latest.values()] };
    page = await getJson(`${path}&since=${page.sequence}`);
  }
}

/** All hazards in one `state`, or on the map, a line of JSON each, read as they come:
 * {sequence, columns, rows}. There may be fewer rows than the header counts: what changes meanwhile
 * is left out, and told by the live stream. */
export async function loadPoints(state = null) {
  const answer = await fetch(
    addressOf(`/api/v1/hazards/points${state === null ? '' : `?state=${state}`}`),
    { cache: 'no-store', signal: AbortSignal.timeout(PATIENCE_MS) });
  if (!answer.ok) throw new Error(`points: ${answer.status}`);
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let header = null;
  let rest = '';
  const rows = [];
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    const end = value.lastIndexOf('\n');
    if (end < 0) {
      rest += value;
      continue;
    }
    // One call of the parser for many lines: no line has a line break within.
    const lines = JSON.parse(`[${(rest + value.slice(0, end)).replaceAll('\n', ',')}]`);
    rest = value.slice(end + 1);
    header ??= lines.shift();
    for (const line of lines) rows.push(line);
  }
  if (header === null || rest !== '') throw new Error('points: cut off');
  return { sequence: header.sequence, columns: header.columns, rows };
}
