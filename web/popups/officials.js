// Officials confirm and reject hazards, confirm and dismiss map changes, distrust vehicles, and take
// all of this back.
// Who has logged in decides by the session. Where the zone has no accounts, a token is asked for once
// and kept as long as the tab lives, in sessionStorage; it is only ever sent to this server.

import { addressOf, storageKey } from '../address.js';
import { byId, element } from '../dom.js';
import { ago, localTime, plural, position } from '../format.js';
import { REJECTED } from '../hazard_state.js';
import { askToLogIn, session } from '../session.js';

const KEY = storageKey('livemap.token');
const HAZARDS_HISTORY = 'kept in the hazard\u2019s history';
const CHANGES_HISTORY = 'kept in the map change\u2019s history';

const STAY_EMPTY = 'may stay empty';
const NO_ANSWER = 'The zone does not answer. Try again in a moment.';

/** `call`: below the subject's address. `bad`: it takes something away, and must say why. `focus`
 * names the button, where `call` does not; `body` is sent besides the reason. `undo` names what
 * takes it back; `preview`: what it would change is shown first. */
const DECISIONS = {
  confirm: { call: 'confirm', title: 'Confirm this hazard?', button: 'Confirm', done: 'Confirmed',
    note: 'Drivers are told of it from now on.', undo: 'undo',
    reason: `Reason, ${HAZARDS_HISTORY}; ${STAY_EMPTY}` },
  restore: { call: 'confirm', title: 'Put this hazard back?', button: 'Put back', done: 'Put back',
    note: 'It is confirmed, and drivers are told of it from now on. To have it as it was before it '
      + 'was rejected, choose Undo instead.', undo: 'undo',
    reason: `Reason, ${HAZARDS_HISTORY}; ${STAY_EMPTY}` },
  reject: { call: 'reject', title: 'Reject this hazard?', button: 'Reject', done: 'Rejected',
    bad: true, note: '', undo: 'undo', reason: `Reason, ${HAZARDS_HISTORY}` },
  undo: { call: 'undo', title: 'Take the newest decision back?', button: 'Undo', done: 'Undone',
    note: 'The hazard is what it was before the newest decision of an official. What vehicles have '
      + 'said since counts.', none: 'No decision about this hazard stands that could be undone.',
    reason: `Reason, ${HAZARDS_HISTORY}; ${STAY_EMPTY}` },
  confirmChange: { call: 'decision', focus: 'confirm', body: { decision: 'confirm' },
    title: 'Confirm this map change?', button: 'Confirm', done: 'Confirmed', note: '',
    undo: 'undoChange', reason: `Reason, ${CHANGES_HISTORY}; ${STAY_EMPTY}` },
  dismissChange: { call: 'decision', focus: 'dismiss', body: { decision: 'dismiss' },
    title: 'Dismiss this map change?', button: 'Dismiss', done: 'Dismissed', bad: true,
    note: 'Vehicles that tell it again do not bring it back.', undo: 'undoChange',
    reason: `Reason, ${CHANGES_HISTORY}` },
  undoChange: { call: 'decision', focus: 'undo', body: { decision: 'undo' },
    title: 'Take the newest decision back?', button: 'Undo', done: 'Undone',
    note: 'The map change is what it was before the newest decision of an official.',
    none: 'No decision about this map change stands that could be undone.',
    reason: `Reason, ${CHANGES_HISTORY}; ${STAY_EMPTY}` },
  distrust: { call: 'distrust', title: 'Distrust this vehicle?', button: 'Distrust',
    done: 'Distrusted', bad: true, undo: 'trust', preview: true,
    note: 'What it said is taken back from all hazards: those that nobody else saw go, those that '
      + 'too few others saw are unconfirmed again. For a while it counts as no witness: a week, '
      + 'unless the zone is set otherwise.',
    reason: 'Reason, kept in the history of each of these hazards' },
  trust: { call: 'trust', title: 'Trust this vehicle again?', button: 'Trust again',
    done: 'Trusted again',
    note: 'Every distrust of it is taken back. Hazards that it changed are as they were before, and '
      + 'what others have said since counts.',
    reason: `Reason, kept in the history of each of these hazards; ${STAY_EMPTY}` },
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

function lacksToken() {
  return !session.decides() && savedToken() === '';
}

/** What says who decides. */
function credentialsOf(token) {
  return session.decides()
    ? { credentials: 'same-origin', headers: { 'X-CSRF-Token': session.csrfToken } }
    : { credentials: 'omit', headers: { Authorization: `Bearer ${token}` } };
}

/** Retries or closes a work order, as `call` says: {told} or {wrong}, as ask. */
export async function actOnOrder(id, call) {
  const { credentials, headers } = credentialsOf(savedToken());
  let answer;
  try {
    answer = await fetch(addressOf(`/api/v1/orders/${encodeURIComponent(id)}/${call}`),
      { method: 'POST', cache: 'no-store', credentials, headers });
  } catch (failure) {
    return { wrong: { status: 0, sentence: NO_ANSWER } };
  }
  const told = await answer.json().catch(() => ({}));
  return answer.ok ? { told }
    : { wrong: { status: answer.status, sentence: sentenceFor(answer.status, told.error, {}, true) } };
}

/** Asks the zone as an official: {told} or, in words, what is {wrong: {status, sentence}}. */
async function ask(subject, { call, none }, token, body = null) {
  let answer;
  const { credentials, headers } = credentialsOf(token);
  try {
    answer = await fetch(addressOf(`${subject.address}/${call}`), {
      method: body === null ? 'GET' : 'POST', cache: 'no-store', credentials,
      headers: { ...headers, ...(body === null ? {} : { 'Content-Type': 'application/json' }) },
      body: body === null ? undefined : JSON.stringify(body),
    });
  } catch (failure) {
    return { wrong: { status: 0, sentence: NO_ANSWER } };
  }
  const told = await answer.json().catch(() => ({}));
  if (answer.ok) return { told };
  // Then the zone says which of two it is.
  const isNamed = (body !== null && 'decision_id' in body) || told.changed === true;
  const sentence = answer.status === 409 && none && !isNamed ? none
    : sentenceFor(answer.status, told.error, subject, isNamed);
  return { wrong: { status: answer.status, sentence } };
}

/** `undoes`: id of the decision that is meant, where only that one may be taken back. A hazard that
 * is confirmed or rejected goes with what was on the screen of it: it may have changed since. */
function bodyOf(subject, decision, reason, undoes) {
  const { hazard } = subject;
  const isSeen = Number.isInteger(hazard?.sequence) && ['confirm', 'reject'].includes(decision.call);
  return { ...decision.body, ...(reason ? { reason } : {}),
    ...(undoes === undefined ? {} : { decision_id: undoes }),
    ...(isSeen ? { sequence: hazard.sequence, position: [hazard.longitude, hazard.latitude] } : {}) };
}

/** Decides about a hazard as it was seen, without a question: as ask. */
export function decideOn(hazard, name, reason, undoes = undefined) {
  const decision = DECISIONS[name];
  return ask(hazardSubject(hazard), decision, savedToken(), bodyOf({ hazard }, decision, reason, undoes));
}

/** Does at the desk what `call` names, as: ask. */
export function actOn(hazard, call, body) {
  return ask(hazardSubject(hazard), { call }, savedToken(), body);
}

function sentenceFor(status, error, subject, isNamed) {
  if (status === 401 && session.decides()) return 'Your session has ended. Reload the page and log in.';
  if (status === 401) return 'This token is not known here. Check it and try again.';
  const what = subject.change ? 'map change' : 'hazard';
  if (status === 409 && !isNamed) return `This ${what} is no longer on the map.`;
  return error ? `${error.charAt(0).toUpperCase()}${error.slice(1)}.` : `The zone answered ${status}.`;
}

/** What a distrust would change, in a sentence or two. */
function previewText({ distrusted, would_change: changes, would_vanish: vanish }) {
  const vanishing = vanish === 0 ? 'none of them vanishes'
    : `${vanish.toLocaleString('en')} of them ${vanish === 1 ? 'vanishes' : 'vanish'} from the map`;
  const text = changes === 0 ? 'Now it would change no hazard.'
    : `Now it would change ${plural(changes, 'hazard')}; ${vanishing}.`;
  return distrusted ? `This vehicle is distrusted already. ${text}` : text;
}

/** What a decision is about: its address in the API, and how it reads. */
function hazardSubject(hazard) {
  return {
    address: `/api/v1/hazards/${hazard.id}`, hazard, name: hazard.label,
    detail: `${position(hazard.latitude, hazard.longitude)}, last seen ${
      localTime(hazard.lastSeen ?? hazard.updated)}`,
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
    this.preview = byId('decision-preview');
    this.submit = byId('decision-submit');
    this.notice = byId('notice');
    this.subject = null;
    this.decision = null;
    /** Whether what the decision would change is on the screen, or need not be. */
    this.isPreviewed = true;
    /** Id of the decision that this one takes back; undefined: the newest, whichever it is. */
    this.undoes = undefined;
    /** What the notice's button takes back: {subject, decision, undoes}. */
    this.last = null;
    byId('decision-form').addEventListener('submit', (event) => {
      event.preventDefault();
      this.decide();
    });
    byId('decision-cancel').addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('close', () => {
      this.token.value = '';
      this.onClosed(this.subject, this.decision.focus ?? this.decision.call);
    });
    byId('notice-undo').addEventListener('click', () => this.undoLast());
    byId('notice-close').addEventListener('click', () => { this.notice.hidden = true; });
  }

  isAsking() {
    return this.dialog.open;
  }

  /** The buttons of a hazard's popup, with `more`; nothing where nobody may decide. */
  buttons(hazard, more = []) {
    const offered = hazard.state === REJECTED.name
      ? ['restore', 'undo'] : ['confirm', 'reject', 'undo'];
    return this.row(hazardSubject(hazard), offered, more);
  }

  /** Those of a map change's popup. */
  changeButtons(change) {
    return this.row(changeSubject(change), ['confirmChange', 'dismissChange', 'undoChange']);
  }

  /** Those of a vehicle's popup. */
  vehicleButtons(vehicle) {
    return this.row(vehicleSubject(vehicle), ['distrust', 'trust']);
  }

  row(subject, offered, more = []) {
    if (!this.enabled) return [];
    return [element('div', { class: 'decisions' }, ...offered.map((name) => {
      const { call, focus = call, button, bad } = DECISIONS[name];
      const node = element('button', { type: 'button', 'data-focus': focus,
        class: bad ? 'decide decide-reject' : 'decide' }, `${button}\u2026`);
      node.onclick = () => this.ask(subject, DECISIONS[name]);
      return node;
    }), ...more)];
  }

  /** Of the decision with that id alone. */
  askUndo(hazard, id) {
    this.ask(hazardSubject(hazard), DECISIONS.undo, id);
  }

  ask(subject, decision, undoes = undefined) {
    if (session.hasAccounts && lacksToken()) {
      askToLogIn('Log in as an official to decide.');
      return;
    }
    this.subject = subject;
    this.decision = decision;
    this.undoes = undoes;
    byId('decision-title').textContent = decision.title;
    byId('decision-label').textContent = `${subject.name}, ${subject.detail}`;
    byId('decision-note').textContent = decision.note;
    byId('decision-reason-label').textContent = decision.reason;
    this.preview.textContent = '';
    this.isPreviewed = !decision.preview;
    this.submit.textContent = decision.preview ? 'Show what changes' : decision.button;
    this.submit.classList.toggle('decide-reject', decision.bad === true);
    this.reason.value = '';
    this.show('', lacksToken());
    this.dialog.showModal();
    this.reason.focus();
    if (decision.preview && !lacksToken()) this.showPreview(savedToken());
  }

  /** An error, and whether the token must be given. */
  show(error, needsToken) {
    this.error.textContent = error;
    byId('decision-token-row').hidden = !needsToken;
    this.submit.disabled = false;
  }

  /** Asks the zone what the decision would change; only then can it be made. */
  async showPreview(token) {
    const { subject, decision } = this;
    const { told, wrong } = await ask(subject, decision, token);
    if (this.subject !== subject || this.decision !== decision || !this.dialog.open) return;
    if (wrong) {
      this.takeWrong(wrong);
      return;
    }
    saveToken(token);
    this.show('', false);
    this.preview.textContent = previewText(told);
    this.isPreviewed = true;
    this.submit.textContent = decision.button;
  }

  async decide() {
    const { subject, decision, undoes } = this;
    const token = this.token.value.trim() || savedToken();
    const reason = this.reason.value.trim().replace(/\s+/g, ' ');
    if (decision.bad && reason === '') return this.refuse('Please say why.', this.reason);
    if (token === '' && lacksToken()) return this.refuse('Please enter your token.', this.token);
    if (/[^\x21-\x7e]/.test(token)) {
      return this.refuse('A token has no blanks or special letters.', this.token);
    }
    this.submit.disabled = true;
    if (!this.isPreviewed) return this.showPreview(token);
    const { told, wrong } = await ask(subject, decision, token,
      bodyOf(subject, decision, reason, undoes));
    const isStillAsked = this.subject === subject && this.decision === decision && this.dialog.open;
    if (wrong) return isStillAsked ? this.takeWrong(wrong) : undefined;
    saveToken(token);
    if (isStillAsked) this.dialog.close();
    // Also to who has closed the question: what was sent is done.
    return this.sayDone(subject, decision, told);
  }

  /** With a button that takes it back, where there is a way. */
  sayDone(subject, decision, told) {
    const changed = Number.isInteger(told.hazards) ? `, ${plural(told.hazards, 'hazard')} changed` : '';
    const text = `${decision.done}: ${subject.name}${changed}`;
    this.last = decision.undo ? { subject, decision: DECISIONS[decision.undo],
      undoes: told.properties?.decision_id } : null;
    byId('notice-text').textContent = text;
    byId('notice-undo').hidden = this.last === null;
    this.notice.hidden = false;
    this.onDone(text);
  }

  /** What was done at the desk, with a button that takes it back. */
  sayDoneAtDesk(text, hazard, decisionId) {
    this.last = { subject: hazardSubject(hazard), decision: DECISIONS.undo, undoes: decisionId };
    byId('notice-text').textContent = text;
    byId('notice-undo').hidden = false;
    this.notice.hidden = false;
    this.onDone(text);
  }

  async undoLast() {
    if (this.last === null) return;
    const { subject, decision, undoes } = this.last;
    byId('notice-undo').disabled = true;
    const { told, wrong } = await ask(subject, decision, savedToken(),
      bodyOf(subject, decision, '', undoes));
    byId('notice-undo').disabled = false;
    if (!wrong) {
      this.sayDone(subject, { ...decision, undo: null }, told);
      byId('notice-close').focus();
      return;
    }
    if (wrong.status === 401) {
      saveToken('');
      this.ask(subject, decision, undoes);
    } else {
      byId('notice-text').textContent = wrong.sentence;
    }
  }

  takeWrong(wrong) {
    if (wrong.status === 401) saveToken('');
    this.refuse(wrong.sentence, wrong.status === 401 && lacksToken() ? this.token : this.submit);
  }

  refuse(sentence, field) {
    this.show(sentence, lacksToken());
    field.focus();
    if (field === this.token) field.select();
  }
}
