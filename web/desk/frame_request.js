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
  /** `onDone(text, hazard, decisionId)` says what was done. */
  constructor(onDone) {
    this.onDone = onDone;
    /** What the zone told last, by hazard, so that a popup that is drawn anew does not jump. */
    this.told = { id: null, frame: null };
  }

  /** The part of a hazard's popup; nothing for those who do not decide. */
  section(hazard) {
    if (!session.decides() || hazard.state === REJECTED.name) return [];
    const node = element('div', { class: 'frame-request' });
    this.draw(node, hazard, this.told.id === hazard.id ? this.told.frame : null);
    this.look(node, hazard);
    return [node];
  }

  async look(node, hazard) {
    for (;;) {
      let frame = null;
      try {
        frame = await getJson(`/api/v1/hazards/${hazard.id}/frame`);
      } catch (failure) {
        // Asked again in a while.
      }
      if (frame !== null) this.keep(node, hazard, frame);
      if (frame !== null && frame.state !== 'waiting') return;
      await new Promise((resolve) => { setTimeout(resolve, LOOK_MS); });
      if (!node.isConnected) return;
    }
  }

  keep(node, hazard, frame) {
    const isNew = this.told.id !== hazard.id || JSON.stringify(this.told.frame) !== JSON.stringify(frame);
    this.told = { id: hazard.id, frame };
    if (isNew) this.draw(node, hazard, frame);
  }

  draw(node, hazard, frame) {
    const isWaiting = frame?.state === 'waiting';
    const ask = element('button', { type: 'button', class: 'quiet', 'data-focus': 'frame' },
      'Ask the next vehicle for the whole frame');
    ask.onclick = () => this.ask(node, hazard, ask);
    const hadFocus = node.contains(document.activeElement);
    node.replaceChildren(element('p', { class: 'frame-state', role: 'status' }, ...this.words(hazard, frame)),
      ...(isWaiting ? [] : [ask]));
    if (hadFocus) (node.querySelector('button, a') ?? node.closest('.popup'))?.focus();
  }

  /** How the newest request stands. */
  words(hazard, frame) {
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

  async ask(node, hazard, button) {
    button.disabled = true;
    const { told, wrong } = await actOn(hazard, 'frame', {});
    if (wrong) {
      button.disabled = false;
      node.querySelector('.frame-state').textContent = wrong.sentence;
      return;
    }
    this.onDone('Whole frame asked for', hazard, told.properties?.decision_id);
    this.look(node, hazard);
  }
}
