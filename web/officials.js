// Officials confirm and reject hazards. The token is asked for once and kept as long as the tab
// lives, in sessionStorage; it is only ever sent to this server.

import { byId, element } from './dom.js';

const KEY = 'livemap.token';

const WORDS = {
  confirm: { title: 'Confirm this hazard?', button: 'Confirm', done: 'Confirmed' },
  reject: { title: 'Reject this hazard?', button: 'Reject', done: 'Rejected' },
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
async function send(hazard, decision, reason, token) {
  let answer;
  try {
    answer = await fetch(`/api/v1/hazards/${hazard.id}/${decision}`, {
      method: 'POST', cache: 'no-store', credentials: 'omit',
      headers: { Authorization: `Bearer ${token}`, 'Content-Type': 'application/json' },
      body: JSON.stringify(reason ? { reason } : {}),
    });
  } catch (failure) {
    return { status: 0, sentence: 'The zone does not answer. Try again in a moment.' };
  }
  if (answer.ok) return null;
  const told = await answer.json().catch(() => ({}));
  return { status: answer.status, sentence: sentenceFor(answer.status, told.error) };
}

function sentenceFor(status, error) {
  if (status === 401) return 'This token is not known here. Check it and try again.';
  if (status === 404 || status === 409) return 'This hazard is no longer on the map.';
  return error ? `${error.charAt(0).toUpperCase()}${error.slice(1)}.` : `The zone answered ${status}.`;
}

export class Officials {
  /** `enabled`: the server has officials. `onDone(text)` announces what was done, `onClosed(hazard)`
   * is called when the dialog goes away. */
  constructor(enabled, onDone, onClosed) {
    this.enabled = enabled;
    this.onDone = onDone;
    this.onClosed = onClosed;
    this.dialog = byId('decision');
    this.token = byId('decision-token');
    this.reason = byId('decision-reason');
    this.error = byId('decision-error');
    this.submit = byId('decision-submit');
    this.hazard = null;
    byId('decision-form').addEventListener('submit', (event) => {
      event.preventDefault();
      this.decide();
    });
    byId('decision-cancel').addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('close', () => {
      this.token.value = '';
      this.onClosed(this.hazard);
    });
  }

  isAsking() {
    return this.dialog.open;
  }

  /** The popup's buttons; nothing where nobody may decide. */
  buttons(hazard) {
    if (!this.enabled) return [];
    const confirm = element('button', { type: 'button', class: 'decide', 'data-focus': 'confirm' },
      'Confirm');
    const reject = element('button',
      { type: 'button', class: 'decide decide-reject', 'data-focus': 'reject' }, 'Reject\u2026');
    confirm.addEventListener('click', () => this.ask(hazard, 'confirm'));
    reject.addEventListener('click', () => this.ask(hazard, 'reject'));
    return [element('div', { class: 'decisions' }, confirm, reject)];
  }

  ask(hazard, decision) {
    this.hazard = hazard;
    this.decision = decision;
    byId('decision-title').textContent = WORDS[decision].title;
    byId('decision-label').textContent = hazard.label;
    byId('decision-reason-row').hidden = decision !== 'reject';
    this.submit.textContent = WORDS[decision].button;
    this.submit.classList.toggle('decide-reject', decision === 'reject');
    this.reason.value = '';
    this.show('', savedToken() === '');
    this.dialog.showModal();
    this.focusFirst();
  }

  /** An error, and whether the token must be given. */
  show(error, needsToken) {
    this.error.textContent = error;
    byId('decision-token-row').hidden = !needsToken;
    this.submit.disabled = false;
  }

  focusFirst() {
    const field = [this.reason, this.token].find((one) => !one.closest('[hidden]'));
    (field ?? this.submit).focus();
  }

  async decide() {
    const { hazard, decision } = this;
    const token = this.token.value.trim() || savedToken();
    const reason = decision === 'reject' ? this.reason.value.trim().replace(/\s+/g, ' ') : '';
    if (decision === 'reject' && reason === '') return this.refuse('Please say why.', this.reason);
    if (token === '') return this.refuse('Please enter your token.', this.token);
    if (/[^\x21-\x7e]/.test(token)) {
      return this.refuse('A token has no blanks or special letters.', this.token);
    }
    this.submit.disabled = true;
    const wrong = await send(hazard, decision, reason, token);
    if (this.hazard !== hazard || !this.dialog.open) return undefined;
    if (wrong !== null) {
      if (wrong.status === 401) saveToken('');
      return this.refuse(wrong.sentence, wrong.status === 401 ? this.token : this.submit);
    }
    saveToken(token);
    this.dialog.close();
    return this.onDone(`${WORDS[decision].done}: ${hazard.label}`);
  }

  refuse(sentence, field) {
    this.show(sentence, savedToken() === '');
    field.focus();
    if (field === this.token) field.select();
  }
}
