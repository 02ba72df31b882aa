// Looks at a hazard's pictures one after the other, closer by wheel, fingers, keys or buttons.

import { element } from '../dom.js';
import { loadPictures, ownPicture } from './hazard_pictures.js';
import { awaitPicture } from './picture_address.js';

const MOST_ZOOM = 8;
const ZOOM_STEP = 1.5;
/** Of the wheel's way. */
const ZOOM_PER_PIXEL = 0.002;
/** By how much of the stage an arrow key moves an enlarged picture. */
const MOVE_SHARE = 0.15;

function button(id, text, label, keys) {
  return element('button', { id, class: 'decide', type: 'button', 'aria-label': label,
    'aria-keyshortcuts': keys, title: label }, text);
}

class PictureViewer {
  constructor() {
    this.image = element('img', { id: 'viewer-image', draggable: 'false' });
    this.note = element('p', { id: 'viewer-note', role: 'status' });
    this.stage = element('div', { id: 'viewer-stage', class: 'viewer-stage' }, this.image, this.note);
    this.title = element('h2', { id: 'viewer-title' });
    this.words = element('p', { id: 'viewer-words', class: 'decision-label', role: 'status' });
    this.buttons = {
      previous: button('viewer-previous', '\u2039', 'Newer picture', 'ArrowLeft'),
      next: button('viewer-next', '\u203a', 'Older picture', 'ArrowRight'),
      out: button('viewer-out', '\u2212', 'Smaller', '-'),
      fit: button('viewer-fit', 'Fit', 'Fit the whole picture', '0'),
      in: button('viewer-in', '+', 'Larger', '+'),
      close: button('viewer-close', 'Close', 'Close the pictures', 'Escape'),
    };
    this.dialog = element('dialog', { id: 'viewer', class: 'decision viewer',
      'aria-labelledby': 'viewer-title' }, this.title, this.words, this.stage,
    element('div', { class: 'decisions' }, ...Object.values(this.buttons)));
    document.body.append(this.dialog);
    this.pictures = [];
    this.at = 0;
    this.zoom = 1;
    this.x = 0;
    this.y = 0;
    /** Where fingers, or the mouse, are down: by pointer. */
    this.pointers = new Map();
    this.listen();
  }

  listen() {
    const { previous, next, out, fit, in: closer, close } = this.buttons;
    previous.addEventListener('click', () => this.show(this.at - 1));
    next.addEventListener('click', () => this.show(this.at + 1));
    out.addEventListener('click', () => this.zoomBy(1 / ZOOM_STEP));
    closer.addEventListener('click', () => this.zoomBy(ZOOM_STEP));
    fit.addEventListener('click', () => this.zoomBy(0));
    close.addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('keydown', (event) => this.onKey(event));
    this.dialog.addEventListener('close', () => {
      this.hazard = null;
      this.image.removeAttribute('src');
      this.giveFocusBack();
    });
    this.image.addEventListener('load', () => {
      this.note.textContent = '';
      this.place();
    });
    this.image.addEventListener('error', () => this.awaitAgain());
    // A page that scrolls or zooms under the picture is what nobody wants.
    this.stage.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoomBy(Math.exp(-event.deltaY * ZOOM_PER_PIXEL), this.placeOf(event));
    }, { passive: false });
    this.stage.addEventListener('dblclick', (event) => {
      this.zoomBy(this.zoom > 1 ? 0 : 2 * ZOOM_STEP, this.placeOf(event));
    });
    this.stage.addEventListener('pointerdown', (event) => {
      try {
        this.stage.setPointerCapture(event.pointerId);
      } catch (gone) {
        // The finger is up again already.
      }
      this.pointers.set(event.pointerId, this.placeOf(event));
    });
    this.stage.addEventListener('pointermove', (event) => this.onMove(event));
    for (const end of ['pointerup', 'pointercancel']) {
      this.stage.addEventListener(end, ({ pointerId }) => this.pointers.delete(pointerId));
    }
    new ResizeObserver(() => this.place()).observe(this.stage);
  }

  /** Opens at the hazard's picture at `url`; all others follow when they have come. `giveFocusBack()`
   * is called when it closes. */
  async open(hazard, url, giveFocusBack) {
    this.hazard = hazard;
    this.giveFocusBack = giveFocusBack;
    this.title.textContent = hazard.label;
    this.pictures = [{ ...ownPicture(hazard), url }];
    this.dialog.showModal();
    this.buttons.close.focus();
    this.show(0);
    let all;
    try {
      all = await loadPictures(hazard);
    } catch (failure) {
      return;  // What is on the screen stays there.
    }
    if (this.hazard !== hazard) return;
    const at = all.findIndex((picture) => picture.url === this.pictures[this.at].url);
    if (at < 0) return;
    this.pictures = all;
    this.at = at;
    this.tell();
  }

  show(at) {
    if (at < 0 || at >= this.pictures.length) return;
    this.at = at;
    this.zoom = 1;
    this.x = 0;
    this.y = 0;
    this.wasThere = false;
    this.note.textContent = '';
    this.image.src = this.pictures[at].url;
    this.tell();
    this.place();
  }

  /** Which picture it is, and what can be done with it. */
  tell() {
    const { words, alt } = this.pictures[this.at];
    this.image.alt = alt;
    const { length } = this.pictures;
    this.words.textContent = `${length > 1 ? `${this.at + 1} of ${length} \u00b7 ` : ''}${words}`;
    const { previous, next, out, in: closer } = this.buttons;
    const hasFocus = document.activeElement;
    previous.disabled = this.at === 0;
    next.disabled = this.at === length - 1;
    out.disabled = this.zoom <= 1;
    closer.disabled = this.zoom >= MOST_ZOOM;
    // The keys are the dialog's: they need the focus within it.
    if (hasFocus?.disabled) this.buttons.close.focus();
  }

  async awaitAgain() {
    const { src } = this.image;
    if (!src || this.hazard === null) return;
    const isWanted = () => this.dialog.open && this.image.src === src;
    const { wasThere } = this;
    const came = await awaitPicture(src, wasThere, isWanted, (text) => { this.note.textContent = text; });
    if (!came) return;
    this.wasThere = true;
    this.image.src = src;
  }

  onKey(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const keys = {
      '+': () => this.zoomBy(ZOOM_STEP), '=': () => this.zoomBy(ZOOM_STEP),
      '-': () => this.zoomBy(1 / ZOOM_STEP), 0: () => this.zoomBy(0),
      PageUp: () => this.show(this.at - 1), PageDown: () => this.show(this.at + 1),
      ArrowLeft: () => (this.zoom > 1 ? this.moveBy(1, 0) : this.show(this.at - 1)),
      ArrowRight: () => (this.zoom > 1 ? this.moveBy(-1, 0) : this.show(this.at + 1)),
      ArrowUp: () => this.moveBy(0, 1), ArrowDown: () => this.moveBy(0, -1),
    };
    if (!(event.key in keys)) return;
    event.preventDefault();
    keys[event.key]();
  }

  moveBy(right, down) {
    this.x += right * MOVE_SHARE * this.stage.clientWidth;
    this.y += down * MOVE_SHARE * this.stage.clientHeight;
    this.place();
  }

  /** Where an event is, from the stage's middle. */
  placeOf({ clientX, clientY }) {
    const { left, top, width, height } = this.stage.getBoundingClientRect();
    return { x: clientX - left - width / 2, y: clientY - top - height / 2 };
  }

  onMove(event) {
    const before = this.pointers.get(event.pointerId);
    if (before === undefined) return;
    const now = this.placeOf(event);
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.pointers.set(event.pointerId, now);
    if (other) {
      const apart = (place) => Math.hypot(place.x - other.x, place.y - other.y);
      const middle = { x: (now.x + other.x) / 2, y: (now.y + other.y) / 2 };
      this.zoomBy(apart(now) / Math.max(apart(before), 1), middle);
    }
    // Two fingers move it by half of what each of them does.
    const share = other ? 0.5 : 1;
    this.x += share * (now.x - before.x);
    this.y += share * (now.y - before.y);
    this.place();
  }

  /** The picture's point at `place` stays where it is; a factor of 0 shows the whole picture. */
  zoomBy(factor, place = { x: 0, y: 0 }) {
    const zoom = Math.min(Math.max(this.zoom * factor, 1), MOST_ZOOM);
    const grown = zoom / this.zoom;
    this.x = place.x + (this.x - place.x) * grown;
    this.y = place.y + (this.y - place.y) * grown;
    this.zoom = zoom;
    this.place();
    this.tell();
  }

  /** Fits the picture into the stage, and moves and enlarges it as one has asked; no edge of it comes
   * into the stage as long as the picture is larger. */
  place() {
    const { naturalWidth, naturalHeight } = this.image;
    const { clientWidth, clientHeight } = this.stage;
    if (naturalWidth === 0 || clientWidth === 0) return;
    const scale = Math.min(clientWidth / naturalWidth, clientHeight / naturalHeight);
    const [width, height] = [naturalWidth * scale, naturalHeight * scale];
    const bound = (way, size, room) => {
      const most = Math.max(0, (size * this.zoom - room) / 2);
      return Math.min(Math.max(way, -most), most);
    };
    this.x = bound(this.x, width, clientWidth);
    this.y = bound(this.y, height, clientHeight);
    const { style } = this.image;
    style.width = `${width}px`;
    style.height = `${height}px`;
    style.transform = `translate(-50%, -50%) translate(${this.x}px, ${this.y}px) scale(${this.zoom})`;
    this.stage.classList.toggle('is-enlarged', this.zoom > 1);
  }
}

let viewer = null;

/** Opens the viewer at a hazard's picture. `giveFocusBack()` is called when it closes. */
export function viewPictures(hazard, url, giveFocusBack = () => {}) {
  viewer ??= new PictureViewer();
  viewer.open(hazard, url, giveFocusBack);
}

/** Makes a link to a picture open the viewer; with a key that opens a tab it stays a link. */
export function opensViewer(link, hazard, url) {
  link.addEventListener('click', (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    viewPictures(hazard, url, () => { if (link.isConnected) link.focus(); });
  });
  return link;
}
