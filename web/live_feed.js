// Keeps the page up to date: loads the list once, then follows the live stream from the list's
// sequence on, so that nothing between the two is lost; after a cut it resumes where it stood.

const PAGE = 10000;
const FIRST_DELAY_MS = 500;
const LONGEST_DELAY_MS = 10000;
/** The server says something at least every ten seconds. */
const SILENCE_MS = 25000;

export async function getJson(url) {
  const answer = await fetch(url, { cache: 'no-store' });
  if (!answer.ok) throw new Error(`${url}: ${answer.status}`);
  return answer.json();
}

/** All on the map, or all in one `state`. */
export function loadHazards(state = null) {
  return loadList('hazards', state);
}

async function loadList(kind, state = null) {
  const url = `/api/v1/${kind}?limit=${PAGE}${state === null ? '' : `&state=${state}`}`;
  let page = await getJson(url);
  const latest = new Map();
  for (;;) {
    for (const feature of page.features) {
      if (feature.properties.action === 'removed') latest.delete(feature.id);
      else latest.set(feature.id, feature);
    }
    if (!page.truncated) return { sequence: page.sequence, features: [...latest.values()] };
    page = await getJson(`${url}&since=${page.sequence}`);
  }
}

export class LiveFeed {
  /** Handlers: onList(features), onHazard(action, feature), onChangeList(features),
   * onChange(action, feature), onVehicle(feature), onState(state). */
  constructor(handlers) {
    this.handlers = handlers;
    this.sequence = null;
    this.socket = null;
    this.delay = FIRST_DELAY_MS;
    this.retryTimer = null;
    this.silenceTimer = null;
    window.addEventListener('online', () => this.retryNow());
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden) this.retryNow();
    });
  }

  async start() {
    this.handlers.onState('connecting');
    try {
      if (this.sequence === null) {
        const list = await loadHazards();
        const changes = await loadList('changes');
        // Each list is complete up to its own: from the smaller one on nothing is left out.
        this.sequence = Math.min(list.sequence, changes.sequence);
        this.handlers.onChangeList(changes.features);
        this.handlers.onList(list.features);
      }
      this.connect();
    } catch (failure) {
      this.retryLater();
    }
  }

  connect() {
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const socket = new WebSocket(`${scheme}://${location.host}/ws?since=${this.sequence}`);
    this.socket = socket;
    socket.addEventListener('message', (event) => this.receive(socket, JSON.parse(event.data)));
    socket.addEventListener('close', () => {
      if (this.socket !== socket) return;
      this.socket = null;
      this.retryLater();
    });
    this.watchSilence();
  }

  receive(socket, message) {
    if (this.socket !== socket) return;
    this.watchSilence();
    if (message.type === 'hello' && message.sequence < this.sequence) {
      // Another store stands behind the server now: what is known here is worth nothing.
      this.sequence = null;
      socket.close();
      return;
    }
    if (message.type === 'hazard') this.handlers.onHazard(message.action, message.feature);
    if (message.type === 'change') this.handlers.onChange(message.action, message.feature);
    if (message.type === 'vehicle') this.handlers.onVehicle(message.feature);
    if (['hazard', 'change', 'live'].includes(message.type)) {
      this.sequence = Math.max(this.sequence, message.sequence);
    }
    if (message.type === 'live') {
      this.delay = FIRST_DELAY_MS;
      this.handlers.onState('live');
    }
  }

  watchSilence() {
    clearTimeout(this.silenceTimer);
    this.silenceTimer = setTimeout(() => {
      const { socket } = this;
      this.socket = null;
      socket?.close();
      this.retryLater();
    }, SILENCE_MS);
  }

  retryLater() {
    clearTimeout(this.silenceTimer);
    clearTimeout(this.retryTimer);
    const delay = this.delay * (0.75 + Math.random() / 2);
    this.delay = Math.min(this.delay * 2, LONGEST_DELAY_MS);
    this.retryTimer = setTimeout(() => this.retryNow(), delay);
    this.handlers.onState('offline');
  }

  /** Also when the machine wakes up or the network is back. */
  retryNow() {
    if (this.socket !== null || this.retryTimer === null) return;
    clearTimeout(this.retryTimer);
    this.retryTimer = null;
    this.start();
  }
}
