// One unconfirmed hazard after the other, each with its pictures side by side, for an official at a
// keyboard.

import { byId, element } from '../dom.js';
import { ago, percent, plural, position } from '../format.js';
import { hazardOf } from '../hazard_record.js';
import { decideOn } from '../popups/officials.js';
import { pictureOf } from '../popups/hazard_popup.js';
import { session } from '../session.js';
import { pictureAddress } from '../viewer/picture_address.js';
import { loadPictures } from '../viewer/hazard_pictures.js';
import { opensViewer } from '../viewer/picture_viewer.js';
import { getJson } from '../zone_lists.js';

const MOST = 200;
/** Pictures beside the hazard's own; the viewer has all. */
const MOST_OTHERS = 3;
/** Keys of the buttons, by the letter on them. */
const KEYS = { c: 'review-confirm', r: 'review-reject', n: 'review-next', u: 'review-undo',
  m: 'review-map' };

export class ReviewQueue {
  /** `onShow(hazard)` shows it on the map; `onDone()` is called after each decision. */
  constructor(onShow, onDone) {
    this.onShow = onShow;
    this.onDone = onDone;
    this.dialog = byId('review');
    this.reason = byId('review-reason');
    this.error = byId('review-error');
    this.hazards = [];
    this.at = 0;
    /** What was decided here, the newest last: {hazard, at, undo, decisionId}. */
    this.decided = [];
    this.isBusy = false;
    const open = byId('review-open');
    open.hidden = !session.decides();
    open.addEventListener('click', () => this.open());
    byId('review-confirm').addEventListener('click', () => this.decide('confirm'));
    byId('review-reject').addEventListener('click', () => this.decide('reject'));
    byId('review-next').addEventListener('click', () => this.show(this.at + 1));
    byId('review-undo').addEventListener('click', () => this.undo());
    byId('review-map').addEventListener('click', () => this.showOnMap());
    byId('review-close').addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('keydown', (event) => this.onKey(event));
    byId('review-form').addEventListener('submit', (event) => {
      event.preventDefault();
      this.decide('reject');
    });
  }

  async open() {
    this.decided = [];
    this.hazards = [];
    this.say('');
    this.dialog.showModal();
    // Not the field, in which keys are letters.
    byId('review-close').focus();
    byId('review-subject').replaceChildren('Loading');
    try {
      const told = await getJson(`/api/v1/hazards?state=candidate&limit=${MOST}`);
      this.hazards = told.features.map(hazardOf);
      this.isCut = told.truncated;
    } catch (failure) {
      this.say('The zone does not answer. Close this and try again.');
    }
    this.show(0);
  }

  onKey(event) {
    const isTyping = event.target === this.reason;
    const id = KEYS[event.key.toLowerCase()];
    if (isTyping || id === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (!byId(id).disabled) byId(id).click();
  }

  get current() {
    return this.hazards[this.at];
  }

  show(at) {
    this.at = Math.min(at, this.hazards.length);
    const hazard = this.current;
    for (const id of ['review-confirm', 'review-reject', 'review-next', 'review-map']) {
      byId(id).disabled = hazard === undefined;
    }
    byId('review-undo').disabled = this.decided.length === 0;
    byId('review-place').textContent = hazard === undefined ? ''
      : `${this.at + 1} of ${this.hazards.length}${this.isCut ? ' and more' : ''}`;
    byId('review-picture').replaceChildren(...(hazard === undefined ? [] : [pictureOf(hazard)]));
    this.showOthers(hazard);
    byId('review-subject').replaceChildren(...(hazard === undefined
      ? [this.hazards.length === 0 ? 'Nothing waits for a decision.' : 'That was the last one.']
      : [element('strong', {}, hazard.label), element('span', {}, `${plural(hazard.sightings, 'report')} of ${
        plural(hazard.vehicles, 'vehicle')}, ${percent(hazard.confidence)} sure, last seen ${
        ago(hazard.lastSeen)}`), element('span', {}, position(hazard.latitude, hazard.longitude))]));
    // The keys are the dialog's: they need the focus within it.
    const button = byId(hazard === undefined ? 'review-close' : 'review-confirm');
    if (document.activeElement !== this.reason) button.focus();
  }

  /** Pictures of other reports beside it: whether all show the same thing. */
  async showOthers(hazard) {
    const others = byId('review-others');
    others.replaceChildren();
    if (hazard === undefined) return;
    const pictures = await loadPictures(hazard).catch(() => []);
    if (this.current !== hazard) return;
    const own = pictureAddress(hazard.image);
    others.replaceChildren(...pictures.filter(({ url }) => url !== null && url !== own)
      .slice(0, MOST_OTHERS).map(({ url, words, alt }) => opensViewer(element('a', {
        class: 'review-other', href: url, target: '_blank', rel: 'noopener', title: words,
      }, element('img', { src: url, alt, width: 180, height: 120 }),
      element('span', {}, words)), hazard, url)));
  }

  say(error) {
    this.error.textContent = error;
  }

  async decide(name) {
    const hazard = this.current;
    const reason = this.reason.value.trim().replace(/\s+/g, ' ');
    if (hazard === undefined || this.isBusy) return;
    if (name === 'reject' && reason === '') {
      this.say('Please say why.');
      this.reason.focus();
      return;
    }
    this.isBusy = true;
    const { told, wrong } = await decideOn(hazard, name, name === 'reject' ? reason : '');
    this.isBusy = false;
    if (wrong && wrong.status !== 409) {
      this.say(wrong.sentence);
      return;
    }
    // Somebody, or a vehicle, was faster: it is no candidate any more, or another than was seen.
    this.say(wrong ? `${hazard.label}: ${wrong.sentence}` : '');
    if (!wrong) this.decided.push({ hazard, at: this.at, id: told.properties?.decision_id });
    this.reason.blur();
    this.show(this.at + 1);
    this.onDone();
  }

  async undo() {
    const last = this.decided.pop();
    if (last === undefined || this.isBusy) return;
    this.isBusy = true;
    const { wrong } = await decideOn(last.hazard, 'undo', '', last.id);
    this.isBusy = false;
    this.say(wrong ? wrong.sentence : '');
    if (!wrong) {
      // What is known of it is of before the two decisions.
      const fresh = await getJson(`/api/v1/hazards/${last.hazard.id}`).catch(() => null);
      if (fresh) this.hazards[last.at] = hazardOf(fresh);
    }
    this.show(wrong ? this.at : last.at);
    this.onDone();
  }

  showOnMap() {
    const hazard = this.current;
    this.dialog.close();
    this.onShow(hazard);
  }
}
