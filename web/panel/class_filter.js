// Check boxes that show or hide the hazards of a class or in a state.

import { OTHER_LABEL } from '../catalogue.js';
import { byId, element, setText } from '../dom.js';
import { REJECTED, STATES } from '../hazard_state.js';

/** Its name in the worker is empty: vehicles invent classes without end. */
const OTHER = '';

export class ClassFilter {
  /** `onChange()` is called when the set of hidden classes changed. */
  constructor(data, catalogue, onChange) {
    this.data = data;
    this.catalogue = catalogue;
    this.onChange = onChange;
    this.entries = new Map();
    this.list = byId('filter');
    byId('filter-all').addEventListener('click', () => this.setAll(true));
    byId('filter-none').addEventListener('click', () => this.setAll(false));
  }

  /** Brings boxes and counts up to date. */
  update() {
    for (const [className, count] of this.data.groupCounts) {
      if (count === 0 && !this.entries.has(className)) continue;
      const entry = this.entries.get(className) ?? this.add(className);
      setText(entry.count, count.toLocaleString('en'));
      entry.item.hidden = count === 0;
    }
  }

  add(className) {
    const box = element('input', { type: 'checkbox', 'data-class': className });
    box.checked = !this.data.hiddenClasses.has(className);
    box.addEventListener('change', () => {
      this.data.hideClass(className, !box.checked);
      this.onChange();
    });
    const label = className === OTHER ? OTHER_LABEL : this.catalogue.label(className);
    const count = element('span', { class: 'count' });
    const item = element('li', {}, element('label', { class: 'chip' }, box,
      this.catalogue.badge(className), element('span', { class: 'chip-label' }, label), count));
    const entry = { box, count, item, label, isLast: className === OTHER };
    this.entries.set(className, entry);
    const next = [...this.entries.values()].filter((other) => other.item.isConnected)
      .sort(inOrder).find((other) => inOrder(other, entry) > 0);
    this.list.insertBefore(item, next?.item ?? null);
    return entry;
  }

  /** Also those of which there is none yet. */
  setAll(shown) {
    for (const className of [OTHER, ...this.catalogue.classes.keys()]) {
      this.data.hideClass(className, !shown);
      const entry = this.entries.get(className);
      if (entry) entry.box.checked = shown;
    }
    this.onChange();
  }
}

function inOrder(a, b) {
  return a.isLast - b.isLast || a.label.localeCompare(b.label);
}

/** The three states on the map, always there; for officials also what was rejected, which is
 * fetched when it is asked for. */
export class StateFilter {
  /** `onRejected(shown)` fetches or forgets rejected hazards; null where there are no officials. */
  constructor(data, onChange, onRejected) {
    this.data = data;
    this.counts = new Map();
    for (const state of STATES) {
      this.add(state, true, (shown) => {
        data.hideState(state.name, !shown);
        onChange();
      });
    }
    if (onRejected !== null) this.rejectedBox = this.add(REJECTED, false, onRejected);
  }

  add(state, checked, onToggle) {
    const box = element('input', { type: 'checkbox', 'data-state': state.name });
    box.checked = checked;
    box.addEventListener('change', () => onToggle(box.checked));
    const count = element('span', { class: 'count' });
    this.counts.set(state.name, count);
    byId('states').append(element('li', {}, element('label',
      { class: 'chip', title: state.meaning }, box,
      element('span', { class: 'chip-label' }, state.label), count)));
    return box;
  }

  update() {
    for (const [name, node] of this.counts) {
      // How many were rejected is not known before they are fetched.
      const unknown = name === REJECTED.name && !this.data.keepsRejected;
      setText(node, unknown ? '' : (this.data.stateCounts.get(name) ?? 0).toLocaleString('en'));
    }
  }

  sayRejectedFailed() {
    this.rejectedBox.checked = false;
    this.counts.get(REJECTED.name).textContent = 'not loaded, try again';
  }
}
