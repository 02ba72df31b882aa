// Brings what stands in the document up to date and keeps its nodes: what one presses, selects, has
// opened or scrolled to stays, and no click is lost because something else changed meanwhile.

/** Handlers that are set as properties go from the new node to the one that stays. */
const HANDLERS = ['onclick', 'onerror', 'ontoggle'];

/** Makes the element `old` equal to `fresh`, an element of the same kind, which is used up. Whether a
 * `details` is open is left to whoever opens it. */
export function renew(old, fresh) {
  // The policy of the page forbids to write a style as an attribute.
  const own = ['style', ...(old.nodeName === 'DETAILS' ? ['open'] : [])];
  if (old.style.cssText !== fresh.style.cssText) old.style.cssText = fresh.style.cssText;
  for (const name of old.getAttributeNames()) {
    if (!fresh.hasAttribute(name) && !own.includes(name)) old.removeAttribute(name);
  }
  for (const name of fresh.getAttributeNames()) {
    const value = fresh.getAttribute(name);
    if (old.getAttribute(name) !== value && !own.includes(name)) old.setAttribute(name, value);
  }
  for (const name of HANDLERS) old[name] = fresh[name];
  const before = [...old.childNodes];
  const after = [...fresh.childNodes];
  after.forEach((node, at) => {
    if (at >= before.length) old.append(node);
    else if (!isAlike(before[at], node)) before[at].replaceWith(node);
    else if (node.nodeType === Node.ELEMENT_NODE) renew(before[at], node);
    else if (before[at].data !== node.data) before[at].data = node.data;
  });
  for (const node of before.slice(after.length)) node.remove();
}

/** Whether one can become the other: a button stays that button. */
function isAlike(one, other) {
  return one.nodeName === other.nodeName && one.dataset?.focus === other.dataset?.focus;
}
