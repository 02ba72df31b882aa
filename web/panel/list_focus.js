// One tab stop for a whole list of buttons; the arrows move within it.

export function keepOneTabStop(list) {
  const rows = [...list.querySelectorAll('button')];
  const stops = rows.filter((row) => row.getAttribute('tabindex') === '0');
  const stop = rows.find((row) => row === document.activeElement) ?? stops[0] ?? rows[0];
  for (const row of stops) row.setAttribute('tabindex', '-1');
  stop?.setAttribute('tabindex', '0');
}

export function moveFocus(list, event) {
  const rows = [...list.querySelectorAll('button')];
  const at = rows.indexOf(document.activeElement);
  const to = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: rows.length - 1 }[event.key];
  if (to === undefined || at < 0 || !rows[to]) return;
  event.preventDefault();
  rows[at].setAttribute('tabindex', '-1');
  rows[to].setAttribute('tabindex', '0');
  rows[to].focus();
}
