// The zone's work orders, for officials: where each stands, of what hazard, whose it is, and what the
// recipient said. One that was given up can be sent again, one that is done can be closed.

import { byId, element } from '../dom.js';
import { localTime } from '../format.js';
import { hazardOf } from '../hazard_record.js';
import { REJECTED } from '../hazard_state.js';
import { actOnOrder } from '../popups/officials.js';
import { renew } from '../renew.js';
import { session } from '../session.js';
import { getJson } from '../zone_lists.js';
import { ORDER_STATES, assignmentText, orderState, orderStateLabel, orderTurn } from './order_words.js';

const PAGE = 50;
const MOST = 1000;
const COUNT_MS = 30000;
const RENEW_MS = 5000;
const ANY = '';
const DONE = { retry: 'It is sent again', close: 'Closed; passing vehicles are asked' };

function field(id, label) {
  const select = element('select', { id });
  return [select, element('p', {}, element('label', { for: id }, label), select)];
}

/** The options, and what is chosen stays so. */
function fill(select, options) {
  const chosen = select.value;
  renew(select, element('select', { id: select.id },
    ...options.map(([value, label]) => element('option', { value }, label))));
  select.value = options.some(([value]) => value === chosen) ? chosen : ANY;
}

export class OrdersView {
  /** `hasOrders`: of the zone. `onChoose(hazard)` shows it on the map, `onDone(text)` is called after
   * each decision. */
  constructor(hasOrders, catalogue, onChoose, onDone) {
    this.catalogue = catalogue;
    this.onChoose = onChoose;
    this.onDone = onDone;
    this.dialog = null;
    this.limit = PAGE;
    /** The order whose close is asked for a second time. */
    this.asked = null;
    this.button = byId('orders-open');
    this.button.hidden = !hasOrders || !session.decides();
    if (this.button.hidden) return;
    this.button.addEventListener('click', () => this.open());
    this.count();
    setInterval(() => { if (!document.hidden && !this.dialog?.open) this.count(); }, COUNT_MS);
    setInterval(() => { if (!document.hidden && this.dialog?.open) this.load(); }, RENEW_MS);
  }

  make() {
    const [state, stateRow] = field('orders-state', 'State');
    const [recipient, recipientRow] = field('orders-recipient', 'Recipient');
    this.state = state;
    this.recipient = recipient;
    this.list = element('ul', { id: 'orders-list', class: 'orders', 'aria-labelledby': 'orders-title' });
    this.note = element('p', { id: 'orders-note', class: 'note', role: 'status' });
    this.more = element('button', { id: 'orders-more', class: 'quiet', type: 'button', hidden: '' }, 'Older ones');
    this.error = element('p', { id: 'orders-error', class: 'decision-error', role: 'alert' });
    const close = element('button', { id: 'orders-close', class: 'decide', type: 'button' }, 'Close the list');
    this.dialog = element('dialog', { id: 'orders', class: 'decision orders-dialog',
      'aria-labelledby': 'orders-title' },
    element('h2', { id: 'orders-title' }, 'Work orders'),
    element('div', { class: 'orders-filter' }, stateRow, recipientRow),
    element('div', { class: 'orders-body' }, this.list, this.note, this.more), this.error,
    element('div', { class: 'decisions' }, close));
    document.body.append(this.dialog);
    for (const select of [state, recipient]) {
      select.addEventListener('change', () => {
        this.limit = PAGE;
        this.list.replaceChildren();
        this.load();
      });
    }
    this.more.addEventListener('click', () => {
      this.limit = Math.min(this.limit + PAGE, MOST);
      this.load();
    });
    close.addEventListener('click', () => this.dialog.close());
  }

  open() {
    if (this.dialog === null) this.make();
    this.asked = null;
    this.error.textContent = '';
    this.dialog.showModal();
    this.load();
  }

  /** What the button says: an order that nobody has is the officials' business. */
  say({ failed }) {
    this.button.textContent = failed > 0 ? `Work orders, ${failed.toLocaleString('en')} failed` : 'Work orders';
    this.button.classList.toggle('overdue', failed > 0);
  }

  async count() {
    const told = await getJson('/api/v1/orders?limit=1').catch(() => null);
    if (told) this.say(told.counts);
  }

  async load() {
    const { state: { value: state }, recipient: { value: recipient }, limit } = this;
    const wanted = [`limit=${limit}`, ...(state === ANY ? [] : [`state=${state}`]),
      ...(recipient === ANY ? [] : [`recipient=${encodeURIComponent(recipient)}`])];
    let told;
    try {
      told = await getJson(`/api/v1/orders?${wanted.join('&')}`);
    } catch (failure) {
      this.note.textContent = 'The work orders cannot be loaded.';
      return;
    }
    if (this.state.value !== state || this.recipient.value !== recipient || this.limit !== limit) return;
    this.show(told);
  }

  show({ orders, next, counts, recipients }) {
    this.say(counts);
    fill(this.state, [[ANY, 'All'], ...ORDER_STATES.map(
      (name) => [name, `${orderStateLabel(name)} (${counts[name].toLocaleString('en')})`])]);
    fill(this.recipient, [[ANY, 'All'], ...recipients.map((name) => [name, name])]);
    renew(this.list, element('ul', { id: 'orders-list', class: 'orders', 'aria-labelledby': 'orders-title' },
      ...orders.map((order) => this.row(order))));
    this.more.hidden = next === null || this.limit === MOST;
    this.note.textContent = orders.length === 0 ? 'There is no such work order.'
      : next !== null && this.limit === MOST ? `The newest ${MOST.toLocaleString('en')}.` : '';
  }

  row(order) {
    const { id, state, hazard, class: className, place, recipient, reference, made, attempts, overdue,
      last_error: error, may_have_arrived: isUncertain } = order;
    const label = this.catalogue.label(className);
    const link = element('button', { type: 'button', class: 'quiet order-hazard', 'data-focus': `hazard ${id}`,
      title: 'Show it on the map' }, label);
    link.onclick = () => this.choose(hazard);
    const facts = [['Recipient', recipient], ...(reference === null ? [] : [['Its number', reference]]),
      ['Team', element('span', { class: overdue ? 'overdue' : null }, assignmentText(order))],
      ['Made', localTime(Date.parse(made))], ['Attempts', String(attempts)]];
    return element('li', { class: 'order', 'data-order': id },
      element('p', { class: 'order-head' },
        element('span', { class: `state order-${state}` }, orderState(order)),
        this.catalogue.badge(className), link,
        element('span', { class: 'order-place' }, place ?? 'street not known')),
      element('dl', { class: 'order-facts' }, ...facts.map(([name, value]) => element('div', {},
        element('dt', {}, name), element('dd', {}, value)))),
      element('p', { class: 'order-turn' }, orderTurn(order),
        isUncertain ? '. It may have arrived already' : ''),
      ...(error === null ? [] : [element('p', { class: 'order-words' }, error)]),
      ...this.buttons(order));
  }

  buttons({ id, state }) {
    const button = (name, text, work, more = '') => {
      const node = element('button', { type: 'button', class: `decide${more}`, 'data-focus': `${name} ${id}` }, text);
      node.onclick = work;
      return node;
    };
    const nodes = [];
    if (this.asked === id) {
      nodes.push(button('done', 'The work is done', () => this.act(id, 'close'), ' decide-main'),
        button('keep', 'Leave it open', () => this.ask(null, id)));
    } else {
      if (state === 'failed') nodes.push(button('retry', 'Send again', () => this.act(id, 'retry')));
      if (state === 'failed' || state === 'sent') nodes.push(button('close', 'Close\u2026', () => this.ask(id, id)));
    }
    return nodes.length === 0 ? [] : [element('div', { class: 'decisions' }, ...nodes)];
  }

  /** A close cannot be taken back: it is asked for twice. */
  async ask(asked, id) {
    this.asked = asked;
    await this.load();
    this.focusOn(id, asked === null ? 'close' : 'done');
  }

  async act(id, call) {
    this.asked = null;
    const { wrong } = await actOnOrder(id, call);
    this.error.textContent = wrong ? wrong.sentence : '';
    if (!wrong) this.onDone(`Work order: ${DONE[call]}`);
    await this.load();
    this.focusOn(id, 'hazard');
  }

  /** A control of the order, where it is still listed. */
  focusOn(id, name) {
    const node = this.list.querySelector(`[data-focus="${name} ${id}"]`)
      ?? this.list.querySelector(`[data-focus="hazard ${id}"]`) ?? this.state;
    node.focus();
  }

  async choose(id) {
    const hazard = await getJson(`/api/v1/hazards/${encodeURIComponent(id)}`).then(hazardOf).catch(() => null);
    if (hazard === null || hazard.state === 'gone' || hazard.state === REJECTED.name) {
      this.error.textContent = 'This hazard is no longer on the map.';
      return;
    }
    this.dialog.close();
    this.onChoose(hazard);
  }
}
