// On a phone the panel is a sheet at the bottom edge: a tap or a swipe on its handle opens it.

import { byId, setText } from '../dom.js';

const SWIPE_PX = 24;

export class Sheet {
  constructor() {
    this.panel = byId('panel');
    this.handle = byId('sheet-handle');
    this.summary = byId('sheet-summary');
    this.startY = null;
    this.swiped = false;
    this.handle.addEventListener('click', () => {
      if (!this.swiped) this.toggle(!this.isOpen());
      this.swiped = false;
    });
    this.handle.addEventListener('pointerdown', (event) => {
      this.startY = event.clientY;
      this.swiped = false;
      this.handle.setPointerCapture(event.pointerId);
    });
    this.handle.addEventListener('pointermove', (event) => this.swipe(event.clientY));
    this.handle.addEventListener('pointerup', () => { this.startY = null; });
    this.handle.addEventListener('pointercancel', () => { this.startY = null; });
  }

  isOpen() {
    return this.panel.classList.contains('open');
  }

  /** Of the map, by the closed sheet, pixels; 0 where the panel stands beside the map. */
  coveredHeight() {
    return this.handle.offsetHeight;
  }

  /** Calls `focus()`, which gives the focus to something in the panel; where that is closed, the
   * handle that opens it has the focus. */
  focusBack(focus) {
    if (this.coveredHeight() > 0 && !this.isOpen()) this.handle.focus({ preventScroll: true });
    else focus();
  }

  toggle(open) {
    this.panel.classList.toggle('open', open);
    this.handle.setAttribute('aria-expanded', String(open));
  }

  say(text) {
    setText(this.summary, text);
  }

  swipe(y) {
    if (this.startY === null || Math.abs(y - this.startY) < SWIPE_PX) return;
    this.toggle(y < this.startY);
    this.swiped = true;
    this.startY = null;
  }
}
