// Check boxes that show or hide the hazards of a class or in a state.

import { byId, element } from './dom.js';
import { REJECTED, STATES } from './hazard_state.js';

export class ClassFilter {
  /** `onChange()` is called when the set of hidden classes changed. */
  constructor(store, catalogue, onChange) {
    this.store = store;
    this.catalogue = catalogue;
    this.onChange = onChange;
    this.entries = new Map();
    this.list = byId('filter');
    byId('filter-all').addEventListener('click', () => this.setAll(true));
    byId('filter-none').addEventListener('click', () => this.setAll(false));
  }

  /** Brings boxes and counts up to date with the store. */
  update() {
    const present = [...this.store.counts].filter(([, count]) => count > 0);
    for (const [className, count] of present) {
      const entry = this.entries.get(className) ?? this.add(className);
      entry.count.textContent = count.toLocaleString('en');
    }
    for (const [className, entry] of this.entries) {
      entry.item.hidden = !(this.store.counts.get(className) > 0);
    }
  }

  add(className) {
    const box = element('input', { type: 'checkbox', 'data-class': className });
    box.checked = !this.store.hidden.has(className);
    box.addEventListener('change', () => {
      if (box.checked) this.store.hidden.delete(className);
      else this.store.hidden.add(className);
      this.onChange();
    });
    const count = element('span', { class: 'count' });
    const item = element('li', {}, element('label', { class: 'chip' }, box,
      this.catalogue.badge(className),
      element('span', { class: 'chip-label' }, this.catalogue.label(className)), count));
    const entry = { box, count, item, label: this.catalogue.label(className) };
    this.entries.set(className, entry);
    const next = [...this.entries.values()].filter((other) => other.item.isConnected)
      .find((other) => other.label.localeCompare(entry.label) > 0);
    this.list.insertBefore(item, firstOf(this.list, next));
    return entry;
  }

  setAll(shown) {
    for (const [className, entry] of this.entries) {
      entry.box.checked = shown;
      if (shown) this.store.hidden.delete(className);
      else this.store.hidden.add(className);
    }
    this.onChange();
  }
}

/** The three states on the map, always there; for officials also what was rejected, which is
 * fetched when it is asked for. */
export class StateFilter {
  /** `onRejected(shown)` fetches or forgets rejected hazards; null where there are no officials. */
  constructor(store, onChange, onRejected) {
    this.store = store;
    this.counts = new Map();
    for (const state of STATES) {
      this.add(state, true, (shown) => {
        if (shown) store.hiddenStates.delete(state.name);
        else store.hiddenStates.add(state.name);
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
      const unknown = name === REJECTED.name && !this.store.keepsRejected;
      node.textContent = unknown ? '' : (this.store.stateCounts.get(name) ?? 0).toLocaleString('en');
    }
  }

  sayRejectedFailed() {
    this.rejectedBox.checked = false;
    this.counts.get(REJECTED.name).textContent = 'not loaded, try again';
  }
}

function firstOf(list, after) {
  if (!after) return null;
  return after.item.parentNode === list ? after.item : null;
}
