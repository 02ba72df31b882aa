// Keeps the page up to date: loads the lists once, then follows the live stream from the lists'
// sequence on, so that nothing between the two is lost; after a cut it resumes where it stood.

import { addressOf, streamAddressOf } from '../address.js';
import { getJson, loadChanges, loadPoints } from '../zone_lists.js';

const FIRST_DELAY_MS = 200;
/** A zone that is back is found so soon; a page that nobody sees may take longer. */
const LONGEST_DELAY_MS = 1000;
const LONGEST_HIDDEN_DELAY_MS = 10000;
const PROBE_MS = 1500;
/** The server greets at once, and then says something at least every five seconds. */
const GREETING_MS = 5000;
const SILENCE_MS = 15000;

export class LiveFeed {
  /** Handlers: onLists({classes, points, changes}), onHazard(action, feature),
   * onChange(action, feature), onVehicle(feature), onState(state). */
  constructor(handlers) {
    this.handlers = handlers;
    this.sequence = null;
    this.socket = null;
    this.delay = FIRST_DELAY_MS;
    this.retryTimer = null;
    this.silenceTimer = null;
    this.hidden = false;
  }

  /** Also for a page that nobody sees; one that is seen again tries at once. */
  setHidden(hidden) {
    this.hidden = hidden;
    if (!hidden) this.retryNow();
  }

  async start() {
    this.handlers.onState('connecting');
    try {
      if (this.sequence === null) {
        const { sees } = await getJson('/api/v1/session');
        const [classes, points, changes] = await Promise.all(
          [getJson('/api/v1/classes'), loadPoints(), loadChanges(!sees.candidates)]);
        // Each list is complete up to its own: from the smaller one on nothing is left out.
        this.sequence = Math.min(points.sequence, changes.sequence);
        this.handlers.onLists({ classes, points, changes });
      }
      this.connect();
    } catch (failure) {
      this.retryLater();
    }
  }

  connect() {
    const socket = new WebSocket(streamAddressOf(`/ws?since=${this.sequence}`));
    this.socket = socket;
    socket.addEventListener('message', (event) => this.receive(socket, JSON.parse(event.data)));
    socket.addEventListener('close', () => {
      if (this.socket !== socket) return;
      this.socket = null;
      this.retryLater();
    });
    this.watchSilence(GREETING_MS);
  }

  receive(socket, message) {
    if (this.socket !== socket) return;
    this.watchSilence(SILENCE_MS);
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

  watchSilence(limit) {
    clearTimeout(this.silenceTimer);
    this.silenceTimer = setTimeout(() => {
      const { socket } = this;
      this.socket = null;
      socket?.close();
      this.retryLater();
    }, limit);
  }

  retryLater() {
    clearTimeout(this.silenceTimer);
    clearTimeout(this.retryTimer);
    // Not all pages at the same moment.
    const delay = this.delay * (0.75 + Math.random() / 2);
    this.delay = Math.min(this.delay * 2, this.hidden ? LONGEST_HIDDEN_DELAY_MS : LONGEST_DELAY_MS);
    this.retryTimer = setTimeout(() => this.retryNow(), delay);
    this.handlers.onState('offline');
  }

  /** Also when the machine wakes up or the network is back. Browsers hold back WebSockets, for up to
   * five seconds, after some that failed: a zone that is away is asked for its health instead. */
  async retryNow() {
    if (this.socket !== null || this.retryTimer === null) return;
    clearTimeout(this.retryTimer);
    this.retryTimer = null;
    try {
      const options = { cache: 'no-store', signal: AbortSignal.timeout(PROBE_MS) };
      const answer = await fetch(addressOf('/healthz'), options);
      if (!answer.ok) throw new Error(`healthz: ${answer.status}`);
    } catch (failure) {
      this.retryLater();
      return;
    }
    this.start();
  }
}
