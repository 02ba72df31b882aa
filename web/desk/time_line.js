// A hazard's history as a time line: what happened to it, what officials did, and for those who have
// logged in every sighting with its picture. Fetched when somebody opens it in the popup.

import { element } from '../dom.js';
import { localTime, utcTime } from '../format.js';
import { stateLabel } from '../hazard_state.js';
import { session } from '../session.js';
import { answerWords, sightingWords } from '../viewer/hazard_pictures.js';
import { pictureAddress } from '../viewer/picture_address.js';
import { opensViewer } from '../viewer/picture_viewer.js';
import { getJson } from '../zone_lists.js';

const MOST_EVENTS = 50;
const MOST_DECISIONS = 50;
/** Their words stand in the events already. */
const IN_EVENTS = ['confirm', 'reject', 'close', 'class', 'move', 'undo'];
const DONE = { comment: 'Comment', assign: 'Assigned', merge: 'Merged', frame: 'Whole frame asked for',
  close_order: 'Work order closed', retry_order: 'Work order sent again' };
/** Nothing that was sent can be taken back. */
export const OF_ORDERS = ['close_order', 'retry_order'];

/** What happened, as {time, nodes}, each source by itself; null where it cannot be had. */
async function load(hazard) {
  const isSeen = session.name !== null;
  const wanted = [getJson(`/api/v1/hazards/${hazard.id}/events?limit=${MOST_EVENTS}`)];
  if (isSeen) {
    wanted.push(getJson(`/api/v1/decisions?limit=${MOST_DECISIONS}&hazard=${hazard.id}`),
      getJson(`/api/v1/hazards/${hazard.id}/sightings`));
  }
  const [events, decisions = { decisions: [] }, sightings = { sightings: [] }] = await Promise.all(wanted);
  return { events: events.events, decisions: decisions.decisions, sightings: sightings.sightings,
    answers: sightings.answers ?? [] };
}

export class HazardHistory {
  /** `onChange(id)` is called when the hazard's popup must be drawn anew, `onUndo(hazard, id)` when
   * the decision is to be taken back. */
  constructor(onChange, onUndo) {
    this.onChange = onChange;
    this.onUndo = onUndo;
    this.openId = null;
    this.sequence = null;
    this.told = null;
    this.failed = false;
  }

  /** The part of a popup that can be opened. */
  section(hazard) {
    const open = this.openId === hazard.id;
    if (open && this.sequence !== hazard.sequence) this.load(hazard);
    const details = element('details', { class: 'history', open: open ? '' : null },
      element('summary', { 'data-focus': 'history' }, 'History'), ...(open ? [this.content(hazard)] : []));
    details.ontoggle = ({ currentTarget }) => {
      if (currentTarget.open === (this.openId === hazard.id)) return;
      this.openId = currentTarget.open ? hazard.id : null;
      this.sequence = null;
      this.told = null;
      this.failed = false;
      this.onChange(hazard.id);
    };
    return details;
  }

  /** Something was decided of which no event tells. */
  renew(hazard) {
    if (this.openId === hazard.id) this.load(hazard);
  }

  async load(hazard) {
    const { id, sequence } = hazard;
    this.sequence = sequence;
    let told = null;
    try {
      told = await load(hazard);
    } catch (failure) {
      // Shown instead of the list.
    }
    if (this.openId !== id || this.sequence !== sequence) return;
    this.failed = told === null;
    this.told = told ?? this.told;
    this.onChange(id);
  }

  content(hazard) {
    if (this.failed) return element('p', { class: 'history-note' }, 'The history cannot be loaded');
    if (this.told === null) return element('p', { class: 'history-note' }, 'Loading');
    const { events, decisions, sightings, answers } = this.told;
    const lines = [...events.map(eventLine),
      ...sightings.map((one) => pictureLine(hazard, one, 'Seen', sightingWords(one))),
      ...answers.map((one) => pictureLine(hazard, one, 'Asked', answerWords(one))),
      ...decisions.filter(({ decision }) => !IN_EVENTS.includes(decision))
        .map((decision) => this.decisionLine(hazard, decision))];
    // Stable: what happened at one time stays in the order of its source, the newest first.
    lines.reverse();
    lines.sort((a, b) => b.time - a.time);
    return element('ol', { class: 'history-list', tabindex: '0', 'aria-label': 'Newest first' },
      ...lines.map(({ item }) => item));
  }

  decisionLine(hazard, { id, decision, detail, reason, official, time, undone_by: undoneBy }) {
    const isUndone = undoneBy !== null;
    const at = Date.parse(time);
    const item = element('li', { class: isUndone ? 'trail-undone' : '' }, timeOf(time),
      element('span', { class: 'history-step' }, [DONE[decision] ?? decision, detail]
        .filter((text) => text !== '').join(' ')),
      element('span', { class: 'history-reason' }, [reason, official, isUndone ? 'taken back' : '']
        .filter((text) => text !== '').join(' \u00b7 ')));
    if (session.decides() && !isUndone && !OF_ORDERS.includes(decision)) {
      const undo = element('button', { class: 'quiet', type: 'button' },
        decision === 'merge' ? 'Split\u2026' : 'Undo\u2026');
      undo.onclick = () => this.onUndo(hazard, id);
      item.append(undo);
    }
    return { time: at, item };
  }
}

function timeOf(time) {
  const at = Date.parse(time);
  return element('time', { datetime: time, title: utcTime(at) }, localTime(at));
}

function eventLine(event) {
  const step = event.from === null || event.from === event.to
    ? stateLabel(event.to) : `${stateLabel(event.from)} \u2192 ${stateLabel(event.to)}`;
  return { time: Date.parse(event.time), item: element('li', {}, timeOf(event.time),
    element('span', { class: 'history-step' }, step),
    element('span', { class: 'history-reason' }, event.reason)) };
}

/** A line with a picture, which opens in the viewer. */
function pictureLine(hazard, { time, image, why_no_image: why }, step, words) {
  const url = pictureAddress(image);
  const picture = url === null ? element('span', { class: 'history-no-picture' }, why ?? 'no picture')
    : opensViewer(element('a', { class: 'history-picture', href: url, target: '_blank', rel: 'noopener' },
      element('img', { src: url, loading: 'lazy', width: 96, height: 64,
        alt: `Picture of ${localTime(Date.parse(time))}` })), hazard, url);
  return { time: Date.parse(time), item: element('li', { class: 'history-sighting' }, timeOf(time),
    element('span', { class: 'history-step' }, step),
    element('span', { class: 'history-reason' }, words), picture) };
}
