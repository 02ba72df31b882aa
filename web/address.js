// Where the zone's server is for this page. A reverse proxy may serve the page under any path
// ("/livemap/"), so every address that the server states ("/api/v1/config") is taken below the
// folder that this file came from.

const BASE = new URL('.', import.meta.url);

/** The address in the browser of `path`, an address of the server that begins with a slash. */
export function addressOf(path) {
  return new URL(`.${path}`, BASE).href;
}

/** As addressOf, for a WebSocket. */
export function streamAddressOf(path) {
  return addressOf(path).replace(/^http/, 'ws');
}

/** What this page keeps in the browser is under this name: a proxy may serve several zones. */
export function storageKey(name) {
  return `${name} ${BASE.pathname}`;
}
