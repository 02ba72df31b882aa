// What a hazard's popup says of its repair: the team it is assigned to, for those who have logged in,
// and its work orders, for officials of a zone that has some.

import { element } from '../dom.js';
import { session } from '../session.js';
import { getJson } from '../zone_lists.js';
import { assignmentText, orderState, orderTurn } from './order_words.js';

const MOST_ORDERS = 20;
const RENEW_MS = 15000;

export class HazardOrders {
  /** `hasOrders`: of the zone. `assignmentOf(id)` answers a hazard's assignment or null;
   * `openId()` the hazard whose popup is open, or null; `onChange(id, isFirst)` draws that popup
   * anew: `isFirst` where its orders were not known before. */
  constructor(hasOrders, { assignmentOf, openId, onChange }) {
    this.hasOrders = hasOrders && session.decides();
    this.assignmentOf = assignmentOf;
    this.openId = openId;
    this.onChange = onChange;
    /** The hazard that was asked for, and what is known of its orders: null while it comes. */
    this.id = null;
    this.orders = null;
    this.failed = false;
    // An order goes its way without an event of its hazard.
    if (this.hasOrders) setInterval(() => { if (!document.hidden) this.renew(); }, RENEW_MS);
  }

  /** Rows of the popup's facts. */
  rows(hazard) {
    const assignment = this.assignmentOf(hazard.id);
    const rows = assignment === null ? [] : [['Team', element('span',
      { class: assignment.overdue ? 'overdue' : null }, assignmentText(assignment))]];
    if (!this.hasOrders) return rows;
    if (this.id !== hazard.id) {
      this.id = hazard.id;
      this.orders = null;
      this.load(hazard.id);
    }
    return [...rows, ['Work orders', ...this.lines()]];
  }

  lines() {
    if (this.failed) return ['cannot be loaded'];
    if (this.orders === null) return ['\u2026'];
    if (this.orders.length === 0) return ['none'];
    return this.orders.map((order) => element('span', { class: 'order-line' },
      element('span', { class: `order-state order-${order.state}` }, orderState(order)),
      ` ${order.recipient}`, element('span', { class: 'meaning' }, orderTurn(order))));
  }

  /** Something was decided, or time has gone by. */
  renew() {
    const id = this.openId();
    if (id !== null && id === this.id) this.load(id);
    else this.id = null;
  }

  async load(id) {
    if (!this.hasOrders) return;
    let orders = null;
    try {
      ({ orders } = await getJson(`/api/v1/orders?limit=${MOST_ORDERS}&hazard=${encodeURIComponent(id)}`));
    } catch (failure) {
      // Said in the row.
    }
    if (this.id !== id) return;
    const isFirst = this.orders === null;
    this.failed = orders === null;
    this.orders = orders ?? this.orders;
    this.onChange(id, isFirst);
  }
}
