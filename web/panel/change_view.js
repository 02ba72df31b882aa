// Map changes, objects that came or went since earlier drives: their layer, its check box and the
// list by which they are reached without a mouse.

import { ChangeLayer, changeBadge } from '../layers/change_layer.js';
import { changePopup, changeStateLabel } from '../popups/change_popup.js';
import { byId, element, setText, throttled } from '../dom.js';
import { ago, plural, utcTime } from '../format.js';
import { keepOneTabStop, moveFocus } from './list_focus.js';

const MAX_ROWS = 50;

/** What a row says of a change, as nodes. */
function changeRow(change) {
  return [changeBadge(change),
    element('span', { class: 'row-label', title: change.title }, change.title),
    element('time', { datetime: new Date(change.updated).toISOString(),
      title: utcTime(change.updated) }, ago(change.updated)),
    element('span', { class: 'row-facts' },
      `${changeStateLabel(change.state)} \u00b7 ${plural(change.vehicles, 'vehicle')}`)];
}

export class ChangeView {
  /** `buttons(change)` answers what people can do with it, `coveredHeight` is of the map's foot,
   * pixels; `onChoose()` is called before the map goes to a change from the list, `onBack(focus)`
   * when the list should have the focus again. */
  constructor(map, data, buttons, coveredHeight, onChoose, onBack) {
    this.data = data;
    this.rows = new Map();
    this.onChoose = onChoose;
    this.onBack = onBack;
    this.layer = new ChangeLayer(map, data, (change) => changePopup(change, buttons(change)),
      changeRow, coveredHeight);
    this.box = byId('show-changes');
    this.list = byId('changes');
    this.updateSoon = throttled(() => this.update(), 120);
    this.box.addEventListener('change', () => {
      this.layer.setVisible(this.box.checked);
      this.update();
    });
    this.list.addEventListener('click', (event) => {
      const row = event.target.closest('button');
      if (row) this.choose(this.rows.get(row.dataset.change)?.change);
    });
    this.list.addEventListener('keydown', (event) => moveFocus(this.list, event));
  }

  focusPopup(id, name) {
    this.layer.focusPopup(id, name);
  }

  /** Check box, count, list and map as they are now. */
  async update() {
    const count = this.data.sizes.changes;
    setText(byId('change-count'), count.toLocaleString('en'));
    byId('change-section').hidden = count === 0 || !this.box.checked;
    setText(byId('change-note'), count > MAX_ROWS
      ? `The newest ${MAX_ROWS} of ${count.toLocaleString('en')}.` : '');
    if (this.box.checked) this.layer.refresh();
    const { rows } = await this.data.ask('rows', 'changes', { offset: 0, limit: MAX_ROWS });
    this.arrange(rows);
    keepOneTabStop(this.list);
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
    const row = { item: element('li', {}, button), button, change: null };
    this.rows.set(change.id, row);
    return row;
  }

  choose(change) {
    if (!change) return;
    this.onChoose();
    this.layer.open(change, () => this.onBack(() => {
      const button = this.rows.get(change.id)?.button ?? this.list.querySelector('button');
      (button ?? byId('show-changes')).focus({ preventScroll: true });
    }));
  }
}

function fill(row, change) {
  if (row.change?.sequence === change.sequence) {
    setText(row.button.querySelector('time'), ago(change.updated));
    return;
  }
  row.change = change;
  row.button.replaceChildren(...changeRow(change));
}
