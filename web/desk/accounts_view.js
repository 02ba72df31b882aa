// Who has an account, for admins: as what, since when, and whether somebody is logged in. Accounts are
// added, changed, locked and removed here, and the trail below says who did so, and who logged in.

import { byId, element } from '../dom.js';
import { ago, localTime } from '../format.js';
import { renew } from '../renew.js';
import { sentenceFor, session } from '../session.js';
import { getJson } from '../zone_lists.js';
import { AccountForm } from './account_form.js';
import { sendConfirmed } from './own_password.js';

const MOST = 200;
const EVENTS = 20;
const MOST_EVENTS = 1000;
const RENEW_MS = 10000;

/** What an event says after the account's name. */
const HAPPENED = {
  log_in: 'logged in', wrong_password: 'wrong password', log_out: 'logged out', lock: 'locked',
  unlock: 'unlocked', end_sessions: 'sessions ended', add: 'added', role: 'has another role',
  set_password: 'has a new password', remove: 'removed',
};

function day(time) {
  return new Date(time).toLocaleDateString(undefined, { dateStyle: 'medium' });
}

function moment(time) {
  return element('time', { datetime: time, title: localTime(Date.parse(time)) }, ago(Date.parse(time)));
}

export class AccountsView {
  constructor() {
    const open = byId('accounts-open');
    open.hidden = session.role !== 'admin';
    this.dialog = null;
    if (open.hidden) return;
    open.addEventListener('click', () => this.open());
    setInterval(() => { if (!document.hidden && this.dialog?.open) this.load(); }, RENEW_MS);
  }

  make() {
    this.accounts = [];
    this.eventLimit = EVENTS;
    this.form = new AccountForm((text, name) => this.done(text, name));
    this.search = element('input', { id: 'accounts-search', type: 'search', maxlength: '64', autocomplete: 'off',
      spellcheck: 'false', autocapitalize: 'none' });
    this.list = element('ul', { id: 'accounts-list', class: 'orders', 'aria-label': 'Accounts' });
    this.note = element('p', { id: 'accounts-note', class: 'note', role: 'status' });
    this.error = element('p', { id: 'accounts-error', class: 'decision-error', role: 'alert' });
    this.trail = element('ul', { id: 'accounts-trail', class: 'trail', 'aria-labelledby': 'accounts-trail-title' });
    this.more = element('button', { id: 'accounts-more', class: 'quiet', type: 'button', hidden: '' }, 'Older ones');
    this.log = element('details', { id: 'accounts-log', class: 'accounts-log' },
      element('summary', { class: 'section-head' },
        element('h3', { id: 'accounts-trail-title' }, 'Log-ins and changes')), this.trail, this.more);
    const add = element('button', { id: 'accounts-add', class: 'decide decide-main', type: 'button' }, 'Add an account\u2026');
    const close = element('button', { id: 'accounts-close', class: 'decide', type: 'button' }, 'Close the list');
    this.dialog = element('dialog', { id: 'accounts', class: 'decision orders-dialog', 'aria-labelledby': 'accounts-title' },
      element('h2', { id: 'accounts-title' }, 'Accounts'),
      element('p', {}, element('label', { for: 'accounts-search' }, 'Search by name'), this.search),
      element('div', { class: 'orders-body' }, this.list, this.note, this.log), this.error,
      element('div', { class: 'decisions' }, add, close));
    document.body.append(this.dialog);
    this.search.addEventListener('input', () => this.show());
    add.addEventListener('click', () => this.form.ask('add', null));
    close.addEventListener('click', () => this.dialog.close());
    this.log.addEventListener('toggle', () => { if (this.log.open) this.loadEvents(); });
    this.more.addEventListener('click', () => {
      this.eventLimit = MOST_EVENTS;
      this.loadEvents();
    });
  }

  open() {
    if (this.dialog === null) this.make();
    this.error.textContent = '';
    this.dialog.showModal();
    this.load();
  }

  async load() {
    const told = await getJson('/api/v1/accounts').catch(() => null);
    if (told === null) {
      this.note.textContent = 'The accounts cannot be loaded.';
      return;
    }
    this.accounts = told.accounts;
    this.show();
    if (this.log.open) await this.loadEvents();
  }

  show() {
    const wanted = this.search.value.trim().toLowerCase();
    const found = this.accounts.filter(({ name }) => name.toLowerCase().includes(wanted));
    renew(this.list, element('ul', { id: 'accounts-list', class: 'orders', 'aria-label': 'Accounts' },
      ...found.slice(0, MOST).map((account) => this.row(account))));
    this.note.textContent = found.length === 0 ? 'There is no account of such a name.'
      : found.length > MOST ? `The first ${MOST} of ${found.length.toLocaleString('en')}.` : '';
  }

  row(account) {
    const { name, role, locked, created, password_set: set, last_log_in: last, sessions } = account;
    const facts = [['Last log-in', last === null ? 'never' : moment(last)], ['Open sessions', String(sessions)],
      ['Password since', day(set)], ['Added', day(created)]];
    return element('li', { class: 'order', 'data-account': name, 'data-focus': name },
      element('p', { class: 'order-head' }, element('strong', { class: 'account-name' }, name),
        element('span', { class: `state account-${role}` }, role),
        ...(locked ? [element('span', { class: 'state order-failed' }, 'locked')] : []),
        ...(name === session.name ? [element('span', { class: 'order-place' }, 'this is you')] : [])),
      element('dl', { class: 'order-facts' }, ...facts.map(([fact, value]) => element('div', {},
        element('dt', {}, fact), element('dd', {}, value)))),
      element('div', { class: 'decisions' }, ...this.buttons(account)));
  }

  buttons(account) {
    const { name, locked, sessions } = account;
    const button = (focus, text, work, more = '') => {
      const node = element('button', { type: 'button', class: `decide${more}`, 'data-focus': focus,
        'aria-label': `${text} (${name})` }, text);
      node.onclick = work;
      return node;
    };
    const asks = (what) => () => this.form.ask(what, account);
    // Nobody can take the own rights away: the last admin would lock everybody out.
    const isOwn = name === session.name;
    return [
      ...(isOwn ? [] : [button('role', 'Role\u2026', asks('role'))]),
      button('password', 'Password\u2026', asks('password')),
      ...(sessions > 0 && !isOwn ? [button('end', 'End sessions', () => this.act('end_sessions', name, 'sessions ended'))] : []),
      ...(isOwn ? [] : [
        locked ? button('lock', 'Unlock', () => this.act('unlock', name, 'unlocked'))
          : button('lock', 'Lock', () => this.act('lock', name, 'locked')),
        button('remove', 'Remove\u2026', asks('remove'), ' decide-reject')]),
    ];
  }

  async act(call, name, done) {
    const answer = await sendConfirmed('POST', `/api/v1/accounts/${call}`, { name });
    if (answer.status === 200) this.done(`${name}: ${done}`, name);
    else this.error.textContent = sentenceFor(answer);
  }

  /** After a change of the account `name`, which has the focus where it is still listed. */
  async done(text, name) {
    this.error.textContent = '';
    const focus = document.activeElement?.dataset.focus;
    await this.load();
    this.note.textContent = text;
    if (this.dialog.contains(document.activeElement) && document.activeElement !== this.dialog) return;
    const row = this.list.querySelector(`[data-account="${CSS.escape(name)}"]`);
    (row?.querySelector(`[data-focus="${focus}"]`) ?? row?.querySelector('button') ?? this.search).focus();
  }

  async loadEvents() {
    const told = await getJson(`/api/v1/accounts/events?limit=${this.eventLimit}`).catch(() => null);
    if (told === null) {
      this.error.textContent = 'The log-ins cannot be loaded.';
      return;
    }
    renew(this.trail, element('ul', { id: 'accounts-trail', class: 'trail', 'aria-labelledby': 'accounts-trail-title' },
      ...told.events.map((event) => this.eventRow(event))));
    this.more.hidden = told.next === null || this.eventLimit === MOST_EVENTS;
  }

  eventRow({ event, name, by, client, time, role }) {
    const happened = HAPPENED[event] ?? event;
    const what = name === '' ? 'a wrong name' : `${name}: ${happened}${role === null ? '' : `, ${role}`}`;
    const who = [...(by === name || by === '' ? [] : [`by ${by}`]), client === '' ? 'at the zone\u2019s machine' : `from ${client}`];
    return element('li', { class: 'trail-row' }, element('span', { class: 'trail-what' }, what), moment(time),
      element('span', { class: 'trail-who' }, who.join(' ')));
  }
}
