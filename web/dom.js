// Builds DOM nodes without ever parsing text as HTML: what a vehicle or a file says is only ever
// the value of an attribute or a text node.

/** An element with attributes (null: left out) and children (nodes or text). */
export function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

const SVG = 'http://www.w3.org/2000/svg';

export function svgElement(tag, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

export function byId(id) {
  return document.getElementById(id);
}

/** Writes only what is new: the browser lays out anew what is written. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Runs `work()`, which answers a promise, one at a time; calls during a run ask for one more. A run
 * that fails does not end the next ones. */
export function oneAtATime(work) {
  let running = false;
  let again = false;
  return async () => {
    again = true;
    if (running) return;
    running = true;
    try {
      while (again) {
        again = false;
        await work();
      }
    } finally {
      running = false;
    }
  };
}

/** Lets the browser answer in between. */
export function nextTask() {
  return new Promise((resolve) => { setTimeout(resolve); });
}

/** Calls `work` once, `delay` ms after the first of a burst of calls. */
export function throttled(work, delay) {
  let timer = null;
  return () => {
    if (timer !== null) return;
    timer = setTimeout(() => {
      timer = null;
      work();
    }, delay);
  };
}
