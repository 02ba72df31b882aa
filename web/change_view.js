// Map changes, objects that came or went since earlier drives: their layer, its check box and the
// list by which they are reached without a mouse.

import { ChangeLayer, changeBadge } from './change_layer.js';
import { changePopup, changeStateLabel } from './change_popup.js';
import { byId, element, throttled } from './dom.js';
import { ago, plural, utcTime } from './format.js';
import { keepOneTabStop, moveFocus } from './list_focus.js';

const L = window.L;
const MAX_ROWS = 50;
const PLAIN = '#6b766a';

/** A GeoJSON feature of the API as the flat object that the page works with. */
function changeOf(feature) {
  const { properties } = feature;
  const [longitude, latitude] = feature.geometry.coordinates;
  const vanished = properties.direction === 'vanished';
  const colour = String(properties.colour);
  return {
    id: String(properties.id),
    label: String(properties.label),
    title: `${properties.label} ${vanished ? 'vanished' : 'appeared'}`,
    direction: vanished ? 'vanished' : 'appeared',
    vanished,
    colour: /^#[0-9a-f]{6}$/i.test(colour) ? colour : PLAIN,
    state: String(properties.state),
    latitude,
    longitude,
    confidence: properties.confidence,
    vehicles: properties.vehicles,
    drives: properties.drives,
    against: properties.against,
    firstSeen: Date.parse(properties.first_seen),
    lastSeen: Date.parse(properties.last_seen),
    updated: Date.parse(properties.updated),
    sigma: properties.position_sigma_m,
    sequence: properties.sequence,
  };
}

export class ChangeView {
  /** `buttons(change)` answers what people can do with it, `coveredHeight` is of the map's foot,
   * pixels; `onChoose()` is called before the map goes to a change from the list. */
  constructor(map, buttons, coveredHeight, onChoose) {
    this.changes = new Map();
    this.rows = new Map();
    this.onChoose = onChoose;
    this.chosen = null;
    this.layer = new ChangeLayer(map, null, (change) => changePopup(change, buttons(change)),
      coveredHeight);
    this.box = byId('show-changes');
    this.list = byId('changes');
    this.updateSoon = throttled(() => this.update(), 120);
    this.box.addEventListener('change', () => {
      this.layer.setVisible(this.box.checked);
      this.update();
    });
    this.list.addEventListener('click', (event) => {
      const row = event.target.closest('button');
      if (row) this.choose(this.changes.get(row.dataset.change));
    });
    this.list.addEventListener('keydown', (event) => moveFocus(this.list, event));
    map.on('popupopen', (event) => this.onPopupOpen(event.popup));
    map.on('popupclose', (event) => this.onPopupClose(event.popup));
  }

  replaceAll(features) {
    this.changes = new Map(features.map((feature) => [feature.id, changeOf(feature)]));
    this.layer.show([...this.changes.values()]);
    this.update();
  }

  /** Takes an event; answers whether it brought a change that was not known. */
  apply(action, feature) {
    const change = changeOf(feature);
    const known = this.changes.get(change.id);
    if (known && known.sequence >= change.sequence) return null;
    if (action === 'removed') {
      this.changes.delete(change.id);
      this.layer.remove(change);
    } else {
      this.changes.set(change.id, change);
      this.layer.put(change);
    }
    this.updateSoon();
    return action !== 'removed' && !known ? change : null;
  }

  bounds() {
    return L.latLngBounds([...this.changes.values()]
      .map((change) => [change.latitude, change.longitude]));
  }

  focusPopup(id, name) {
    this.layer.focusPopup(id, name);
  }

  /** Check box, count and list as they are now. */
  update() {
    byId('change-count').textContent = this.changes.size.toLocaleString('en');
    byId('change-section').hidden = this.changes.size === 0 || !this.box.checked;
    const newest = [...this.changes.values()].sort((a, b) => b.sequence - a.sequence)
      .slice(0, MAX_ROWS);
    this.arrange(newest);
    keepOneTabStop(this.list);
    byId('change-note').textContent = this.changes.size > MAX_ROWS
      ? `The newest ${MAX_ROWS} of ${this.changes.size.toLocaleString('en')}.` : '';
  }

  /** Rows that stay keep their nodes, as those of hazards do: no click or focus is lost. */
  arrange(changes) {
    const wanted = new Set(changes.map((change) => change.id));
    for (const [id, row] of this.rows) {
      if (wanted.has(id)) continue;
      row.item.remove();
      this.rows.delete(id);
    }
    let next = this.list.firstChild;
    for (const change of changes) {
      const row = this.rows.get(change.id) ?? this.addRow(change);
      fill(row, change);
      if (row.item === next) next = next.nextSibling;
      else this.list.insertBefore(row.item, next);
    }
  }

  addRow(change) {
    const button = element('button', {
      type: 'button', class: 'row', tabindex: '-1', 'data-change': change.id,
    });
    const row = { item: element('li', {}, button), button, sequence: null, time: null };
    this.rows.set(change.id, row);
    return row;
  }

  focusRow(id) {
    this.rows.get(id)?.button.focus({ preventScroll: true });
  }

  choose(change) {
    if (!change) return;
    this.onChoose();
    this.chosen = change.id;
    this.layer.open(change);
  }

  onPopupOpen(popup) {
    const content = popup.getElement().querySelector('.popup');
    if (this.chosen !== null && content?.dataset.change === this.chosen) {
      content.focus({ preventScroll: true });
    }
  }

  onPopupClose(popup) {
    const held = popup.getElement()?.contains(document.activeElement);
    if (this.chosen !== null && (held || document.activeElement === document.body)) {
      this.focusRow(this.chosen);
    }
    this.chosen = null;
  }
}

function fill(row, change) {
  if (row.sequence !== change.sequence) {
    row.sequence = change.sequence;
    row.time = element('time', { datetime: new Date(change.updated).toISOString(),
      title: utcTime(change.updated) });
    row.button.replaceChildren(changeBadge(change),
      element('span', { class: 'row-label' }, change.title), row.time,
      element('span', { class: 'row-facts' },
        `${changeStateLabel(change.state)} \u00b7 ${plural(change.vehicles, 'vehicle')}`));
  }
  row.time.textContent = ago(change.updated);
}
