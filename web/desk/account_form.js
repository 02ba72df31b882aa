// The question before an account is added or changed: its name, role or password.

import { byId, element } from '../dom.js';
import { sentenceFor, session } from '../session.js';
import { sendConfirmed } from './own_password.js';

const ROLES = [['viewer', 'Viewer: sees vehicles'],
  ['official', 'Official: also decides'], ['admin', 'Admin: also manages accounts']];

/** What is asked for, by what is done. `done` follows the account's name. */
const QUESTIONS = {
  add: { title: 'Add an account', submit: 'Add', asks: ['name', 'role', 'password'], done: 'added' },
  role: { title: 'Change the role', submit: 'Change', asks: ['role'], done: 'has another role' },
  password: { title: 'Set a new password', submit: 'Set', asks: ['password'], done: 'has a new password',
    note: 'All sessions of the account end.' },
  remove: { title: 'Remove this account?', submit: 'Remove', asks: [], done: 'removed', bad: true,
    note: 'This cannot be taken back. What the person decided stays, under the name.' },
};

function field(id, label, attributes) {
  return element('p', {}, element('label', { for: id }, label), element('input', { id, required: '', ...attributes }));
}

/** `autocomplete`: a password manager would else offer the admin's own. */
function password(id, label) {
  return field(id, label, { type: 'password', minlength: '12', maxlength: '256', autocomplete: 'new-password' });
}

export class AccountForm {
  /** `onDone(text, name)` is called after each change. */
  constructor(onDone) {
    this.onDone = onDone;
    this.dialog = element('dialog', { id: 'account', class: 'decision', 'aria-labelledby': 'account-title' });
    document.body.append(this.dialog);
  }

  /** `account`: as the zone tells it; null for one that is to be added. */
  ask(what, account) {
    const { title, submit, asks, bad, note } = QUESTIONS[what];
    const parts = {
      name: () => [field('account-name', 'Name', { type: 'text', maxlength: '64', autocomplete: 'off',
        autocapitalize: 'none', spellcheck: 'false' })],
      role: () => [element('p', {}, element('label', { for: 'account-role' }, 'Role'),
        element('select', { id: 'account-role' }, ...ROLES.map(([value, label]) => element('option',
          { value, selected: value === (account?.role ?? 'viewer') ? '' : null }, label))))],
      password: () => [password('account-password', 'Password, at least 12 characters'),
        password('account-again', 'The same password again')],
    };
    const cancel = element('button', { id: 'account-cancel', class: 'decide', type: 'button' }, 'Cancel');
    const form = element('form', { id: 'account-form', autocomplete: 'off' },
      element('h2', { id: 'account-title' }, title),
      ...(account === null ? [] : [element('p', { class: 'decision-label' }, account.name)]),
      ...(note ? [element('p', { class: 'decision-note' }, note)] : []),
      ...asks.flatMap((name) => parts[name]()),
      element('p', { id: 'account-error', class: 'decision-error', role: 'alert' }),
      element('div', { class: 'decisions' }, cancel, element('button', { id: 'account-submit', type: 'submit',
        class: `decide decide-main${bad ? ' decide-reject' : ''}` }, submit)));
    cancel.addEventListener('click', () => this.close());
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      this.save(what, account);
    });
    this.dialog.replaceChildren(form);
    this.dialog.showModal();
    (form.querySelector('input, select') ?? cancel).focus();
  }

  /** Nothing of a password stays in the page. */
  close() {
    this.dialog.close();
    this.dialog.replaceChildren();
  }

  async save(what, account) {
    const { asks, done } = QUESTIONS[what];
    const body = { name: account?.name ?? byId('account-name').value.trim() };
    if (asks.includes('role')) body.role = byId('account-role').value;
    if (asks.includes('password')) {
      body.password = byId('account-password').value;
      if (body.password !== byId('account-again').value) return this.refuse('The two passwords differ.');
    }
    byId('account-submit').disabled = true;
    const answer = await sendConfirmed('POST', `/api/v1/accounts/${what}`, body);
    if (answer.status !== 200) return this.refuse(sentenceFor(answer));
    if (what === 'password' && body.name === session.name) {
      // The own session has ended, too.
      window.location.reload();
      return undefined;
    }
    this.close();
    return this.onDone(`${body.name}: ${done}`, body.name);
  }

  refuse(sentence) {
    byId('account-error').textContent = sentence;
    byId('account-submit').disabled = false;
    byId('account-submit').focus();
  }
}
