// An official asks the next vehicle that passes for the whole frame, and sees what becomes of it.

import { element } from '../dom.js';
import { localTime } from '../format.js';
import { REJECTED } from '../hazard_state.js';
import { actOn } from '../popups/officials.js';
import { session } from '../session.js';
import { opensViewer } from '../viewer/picture_viewer.js';
import { pictureAddress } from '../viewer/picture_address.js';
import { getJson } from '../zone_lists.js';

/** So often the zone is asked whether the frame has come while somebody looks at the popup. */
const LOOK_MS = 5000;

function clock(time) {
  return element('time', { datetime: time, title: localTime(Date.parse(time)) },
    new Date(time).toLocaleTimeString(undefined, { hour: '2-digit', minute: '2-digit' }));
}

export class FrameRequests {
  /** `onDone(text, hazard, decisionId)` says what was done, `openId()` is the hazard whose popup is
   * open, and `onChange(id)` draws it anew. */
  constructor({ onDone, openId, onChange }) {
    this.onDone = onDone;
    this.openId = openId;
    this.onChange = onChange;
    /** What the zone told last, of one hazard; null while it comes. */
    this.id = null;
    this.frame = null;
    this.wrong = '';
    // A request runs out without an event of its hazard.
    if (session.decides()) setInterval(() => this.lookAgain(), LOOK_MS);
  }

  /** The part of a hazard's popup; nothing for those who do not decide. */
  section(hazard) {
    if (!session.decides() || hazard.state === REJECTED.name) return [];
    if (this.id !== hazard.id) Object.assign(this, { id: hazard.id, frame: null, wrong: '' });
    this.look(hazard.id);
    const ask = element('button', { type: 'button', class: 'quiet', 'data-focus': 'frame' },
      'Ask the next vehicle for the whole frame');
    ask.onclick = ({ currentTarget }) => this.ask(hazard, currentTarget);
    const words = this.wrong === '' ? this.words(hazard) : [this.wrong];
    return [element('div', { class: 'frame-request' },
      element('p', { class: 'frame-state', role: 'status' }, ...words),
      ...(this.frame?.state === 'waiting' ? [] : [ask]))];
  }

  lookAgain() {
    const isSettled = this.frame !== null && this.frame.state !== 'waiting';
    if (!document.hidden && this.id !== null && this.id === this.openId() && !isSettled) this.look(this.id);
  }

  async look(id) {
    const frame = await getJson(`/api/v1/hazards/${id}/frame`).catch(() => null);
    if (frame === null || this.id !== id || JSON.stringify(this.frame) === JSON.stringify(frame)) return;
    this.frame = frame;
    this.wrong = '';
    this.onChange(id);
  }

  /** How the newest request stands. */
  words(hazard) {
    const { frame } = this;
    if (frame === null || frame.state === 'none') return [];
    const asked = ['Whole frame asked for ', clock(frame.asked), ` by ${frame.official}`];
    const url = pictureAddress(frame.picture?.image);
    const picture = url === null ? 'it came, and is no longer kept'
      : opensViewer(element('a', { href: url, target: '_blank', rel: 'noopener' }, 'here it is'),
        hazard, url);
    const outcomes = {
      waiting: [', waiting for a vehicle until ', clock(frame.until)], taken: [': ', picture],
      timed_out: [': no vehicle brought one in time'], cancelled: [': taken back'],
    };
    return [...asked, ...(outcomes[frame.state] ?? [])];
  }

  async ask(hazard, button) {
    button.disabled = true;
    const { told, wrong } = await actOn(hazard, 'frame', {});
    button.disabled = false;
    if (wrong) {
      this.wrong = wrong.sentence;
      this.onChange(hazard.id);
      return;
    }
    this.onDone('Whole frame asked for', hazard, told.properties?.decision_id);
    this.look(hazard.id);
  }
}
