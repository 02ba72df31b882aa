// The in-car page: the next hazard, counting down, and how the vehicle's parts are. It asks for
// nothing and needs no touch.

import { Catalogue } from '../catalogue.js';
import { byId, element, setText } from '../dom.js';

/** Without a word for so long the page shows none of what it knew. */
const LOST_AFTER_MS = 4000;
const RETRY_MS = 1000;
/** Between two states the speed carries the distance on, for so long at most. */
const CARRY_ON_S = 1.5;
const SIDES = { left: 'on the left', right: 'on the right', ahead: '' };

let catalogue = null;
let state = null;
let heardAt = 0;
/** The shown hazard and the distance at which it was first shown. */
const NOTHING = { id: null, class: null, from: 1 };
let shown = NOTHING;

/** Metres as they are read at a glance: fives below 100, else tens. */
export function shownDistance(metres) {
  const step = metres < 100 ? 5 : 10;
  return Math.max(0, Math.round(metres / step) * step);
}

function distanceNow(hazard) {
  const since = Math.min((performance.now() - heardAt) / 1000, CARRY_ON_S);
  return Math.max(0, hazard.distance_m - (state.speed_mps ?? 0) * since);
}

function darkBySystem() {
  return matchMedia('(prefers-color-scheme: dark)').matches;
}

function showMessage(kind, text) {
  shown = NOTHING;
  byId('ahead').dataset.state = kind;
  setText(byId('label'), text);
  setText(byId('side'), '');
}

function showHazard(hazard) {
  const ahead = byId('ahead');
  ahead.dataset.state = 'hazard';
  ahead.dataset.urgency = hazard.urgency;
  if (shown.id !== hazard.id || shown.class !== hazard.class) {
    shown = { id: hazard.id, class: hazard.class, from: Math.max(1, hazard.distance_m) };
    byId('badge').replaceChildren(catalogue.badge(hazard.class));
  }
  setText(byId('label'), catalogue.label(hazard.class));
  setText(byId('side'), SIDES[hazard.side] ?? '');
  const metres = distanceNow(hazard);
  const isHere = metres < 10;
  setText(byId('distance'), isHere ? 'here' : String(shownDistance(metres)));
  setText(byId('unit'), isHere ? '' : 'm');
  byId('bar').style.setProperty('--left', Math.min(1, metres / shown.from).toFixed(3));
}

function showLater() {
  const texts = state.hazards.slice(1)
    .map((each) => `${catalogue.label(each.class)} ${shownDistance(distanceNow(each))} m`);
  if (state.more > 0) texts.push(`and ${state.more} more`);
  const list = byId('later');
  texts.forEach((text, index) => {
    if (!list.children[index]) list.append(element('li'));
    setText(list.children[index], text);
  });
  while (list.children.length > texts.length) list.lastChild.remove();
}

function showPart(id, level, text) {
  byId(id).dataset.level = level;
  setText(byId(id).querySelector('span'), text);
}

function showParts() {
  const { camera, receiver, zone, reports, voice } = state;
  const rate = camera?.rate_hz;
  showPart('camera', camera?.level ?? 'unknown',
    camera ? (Number.isFinite(rate) ? `${rate.toFixed(1)} / s` : 'no rate') : 'silent');
  const accuracy = receiver?.accuracy_m;
  const fix = Number.isFinite(accuracy) ? `fix, \u00b1${Math.max(1, Math.round(accuracy))} m` : 'fix';
  showPart('receiver', receiver?.level ?? 'unknown', receiver ? (receiver.fix ? fix : 'no fix') : 'silent');
  showPart('zone', zone ? (zone.connected ? 'good' : 'bad') : 'unknown',
    zone ? (zone.connected ? 'connected' : 'no link') : 'silent');
  const waiting = reports?.pending;
  showPart('reports', reports ? (waiting > 0 ? 'warn' : reports.level) : 'unknown',
    reports ? (waiting > 0 ? `${waiting} waiting` : 'all sent') : 'silent');
  showPart('voice', voice?.level ?? 'unknown', voice ? String(voice.voice ?? 'unknown') : 'off');
}

function show() {
  const isLost = state === null || performance.now() - heardAt > LOST_AFTER_MS;
  document.documentElement.dataset.look = (state?.dark ?? darkBySystem()) ? 'night' : 'day';
  if (isLost) {
    showMessage(state === null ? 'waiting' : 'lost',
      state === null ? 'Waiting for the vehicle' : 'No word from the vehicle');
    for (const id of ['camera', 'receiver', 'zone', 'reports', 'voice']) showPart(id, 'unknown', 'silent');
    return;
  }
  showParts();
  if (state.hazards.length > 0) {
    showHazard(state.hazards[0]);
    showLater();
  } else if (state.alerts === null) {
    showMessage('lost', 'No warnings: driver_alert is silent');
  } else if (!state.receiver?.fix) {
    showMessage('lost', 'No warnings: no position');
  } else {
    showMessage('clear', 'No hazard ahead');
  }
}

const pause = (ms) => new Promise((resolve) => { setTimeout(resolve, ms); });

async function fetchJson(address) {
  const answer = await fetch(address, { signal: AbortSignal.timeout(LOST_AFTER_MS) });
  if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
  return answer.json();
}

/** Each answer comes as soon as there is something new. */
async function follow() {
  for (;;) {
    try {
      catalogue ??= new Catalogue(await fetchJson('api/v1/classes'));
      const next = await fetchJson(state ? `api/v1/driver?since=${state.version}` : 'api/v1/driver');
      if (!Array.isArray(next.hazards)) throw new Error('no state yet');
      state = next;
      heardAt = performance.now();
      show();
    } catch {
      await pause(RETRY_MS);
    }
  }
}

/** A screen that goes dark would need a touch. */
async function stayAwake() {
  try {
    if (document.visibilityState === 'visible') await navigator.wakeLock?.request('screen');
  } catch {
    // The system decides otherwise, as at a low battery.
  }
}

document.addEventListener('visibilitychange', stayAwake);
stayAwake();
setInterval(show, 100);
show();
follow();
