// Check boxes that show or hide the hazards of a class or in a state.

import { byId, element } from './dom.js';
import { STATES } from './hazard_state.js';

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

/** The three states, always there. */
export class StateFilter {
  constructor(store, onChange) {
    this.store = store;
    this.counts = new Map();
    for (const state of STATES) {
      const box = element('input', { type: 'checkbox', 'data-state': state.name });
      box.checked = true;
      box.addEventListener('change', () => {
        if (box.checked) store.hiddenStates.delete(state.name);
        else store.hiddenStates.add(state.name);
        onChange();
      });
      const count = element('span', { class: 'count' });
      this.counts.set(state.name, count);
      byId('states').append(element('li', {}, element('label',
        { class: 'chip', title: state.meaning }, box,
        element('span', { class: 'chip-label' }, state.label), count)));
    }
  }

  update() {
    for (const [name, node] of this.counts) {
      node.textContent = (this.store.stateCounts.get(name) ?? 0).toLocaleString('en');
    }
  }
}

function firstOf(list, after) {
  if (!after) return null;
  return after.item.parentNode === list ? after.item : null;
}
