// Officials confirm and reject hazards, confirm and dismiss map changes, and distrust vehicles.
// The token is asked for once and kept as long as the tab lives, in sessionStorage; it is only ever
// sent to this server.

import { byId, element } from './dom.js';
import { ago, localTime, position } from './format.js';
import { REJECTED } from './hazard_state.js';

const KEY = 'livemap.token';
const HAZARDS_HISTORY = 'kept in the hazard\u2019s history';
const CHANGES_HISTORY = 'kept in the map change\u2019s history';

/** `call`: below the subject's address. `bad`: it takes something away, and must say why. `focus`
 * names the button, where `call` does not; `body` is sent besides the reason. */
const DECISIONS = {
  confirm: { call: 'confirm', title: 'Confirm this hazard?', button: 'Confirm', done: 'Confirmed',
    note: 'Drivers are told of it from now on.',
    reason: `Reason, ${HAZARDS_HISTORY}; may stay empty` },
  restore: { call: 'confirm', title: 'Put this hazard back?', button: 'Put back', done: 'Put back',
    note: 'It is confirmed, and drivers are told of it from now on.',
    reason: `Reason, ${HAZARDS_HISTORY}; may stay empty` },
  reject: { call: 'reject', title: 'Reject this hazard?', button: 'Reject', done: 'Rejected',
    bad: true, note: '', reason: `Reason, ${HAZARDS_HISTORY}` },
  confirmChange: { call: 'decision', focus: 'confirm', body: { decision: 'confirm' },
    title: 'Confirm this map change?', button: 'Confirm', done: 'Confirmed', note: '',
    reason: `Reason, ${CHANGES_HISTORY}; may stay empty` },
  dismissChange: { call: 'decision', focus: 'dismiss', body: { decision: 'dismiss' },
    title: 'Dismiss this map change?', button: 'Dismiss', done: 'Dismissed', bad: true,
    note: 'Vehicles that tell it again do not bring it back.',
    reason: `Reason, ${CHANGES_HISTORY}` },
  distrust: { call: 'distrust', title: 'Distrust this vehicle?', button: 'Distrust',
    done: 'Distrusted', bad: true,
    note: 'What it said is taken back from all hazards: those that nobody else saw go, those that '
      + 'too few others saw are unconfirmed again. For a while it counts as no witness: a week, '
      + 'unless the zone is set otherwise. None of this can be undone.',
    reason: 'Reason, kept in the history of each of these hazards' },
};

/** Where the browser keeps no session, the token lives in the page alone. */
const memory = new Map();

function savedToken() {
  try {
    return sessionStorage.getItem(KEY) ?? '';
  } catch (blocked) {
    return memory.get(KEY) ?? '';
  }
}

function saveToken(token) {
  try {
    if (token) sessionStorage.setItem(KEY, token);
    else sessionStorage.removeItem(KEY);
  } catch (blocked) {
    memory.set(KEY, token);
  }
}

/** Sends a decision; answers null when it was taken, else what is wrong: {status, sentence}. */
async function send(subject, { call, body }, reason, token) {
  let answer;
  try {
    answer = await fetch(`${subject.address}/${call}`, {
      method: 'POST', cache: 'no-store', credentials: 'omit',
      headers: { Authorization: `Bearer ${token}`, 'Content-Type': 'application/json' },
      body: JSON.stringify({ ...body, ...(reason ? { reason } : {}) }),
    });
  } catch (failure) {
    return { status: 0, sentence: 'The zone does not answer. Try again in a moment.' };
  }
  if (answer.ok) return null;
  const told = await answer.json().catch(() => ({}));
  return { status: answer.status, sentence: sentenceFor(answer.status, told.error, subject) };
}

function sentenceFor(status, error, subject) {
  if (status === 401) return 'This token is not known here. Check it and try again.';
  const what = subject.change ? 'map change' : 'hazard';
  if (status === 409) return `This ${what} is no longer on the map.`;
  return error ? `${error.charAt(0).toUpperCase()}${error.slice(1)}.` : `The zone answered ${status}.`;
}

/** What a decision is about: its address in the API, and how it reads. */
function hazardSubject(hazard) {
  return {
    address: `/api/v1/hazards/${hazard.id}`, hazard, name: hazard.label,
    detail: `${position(hazard.latitude, hazard.longitude)}, last seen ${localTime(hazard.lastSeen)}`,
  };
}

function changeSubject(change) {
  return {
    address: `/api/v1/changes/${change.id}`, change, name: change.title,
    detail: `${position(change.latitude, change.longitude)}, last seen ${localTime(change.lastSeen)}`,
  };
}

function vehicleSubject(vehicle) {
  return {
    address: `/api/v1/vehicles/${encodeURIComponent(vehicle.id)}`, vehicle, name: vehicle.id,
    detail: `last heard of ${ago(vehicle.heard)}`,
  };
}

export class Officials {
  /** `enabled`: the server has officials. `onDone(text)` announces what was done,
   * `onClosed({hazard, change, vehicle}, focus)` is called when the dialog goes away: one of the
   * three is set, `focus` names the control that opened it. */
  constructor(enabled, onDone, onClosed) {
    this.enabled = enabled;
    this.onDone = onDone;
    this.onClosed = onClosed;
    this.dialog = byId('decision');
    this.token = byId('decision-token');
    this.reason = byId('decision-reason');
    this.error = byId('decision-error');
    this.submit = byId('decision-submit');
    this.subject = null;
    this.decision = null;
    byId('decision-form').addEventListener('submit', (event) => {
      event.preventDefault();
      this.decide();
    });
    byId('decision-cancel').addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('close', () => {
      this.token.value = '';
      this.onClosed(this.subject, this.decision.focus ?? this.decision.call);
    });
  }

  isAsking() {
    return this.dialog.open;
  }

  /** The buttons of a hazard's popup; nothing where nobody may decide. */
  buttons(hazard) {
    const offered = hazard.state === REJECTED.name ? ['restore'] : ['confirm', 'reject'];
    return this.row(hazardSubject(hazard), offered);
  }

  /** Those of a map change's popup. */
  changeButtons(change) {
    return this.row(changeSubject(change), ['confirmChange', 'dismissChange']);
  }

  /** Those of a vehicle's popup. */
  vehicleButtons(vehicle) {
    return this.row(vehicleSubject(vehicle), ['distrust']);
  }

  row(subject, offered) {
    if (!this.enabled) return [];
    return [element('div', { class: 'decisions' }, ...offered.map((name) => {
      const { call, focus = call, button, bad } = DECISIONS[name];
      const node = element('button', { type: 'button', 'data-focus': focus,
        class: bad ? 'decide decide-reject' : 'decide' }, `${button}\u2026`);
      node.addEventListener('click', () => this.ask(subject, DECISIONS[name]));
      return node;
    }))];
  }

  ask(subject, decision) {
    this.subject = subject;
    this.decision = decision;
    byId('decision-title').textContent = decision.title;
    byId('decision-label').textContent = `${subject.name}, ${subject.detail}`;
    byId('decision-note').textContent = decision.note;
    byId('decision-reason-label').textContent = decision.reason;
    this.submit.textContent = decision.button;
    this.submit.classList.toggle('decide-reject', decision.bad === true);
    this.reason.value = '';
    this.show('', savedToken() === '');
    this.dialog.showModal();
    this.reason.focus();
  }

  /** An error, and whether the token must be given. */
  show(error, needsToken) {
    this.error.textContent = error;
    byId('decision-token-row').hidden = !needsToken;
    this.submit.disabled = false;
  }

  async decide() {
    const { subject, decision } = this;
    const token = this.token.value.trim() || savedToken();
    const reason = this.reason.value.trim().replace(/\s+/g, ' ');
    if (decision.bad && reason === '') return this.refuse('Please say why.', this.reason);
    if (token === '') return this.refuse('Please enter your token.', this.token);
    if (/[^\x21-\x7e]/.test(token)) {
      return this.refuse('A token has no blanks or special letters.', this.token);
    }
    this.submit.disabled = true;
    const wrong = await send(subject, decision, reason, token);
    if (this.subject !== subject || !this.dialog.open) return undefined;
    if (wrong !== null) {
      if (wrong.status === 401) saveToken('');
      return this.refuse(wrong.sentence, wrong.status === 401 ? this.token : this.submit);
    }
    saveToken(token);
    this.dialog.close();
    return this.onDone(`${decision.done}: ${subject.name}`);
  }

  refuse(sentence, field) {
    this.show(sentence, savedToken() === '');
    field.focus();
    if (field === this.token) field.select();
  }
}
