// What officials do with a hazard beside confirming and rejecting it: comment, assign, close, another
// class, another place, merge. One dialog, whose fields are those of what is to be done.

import { byId, element } from '../dom.js';
import { plural, position } from '../format.js';
import { hazardOf } from '../hazard_record.js';
import { actOn } from '../popups/officials.js';
import { session } from '../session.js';
import { getJson } from '../zone_lists.js';

const L = window.L;
/** As the zone's bounds. */
const MERGE_M = 100;
const MAX_COMMENT = 300;
const MAX_REASON = 100;
const M_PER_DEGREE = 111000;

const TASKS = {
  comment: { label: 'Comment', done: 'Commented on' },
  assign: { label: 'Assign to a team', done: 'Assigned' },
  close: { label: 'Close: it is repaired', done: 'Closed as repaired' },
  class: { label: 'Change the class', done: 'Class changed' },
  move: { label: 'Move', done: 'Moved' },
  merge: { label: 'Merge with another', done: 'Merged' },
};

function oneLine(text) {
  return text.trim().replace(/\s+/g, ' ');
}

function field(label, input) {
  return element('p', {}, element('label', { for: input.id }, label), input);
}

/** The dialog is made here: nobody but officials needs it. */
function buildDialog() {
  const task = element('select', { id: 'work-task' }, ...Object.entries(TASKS).map(
    ([name, { label }]) => element('option', { value: name }, label)));
  const text = (id, maxlength, extra = {}) => element('input',
    { id, type: 'text', maxlength, autocomplete: 'off', ...extra });
  const reason = field('Why, kept with the decision; may stay empty', text('work-reason', MAX_REASON));
  const parts = {
    comment: [field('Comment, for officials', element('textarea',
      { id: 'work-text', maxlength: MAX_COMMENT, rows: 3 }))],
    assign: [field('Team; empty takes it off', text('work-team', 64, { list: 'work-teams' })),
      element('datalist', { id: 'work-teams' }),
      field('To be done by, may stay empty', element('input', { id: 'work-due', type: 'date' }))],
    close: [element('p', { class: 'decision-note' },
      'It leaves the map and counts as repaired. Nobody is blamed for having reported it.')],
    class: [field('It is a', element('select', { id: 'work-class' }))],
    move: [element('div', { class: 'work-pair' },
      field('Latitude', text('work-latitude', 20, { inputmode: 'decimal' })),
      field('Longitude', text('work-longitude', 20, { inputmode: 'decimal' }))),
    element('p', {}, element('button', { id: 'work-drag', class: 'decide', type: 'button' },
      'Drag it on the map'))],
    merge: [field(`It is the same as, within ${MERGE_M} m`, element('select', { id: 'work-other' })),
      element('p', { id: 'work-merge-note', class: 'decision-note' })],
  };
  const sections = Object.entries(parts).map(([name, nodes]) => element('div',
    { class: 'work-part', 'data-task': name }, ...nodes));
  const dialog = element('dialog', { id: 'work', class: 'decision', 'aria-labelledby': 'work-title' },
    element('form', { id: 'work-form', autocomplete: 'off' },
      element('h2', { id: 'work-title' }),
      element('p', { id: 'work-label', class: 'decision-label' }),
      field('What is to be done', task), ...sections,
      element('div', { id: 'work-why' }, reason),
      element('p', { id: 'work-error', class: 'decision-error', role: 'alert' }),
      element('div', { class: 'decisions' },
        element('button', { id: 'work-cancel', class: 'decide', type: 'button' }, 'Cancel'),
        element('button', { id: 'work-submit', class: 'decide decide-main', type: 'submit' }, 'Save'))));
  document.body.append(dialog);
  return dialog;
}

export class WorkDialog {
  /** `onDone(text, hazard, decisionId)` says what was done; `teams()` answers names of teams;
   * `onClosed(hazard)` gives the focus back. */
  constructor(map, catalogue, { onDone, teams, onClosed }) {
    this.map = map;
    this.catalogue = catalogue;
    this.onDone = onDone;
    this.teams = teams;
    this.onClosed = onClosed;
    this.hazard = null;
    this.marker = null;
    this.isDragging = false;
  }

  /** The button in a hazard's popup, for officials who have logged in. */
  button(hazard) {
    if (!session.decides()) return [];
    const node = element('button', { type: 'button', class: 'decide', 'data-focus': 'work' }, 'More\u2026');
    node.onclick = () => this.open(hazard);
    return [node];
  }

  make() {
    this.dialog = buildDialog();
    byId('work-task').addEventListener('change', () => this.showTask());
    byId('work-cancel').addEventListener('click', () => this.dialog.close());
    byId('work-drag').addEventListener('click', () => this.drag());
    byId('work-form').addEventListener('submit', (event) => {
      event.preventDefault();
      this.save();
    });
    this.dialog.addEventListener('close', () => {
      if (!this.isDragging) this.onClosed(this.hazard);
    });
  }

  open(hazard, task = 'comment') {
    if (!this.dialog) this.make();
    this.hazard = hazard;
    byId('work-title').textContent = hazard.label;
    byId('work-label').textContent = position(hazard.latitude, hazard.longitude);
    byId('work-task').value = task;
    for (const id of ['work-text', 'work-team', 'work-due', 'work-reason']) byId(id).value = '';
    byId('work-teams').replaceChildren(...this.teams().map((team) => element('option', { value: team })));
    byId('work-class').replaceChildren(...[...this.catalogue.classes.keys()]
      .filter((name) => name !== hazard.className)
      .map((name) => element('option', { value: name }, this.catalogue.label(name))));
    this.writePlace(hazard);
    byId('work-other').replaceChildren();
    byId('work-merge-note').textContent = '';
    this.showTask();
    this.dialog.showModal();
    byId('work-task').focus();
  }

  writePlace({ latitude, longitude }) {
    byId('work-latitude').value = latitude.toFixed(7);
    byId('work-longitude').value = longitude.toFixed(7);
  }

  showTask() {
    const name = byId('work-task').value;
    for (const part of this.dialog.querySelectorAll('.work-part')) part.hidden = part.dataset.task !== name;
    byId('work-why').hidden = name === 'comment';
    byId('work-error').textContent = '';
    byId('work-submit').disabled = false;
    if (name === 'merge') this.findOthers();
  }

  /** Those near enough to be the same thing, the nearest first. */
  async findOthers() {
    const { hazard } = this;
    const select = byId('work-other');
    if (select.childElementCount > 0) return;
    const north = MERGE_M / M_PER_DEGREE;
    const east = Math.min(north / Math.max(Math.cos(hazard.latitude * Math.PI / 180), 0.01), 1);
    const box = [Math.max(hazard.longitude - east, -180), Math.max(hazard.latitude - north, -90),
      Math.min(hazard.longitude + east, 180), Math.min(hazard.latitude + north, 90)];
    let features = [];
    try {
      ({ features } = await getJson(`/api/v1/hazards?limit=100&bbox=${box.map((edge) => edge.toFixed(7)).join(',')}`));
    } catch (failure) {
      byId('work-merge-note').textContent = 'The hazards near it cannot be loaded.';
      return;
    }
    if (this.hazard !== hazard) return;
    const from = L.latLng(hazard.latitude, hazard.longitude);
    const near = features.map(hazardOf).filter(({ id }) => id !== hazard.id)
      .map((other) => ({ other, metres: from.distanceTo([other.latitude, other.longitude]) }))
      .filter(({ metres }) => metres <= MERGE_M).sort((a, b) => a.metres - b.metres);
    select.replaceChildren(...near.map(({ other, metres }) => element('option', { value: other.id },
      `${other.label}, ${Math.round(metres)} m away, ${plural(other.sightings, 'report')}`)));
    byId('work-merge-note').textContent = near.length === 0 ? 'There is no other hazard so near.'
      : 'The other one leaves the map; its reports count here. You can split them again in the history.';
    byId('work-submit').disabled = byId('work-task').value === 'merge' && near.length === 0;
  }

  /** The dialog steps aside for a marker that can be dragged; a drop brings it back. */
  drag() {
    this.isDragging = true;
    this.dialog.close();
    this.map.closePopup();
    const [latitude, longitude] = [Number(byId('work-latitude').value), Number(byId('work-longitude').value)];
    const icon = L.divIcon({ className: 'work-marker', iconSize: [40, 40], iconAnchor: [20, 20] });
    this.marker = L.marker([latitude, longitude], { draggable: true, icon, keyboard: false,
      title: 'Drag to the place, then let go', zIndexOffset: 10000 }).addTo(this.map);
    this.map.setView([latitude, longitude], Math.max(this.map.getZoom(), 18), { animate: false });
    this.marker.on('dragend', () => this.dropped());
    const onKey = (event) => {
      if (event.key !== 'Escape') return;
      this.dropped();
    };
    document.addEventListener('keydown', onKey, { once: true });
  }

  dropped() {
    if (this.marker === null) return;
    const { lat, lng } = this.marker.getLatLng();
    this.marker.remove();
    this.marker = null;
    this.isDragging = false;
    this.writePlace({ latitude: lat, longitude: lng });
    this.dialog.showModal();
    byId('work-submit').focus();
  }

  /** {call, body} or, in words, what is {wrong}. */
  decision() {
    const call = byId('work-task').value;
    const reason = oneLine(byId('work-reason').value);
    const why = reason ? { reason } : {};
    switch (call) {
      case 'comment': {
        const text = oneLine(byId('work-text').value);
        return text ? { call, body: { text } } : { wrong: 'Please write something.' };
      }
      case 'assign': {
        const team = oneLine(byId('work-team').value);
        const due = byId('work-due').value;
        if (due && !team) return { wrong: 'Please name the team.' };
        return { call, body: { team: team || null, ...(due ? { due } : {}), ...why } };
      }
      case 'class': return { call, body: { class: byId('work-class').value, ...why } };
      case 'move': {
        const place = [byId('work-longitude').value, byId('work-latitude').value].map(Number);
        if (!place.every(Number.isFinite)) return { wrong: 'Please write degrees, like 40.4433.' };
        return { call, body: { position: place, ...why } };
      }
      case 'merge': return { call, body: { other: byId('work-other').value, ...why } };
      default: return { call: 'close', body: why };
    }
  }

  async save() {
    const { hazard } = this;
    const { call, body, wrong } = this.decision();
    if (wrong) {
      byId('work-error').textContent = wrong;
      return;
    }
    byId('work-submit').disabled = true;
    const answer = await actOn(hazard, call, body);
    byId('work-submit').disabled = false;
    if (answer.wrong) {
      byId('work-error').textContent = answer.wrong.sentence;
      return;
    }
    this.dialog.close();
    this.onDone(`${TASKS[call].done}: ${hazard.label}`, hazard, answer.told.properties?.decision_id);
  }
}
