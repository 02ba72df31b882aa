// The list beside the map: all hazards, the newest first, by keyboard as well as by mouse. Only the
// rows that one sees, and some around them, are in the document.

import { byId, element, oneAtATime, setText } from '../dom.js';
import { ago, percent, plural, streetText, utcTime } from '../format.js';
import { REJECTED, stateLabel } from '../hazard_state.js';

/** As --row in style.css. */
const ROW_PX = 56;
/** Rows above and below those that one sees. */
const SPARE_ROWS = 8;
/** Browsers lay out no higher element. */
const MAX_ROWS = 500000;

/** What a row says of a hazard, as nodes. */
export function hazardRow(catalogue, hazard) {
  const row = rowParts(catalogue, hazard);
  fill(row, hazard);
  return [row.badge, row.label, row.time, row.facts];
}

function rowParts(catalogue, { className, state, label }) {
  return {
    badge: catalogue.badge(className, state),
    label: element('span', { class: 'row-label', title: label }, label),
    time: element('time'),
    facts: element('span', { class: 'row-facts' }),
  };
}

function fill(row, hazard) {
  row.time.dateTime = new Date(hazard.updated).toISOString();
  row.time.title = utcTime(hazard.updated);
  setText(row.time, ago(hazard.updated));
  row.badge.classList.toggle('hollow', hazard.state === 'candidate');
  row.badge.classList.toggle('struck', hazard.state === REJECTED.name);
  const state = hazard.state === 'active' ? '' : `${stateLabel(hazard.state)} \u00b7 `;
  const known = `${plural(hazard.sightings, 'report')} \u00b7 ${percent(hazard.confidence)} sure`;
  const where = streetText(hazard);
  setText(row.facts, `${state}${where || known}`);
  row.facts.title = where ? `${where} \u00b7 ${known}` : '';
}

export class HazardList {
  /** `onChoose(hazard)` is called for a click or Enter on a row; `box()` answers where listed hazards
   * must lie, null for everywhere. */
  constructor(data, catalogue, onChoose, box) {
    this.data = data;
    this.catalogue = catalogue;
    this.box = box;
    this.list = byId('hazard-list');
    this.count = byId('list-count');
    this.note = byId('list-note');
    this.search = byId('list-search');
    this.fresh = new Set();
    this.rows = new Map();
    this.length = 0;
    /** The row that gets the focus when it is there. */
    this.wantedIndex = null;
    /** Brings the rows that one sees up to date. */
    this.refresh = oneAtATime(() => this.askAndRender());
    this.list.addEventListener('click', (event) => {
      const row = event.target.closest('button');
      if (row) onChoose(this.rows.get(row.dataset.hazard).hazard);
    });
    this.search.addEventListener('input', () => {
      this.list.scrollTop = 0;
      this.refresh();
    });
    this.list.addEventListener('keydown', (event) => this.onKey(event));
    this.list.addEventListener('scroll', () => this.refresh());
    new ResizeObserver(() => this.refresh()).observe(this.list);
  }

  /** Lights up the hazard's row when it is shown the next time. */
  markFresh(hazard) {
    this.fresh.add(hazard.id);
  }

  async askAndRender() {
    const first = Math.max(0, Math.floor(this.list.scrollTop / ROW_PX) - SPARE_ROWS);
    const seen = Math.ceil(this.list.clientHeight / ROW_PX);
    this.render(await this.data.ask('rows', 'hazards', {
      offset: first, limit: seen + 2 * SPARE_ROWS, box: this.box(), text: this.search.value,
      wanted: this.anchor(),
    }));
  }

  focusedId() {
    const { activeElement } = document;
    return this.list.contains(activeElement) ? activeElement.dataset?.hazard ?? null : null;
  }

  /** The row that stays where it is on the screen when others come and go above it. */
  anchor() {
    const focused = this.focusedId();
    if (focused !== null || this.list.scrollTop === 0) return focused;
    const top = Math.floor(this.list.scrollTop / ROW_PX);
    return [...this.rows.values()].find((row) => row.index === top)?.hazard.id ?? null;
  }

  render({ rows, offset, count, index, size }) {
    const focused = this.focusedId();
    const kept = this.rows.get(focused);
    if (this.followsAnchor(index)) return;
    this.length = Math.min(count, MAX_ROWS);
    this.list.style.setProperty('--rows', this.length);
    const wanted = new Map(rows.map((hazard, at) => [hazard.id, offset + at]));
    // What has the focus stays, wherever one has scrolled to meanwhile.
    const keepsFocused = kept && index >= 0 && !wanted.has(focused);
    if (keepsFocused) wanted.set(focused, index);
    const hazards = keepsFocused ? [...rows, kept.hazard] : rows;
    this.arrange(hazards.sort((a, b) => wanted.get(a.id) - wanted.get(b.id)), wanted);
    this.fresh.clear();
    if (kept && !wanted.has(focused)) this.wantedIndex ??= Math.min(kept.index, this.length - 1);
    if (this.wantedIndex !== null) this.focusIndex(this.wantedIndex);
    this.keepTabStop();
    setText(this.count, count.toLocaleString('en'));
    setText(this.note, noteText(count, size));
  }

  /** Rows came or went above the anchor: scrolls by as many, and the rows are asked for anew. */
  followsAnchor(index) {
    const anchor = this.rows.get(this.anchor());
    if (!anchor || index < 0 || index === anchor.index || this.list.scrollTop === 0) return false;
    const moved = index - anchor.index;
    for (const row of this.rows.values()) place(row, row.index + moved);
    this.length = Math.max(this.length, index + 1);
    this.list.style.setProperty('--rows', Math.max(this.length, this.length + moved));
    const before = this.list.scrollTop;
    this.list.scrollTop = before + moved * ROW_PX;
    this.refresh();
    return this.list.scrollTop !== before;
  }

  /** Rows that stay keep their nodes: a click on one of them is never lost because something else
   * changed meanwhile. */
  arrange(hazards, indices) {
    for (const [id, row] of this.rows) {
      if (indices.has(id)) continue;
      row.item.remove();
      this.rows.delete(id);
    }
    let next = this.list.firstChild;
    for (const hazard of hazards) {
      const row = this.rows.get(hazard.id) ?? this.add(hazard);
      if (row.hazard.className !== hazard.className) this.rename(row, hazard);
      row.hazard = hazard;
      fill(row, hazard);
      place(row, indices.get(hazard.id));
      row.item.setAttribute('aria-setsize', this.length);
      if (row.item === next) next = next.nextSibling;
      else this.insert(row, next);
    }
  }

  insert(row, next) {
    const hadFocus = row.button === document.activeElement;
    this.list.insertBefore(row.item, next);
    if (hadFocus) row.button.focus({ preventScroll: true });
  }

  add(hazard) {
    const parts = rowParts(this.catalogue, hazard);
    const button = element('button', {
      type: 'button', tabindex: '-1', 'data-hazard': hazard.id,
      class: this.fresh.has(hazard.id) ? 'row fresh' : 'row',
    }, parts.badge, parts.label, parts.time, parts.facts);
    const row = { ...parts, item: element('li', {}, button), button, hazard, index: -1 };
    this.rows.set(hazard.id, row);
    return row;
  }

  /** An official has changed its class. */
  rename(row, hazard) {
    const { badge, label } = rowParts(this.catalogue, hazard);
    row.badge.replaceWith(badge);
    row.label.replaceWith(label);
    Object.assign(row, { badge, label });
  }

  keepTabStop() {
    const rows = [...this.rows.values()];
    const top = this.list.scrollTop / ROW_PX;
    const stop = rows.find((row) => row.button === document.activeElement)
      ?? rows.filter((row) => row.index >= top).sort((a, b) => a.index - b.index)[0] ?? rows[0];
    for (const row of rows) row.button.setAttribute('tabindex', row === stop ? '0' : '-1');
  }

  onKey(event) {
    const row = this.rows.get(this.focusedId());
    const page = Math.max(1, Math.floor(this.list.clientHeight / ROW_PX) - 1);
    const to = {
      ArrowDown: row?.index + 1, ArrowUp: row?.index - 1, Home: 0, End: this.length - 1,
      PageDown: row?.index + page, PageUp: row?.index - page,
    }[event.key];
    if (!row || to === undefined) return;
    event.preventDefault();
    this.focusIndex(Math.min(Math.max(to, 0), this.length - 1));
  }

  /** Gives the focus to the row with this number, at once or when it has come. */
  focusIndex(index) {
    const top = index * ROW_PX;
    const { scrollTop, clientHeight } = this.list;
    if (top < scrollTop) this.list.scrollTop = top;
    else if (top + ROW_PX > scrollTop + clientHeight) this.list.scrollTop = top + ROW_PX - clientHeight;
    const row = [...this.rows.values()].find((one) => one.index === index);
    this.wantedIndex = row || this.length === 0 ? null : index;
    if (row) {
      row.button.focus({ preventScroll: true });
      this.keepTabStop();
    } else if (this.length > 0) {
      this.refresh();
    }
  }

  async focusHazard(id) {
    const row = this.rows.get(id);
    if (row) {
      row.button.focus({ preventScroll: true });
      this.keepTabStop();
      return;
    }
    const { index } = await this.data.ask('rows', 'hazards',
      { offset: 0, limit: 0, box: this.box(), text: this.search.value, wanted: id });
    if (index >= 0) this.focusIndex(index);
    else this.list.focus({ preventScroll: true });
  }
}

function place(row, index) {
  if (row.index === index) return;
  row.index = index;
  row.item.style.setProperty('--at', index);
  row.item.setAttribute('aria-posinset', index + 1);
}

function noteText(shown, total) {
  if (total === 0) return 'No hazards yet. They appear here the moment a vehicle reports one.';
  return shown === 0 ? 'No hazard matches the search and filters here.' : '';
}
