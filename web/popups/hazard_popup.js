// What a click on a hazard shows.

import { element } from '../dom.js';
import { localTime, percent, plural, position, streetText, utcTime } from '../format.js';
import { REJECTED, stateLabel, stateMeaning } from '../hazard_state.js';
import { awaitPicture, pictureAddress } from '../viewer/picture_address.js';
import { opensViewer } from '../viewer/picture_viewer.js';

/** A hazard remembers so many vehicles. */
const MOST_VEHICLES = 6;

/** The hazard's picture, or why there is none. */
export function pictureOf(hazard, wasThere = false) {
  // Not known yet: the place is kept, so that the popup does not jump.
  if (hazard.image === undefined) return element('div', { class: 'picture picture-coming' });
  const url = pictureAddress(hazard.image);
  if (!url) return element('p', { class: 'no-picture' }, 'No picture came with this report');
  const image = element('img', {
    class: 'picture', src: url, width: 300, height: 200,
    alt: `Camera picture with the ${hazard.label} marked`,
  });
  image.onerror = ({ currentTarget }) => {
    const note = element('p', { class: 'no-picture' }, '\u2026');
    currentTarget.closest('.picture-link').replaceWith(note);
    const say = (text) => { note.textContent = text; };
    awaitPicture(url, wasThere, () => note.isConnected, say).then((came) => {
      if (came) note.replaceWith(pictureOf(hazard, true));
    });
  };
  return opensViewer(element('a', {
    class: 'picture-link', href: url, target: '_blank', rel: 'noopener', 'data-focus': 'picture',
    title: 'Look closer, and at all pictures',
  }, image), hazard, url);
}

export function time(value) {
  return element('time', { datetime: new Date(value).toISOString(), title: utcTime(value) },
    localTime(value));
}

function row(name, ...content) {
  return [element('dt', {}, name), element('dd', {}, ...content)];
}

/** A list of facts from rows of [name, ...content]. */
export function facts(rows) {
  return element('dl', { class: 'facts' }, ...rows.flatMap((one) => row(...one)));
}

/** Reports and answers to polls both count, so there may be more vehicles than reports. */
function seenBy(hazard) {
  if (hazard.vehicles === 0) {
    return hazard.state === REJECTED.name ? 'no vehicle' : 'no vehicle that counts';
  }
  if (hazard.vehicles >= MOST_VEHICLES) return `${MOST_VEHICLES} vehicles or more`;
  return plural(hazard.vehicles, 'vehicle');
}

function bar(share) {
  const meter = element('span', { class: 'meter', 'aria-hidden': 'true' }, element('span'));
  meter.firstChild.style.width = `${Math.round(Math.min(Math.max(share, 0), 1) * 100)}%`;
  return [meter, percent(share)];
}

/** What is known of the street, and why something is not; nothing in a zone without streets. */
function streetRows(hazard, hasStreets) {
  if (!hasStreets) return [];
  const note = hazard.streetNote ? [element('span', { class: 'meaning' }, hazard.streetNote)] : [];
  const unknown = hazard.streetNote === undefined ? '\u2026' : 'Not known';
  return [['Street', streetText(hazard) || unknown, ...note]];
}

/** The popup's content as a detached element; `more` are further rows of facts, `extras` what people
 * can do with the hazard.
 * Lists know less of a hazard than it has: what is undefined is shown when it has come. */
export function popupContent(hazard, catalogue, hasStreets, more, extras) {
  const sigma = Number.isFinite(hazard.sigma) ? ` \u00b1 ${hazard.sigma.toFixed(1)} m` : '';
  const state = element('span', { class: `state state-${hazard.state}` }, stateLabel(hazard.state));
  const isRejected = hazard.state === REJECTED.name;
  const rows = [
    ['State', state, element('span', { class: 'meaning' }, stateMeaning(hazard.state))],
    ...streetRows(hazard, hasStreets),
    ['Position', element('span', { class: 'copyable' },
      position(hazard.latitude, hazard.longitude)), sigma],
    // Its line is kept until it has come, so that the popup does not grow under the mouse.
    ['Last seen', hazard.lastSeen === undefined ? '\u2026' : time(hazard.lastSeen)],
    ...(hazard.firstSeen === hazard.lastSeen ? [] : [['First seen', time(hazard.firstSeen)]]),
    ['Reported', plural(hazard.sightings, 'time')],
    [isRejected ? 'Seen since' : 'Seen by', seenBy(hazard)],
    ['Confidence', ...bar(hazard.confidence)],
    ...(isRejected ? [] : [['Still there', ...bar(hazard.presence)]]),
    ...more,
  ];
  return element('article', {
    class: 'popup', role: 'dialog', tabindex: '-1', 'aria-label': hazard.label,
    'data-hazard': hazard.id,
  },
  pictureOf(hazard),
  element('h3', { class: 'popup-title' }, catalogue.badge(hazard.className, hazard.state),
    element('span', {}, hazard.label)),
  facts(rows),
  ...extras);
}
