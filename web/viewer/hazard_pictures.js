// All pictures of a hazard: that by which one decides, and for those who have logged in those of every
// sighting and of every answer to a poll.

import { localTime, percent } from '../format.js';
import { session } from '../session.js';
import { getJson } from '../zone_lists.js';
import { pictureAddress } from './picture_address.js';

const ANSWERS = { yes: 'is there', no: 'was not found', cant_see: 'was in view, and not recognised' };

/** What the picture of a sighting shows, in words. */
export function sightingWords({ confidence, merged }) {
  return `${percent(confidence)} sure${merged ? ', of the one that was merged' : ''}`;
}

/** What the picture of an answer shows, in words. */
export function answerWords({ answer, whole_frame: isWhole }) {
  return `${isWhole ? 'Whole frame, asked for by an official' : 'A vehicle was asked'}: it ${
    ANSWERS[answer] ?? 'was looked for'}`;
}

/** A picture of the viewer: its `url`, `words` beside it, `alt` for those who do not see it. */
function pictureOf(hazard, { image, time }, words) {
  const at = localTime(Date.parse(time));
  return { url: pictureAddress(image), time: Date.parse(time), words: `${at} \u00b7 ${words}`,
    alt: `Camera picture with the ${hazard.label} marked, ${at}` };
}

/** The hazard's own picture alone. */
export function ownPicture(hazard) {
  return { url: pictureAddress(hazard.image), time: hazard.lastSeen,
    words: `Last seen ${localTime(hazard.lastSeen)}`,
    alt: `Camera picture with the ${hazard.label} marked` };
}

/** All that there are, the newest first, each once; the hazard's own alone where no more may be seen.
 * Throws where the zone does not answer. */
export async function loadPictures(hazard) {
  const own = ownPicture(hazard);
  if (session.name === null) return [own];
  const { sightings, answers = [] } = await getJson(`/api/v1/hazards/${hazard.id}/sightings`);
  const all = [...sightings.map((one) => pictureOf(hazard, one, sightingWords(one))),
    ...answers.map((one) => pictureOf(hazard, one, answerWords(one)))]
    .filter(({ url }) => url !== null).sort((a, b) => b.time - a.time);
  const once = all.filter(({ url }, at) => all.findIndex((other) => other.url === url) === at);
  return once.some(({ url }) => url === own.url) || own.url === null ? once : [own, ...once];
}
