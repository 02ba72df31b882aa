// The page's side of zone_worker.js: what changed comes as events, all else is asked for.

export class ZoneData {
  /** Handlers: onState(state), onLists(), onChanged(what), onWatched(kind, id, record). */
  constructor(handlers) {
    this.handlers = handlers;
    this.questions = new Map();
    this.lastId = 0;
    /** How many there are: hazards and map changes, hidden ones included. */
    this.sizes = { hazards: 0, changes: 0 };
    this.groupCounts = new Map();
    this.stateCounts = new Map();
    this.hiddenClasses = new Set();
    this.hiddenStates = new Set();
    /** Ids of the only hazards that are shown, and the corners of the area in which they lie; null: all. */
    this.onlyIds = null;
    this.area = null;
    this.age = null;
    this.keepsRejected = false;
    this.worker = new Worker(new URL('./worker/zone_worker.js', import.meta.url), { type: 'module' });
    this.worker.addEventListener('message', (event) => this.receive(event.data));
    this.worker.addEventListener('error', () => handlers.onState('offline'));
    document.addEventListener('visibilitychange', () => {
      this.worker.postMessage({ type: 'hidden', hidden: document.hidden });
    });
  }

  receive(message) {
    switch (message.type) {
      case 'answer': {
        const { resolve, reject } = this.questions.get(message.id);
        this.questions.delete(message.id);
        if (message.wrong === undefined) resolve(message.answer);
        else reject(new Error(message.wrong));
        break;
      }
      case 'changed':
        this.sizes = { hazards: message.hazards, changes: message.changes };
        this.groupCounts = message.groupCounts;
        this.stateCounts = message.stateCounts;
        this.handlers.onChanged(message);
        break;
      case 'watched': this.handlers.onWatched(message.kind, message.id, message.record); break;
      case 'lists':
        // The worker knows only now which classes there are.
        this.tellFilter();
        this.handlers.onLists();
        break;
      case 'state': this.handlers.onState(message.state); break;
      default:
    }
  }

  ask(what, kind, details) {
    this.lastId += 1;
    const id = this.lastId;
    return new Promise((resolve, reject) => {
      this.questions.set(id, { resolve, reject });
      this.worker.postMessage({ type: 'ask', id, what, kind, details });
    });
  }

  /** The class of all hazards whose class the catalogue does not have is ''. */
  hideClass(name, hidden) {
    if (hidden) this.hiddenClasses.add(name);
    else this.hiddenClasses.delete(name);
    this.tellFilter();
  }

  hideState(name, hidden) {
    if (hidden) this.hiddenStates.add(name);
    else this.hiddenStates.delete(name);
    this.tellFilter();
  }

  tellFilter() {
    this.worker.postMessage({ type: 'filter', classes: [...this.hiddenClasses],
      states: [...this.hiddenStates], onlyIds: this.onlyIds, area: this.area, age: this.age });
  }

  showOnly(ids) {
    this.onlyIds = ids;
    this.tellFilter();
  }

  /** `corners`: [x, y] in units. */
  showArea(corners) {
    this.area = corners;
    this.tellFilter();
  }

  /** `age`: {time, after, before}: the time, 'firstSeen' or 'updated', must lie between; null: any. */
  showAge(age) {
    this.age = age;
    this.tellFilter();
  }

  /** From now on each event of this one comes as onWatched; of none with null. */
  watch(kind, id) {
    this.worker.postMessage({ type: 'watch', kind, id });
  }

  /** Answers whether rejected hazards are now kept, or forgotten, as wanted. */
  async showRejected(shown) {
    const done = await this.ask('rejected', 'hazards', { shown });
    this.keepsRejected = shown && done;
    return done;
  }
}
