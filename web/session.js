// Who has logged in, and the dialog by which one does. The session itself is a cookie that no script
// can read; what the page knows is the name, the role and the token that decisions carry.

import { addressOf } from './address.js';
import { byId } from './dom.js';

const ADDRESS = '/api/v1/session';
const DECIDES = ['official', 'admin'];

export const session = {
  name: null, role: null, csrfToken: '', hasAccounts: false,
  sees: { told: true, candidates: true, vehicles: true },

  /** Whether who has logged in may decide. */
  decides() {
    return DECIDES.includes(this.role);
  },
};

/** Sends a request by the session: {status, told}. Status 0: the zone does not answer. */
export async function send(method, path, body = undefined) {
  try {
    const answer = await fetch(addressOf(path), {
      method, cache: 'no-store', credentials: 'same-origin',
      headers: { 'X-CSRF-Token': session.csrfToken, 'Content-Type': 'application/json' },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
    return { status: answer.status, told: await answer.json().catch(() => ({})) };
  } catch (failure) {
    return { status: 0, told: {} };
  }
}

/** Why a request by the session was not done, from what send answers. */
export function sentenceFor({ status, told }) {
  if (status === 0) return 'The zone does not answer. Try again in a moment.';
  const error = told.error ?? `the zone answered ${status}`;
  return `${error.charAt(0).toUpperCase()}${error.slice(1)}.`;
}

async function logIn() {
  const [name, password] = [byId('log-in-name'), byId('log-in-password')];
  const [error, submit] = [byId('log-in-error'), byId('log-in-submit')];
  submit.disabled = true;
  const answer = await send('POST', ADDRESS, { name: name.value.trim(), password: password.value });
  submit.disabled = false;
  if (answer.status === 200) {
    // All that is on the screen is of what one saw before.
    window.location.reload();
    return;
  }
  error.textContent = sentenceFor(answer);
  password.value = '';
  (answer.status === 401 ? password : submit).focus();
}

/** Asks for name and password. `why` is shown above. */
export function askToLogIn(why = '') {
  byId('log-in-note').textContent = why;
  byId('log-in-error').textContent = '';
  byId('log-in').showModal();
  byId('log-in-name').focus();
}

async function logOut() {
  await send('DELETE', ADDRESS);
  window.location.reload();
}

/** Shows who has logged in, as the zone has `told` it. */
export function startSession(told) {
  Object.assign(session, {
    name: told.name, role: told.role ?? null, csrfToken: told.csrf_token ?? '',
    hasAccounts: told.has_accounts, sees: told.sees,
  });
  const button = byId('session');
  button.hidden = !session.hasAccounts;
  button.textContent = session.name === null ? 'Log in' : `Log out ${session.name}`;
  button.addEventListener('click', () => (session.name === null ? askToLogIn() : logOut()));
  byId('log-in-form').addEventListener('submit', (event) => {
    event.preventDefault();
    logIn();
  });
  byId('log-in-cancel').addEventListener('click', () => byId('log-in').close());
}
