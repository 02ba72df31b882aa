// Where the zone's pictures are, and what it says of one that does not come.

import { addressOf } from '../address.js';

const OWN = /^\/images\/[0-9a-f]{64}(\?zone=[A-Za-z0-9._-]{1,64})?$/;

/** Only the server's own pictures: a path of /images with a content hash, at a region with the zone
 * that has it; null for anything else. */
export function pictureAddress(path) {
  return typeof path === 'string' && OWN.test(path) ? addressOf(path) : null;
}

/** The zone makes one picture after the other, and sends away whom it keeps waiting. */
const RETRY_MS = 2000;
const COMING = 'The zone is busy: the picture comes in a moment';
const GONE = 'The picture is no longer kept';
const BROKEN = 'The picture cannot be shown';

/** What the zone says of a picture: an HTTP status, 0 for no answer. */
async function statusOf(url) {
  try {
    return (await fetch(url, { method: 'HEAD', credentials: 'same-origin' })).status;
  } catch (failure) {
    return 0;
  }
}

/** Asks for a picture that did not come, until the zone has it (true), has it no more (false), or
 * `isWanted()` no longer says so (false). `say(text)` tells how it stands. `wasThere`: the zone had it
 * before, and it could not be shown. */
export async function awaitPicture(url, wasThere, isWanted, say) {
  for (;;) {
    const status = await statusOf(url);
    if (!isWanted()) return false;
    if (status === 404 || (status === 200 && wasThere)) {
      say(status === 404 ? GONE : BROKEN);
      return false;
    }
    if (status === 200) return true;
    say(COMING);
    await new Promise((resolve) => { setTimeout(resolve, RETRY_MS); });
    if (!isWanted()) return false;
  }
}
