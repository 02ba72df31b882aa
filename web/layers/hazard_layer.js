// How hazards look on the map: an icon per class, and rings that show the mix of classes where they
// are dense.

import { plural } from '../format.js';
import { PLAIN, hazardOf } from '../hazard_record.js';
import { stateLabel } from '../hazard_state.js';
import { SignLayer } from './sign_layer.js';
import { getJson } from '../zone_lists.js';

/** The colours around a ring, by the classes' shares, as CSS. A gradient is one element where arcs of
 * SVG would be ten, and a map has a hundred rings. */
function arcs(shares, count) {
  let start = 0;
  return `conic-gradient(${shares.map(([colour, amount]) => {
    const from = start;
    start += (360 * amount) / count;
    return `${colour} ${from.toFixed(1)}deg ${start.toFixed(1)}deg`;
  }).join(', ')})`;
}

function shortCount(count) {
  return count < 10000 ? count.toLocaleString('en') : `${Math.round(count / 1000)}k`;
}

/** What a ring holds, in words that contain what it shows: who speaks to the browser says that. */
function countInWords(count) {
  const words = plural(count, 'hazard');
  return words.startsWith(shortCount(count)) ? words : `${shortCount(count)}: ${words}`;
}

function lookOf(catalogue, content, row) {
  return {
    offset: [0, -30],
    colour: ({ className }) => catalogue.colour(className),
    popup: content,
    load: async (id) => hazardOf(await getJson(`/api/v1/hazards/${id}`)),
    row,
    many: (count) => plural(count, 'hazard'),

    sign({ className, label, state }) {
      return {
        name: state === 'active' ? label : `${label}, ${stateLabel(state).toLowerCase()}`,
        className: 'pin', iconSize: [34, 42], iconAnchor: [17, 40],
        build(node) {
          node.dataset.state = state;
          node.style.setProperty('--colour', catalogue.colour(className));
          node.append(catalogue.badge(className, state));
        },
      };
    },

    ring({ count, shares }) {
      const size = count < 10 ? 38 : count < 100 ? 44 : count < 1000 ? 50 : 58;
      const named = shares.map(([group, amount]) => [catalogue.group(group), amount]);
      const [most, amount] = named[0];
      const name = named.length === 1 ? `${countInWords(count)}: ${most.label}`
        : `${countInWords(count)}, ${amount.toLocaleString('en')} of them: ${most.label}`;
      return {
        name, className: 'cluster', iconSize: [size, size],
        build(node) {
          node.style.setProperty('--arcs', arcs(byColour(named), count));
          node.append(shortCount(count));
        },
      };
    },
  };
}

/** Classes of one colour share an arc; only colours as the server writes them come into the style. */
function byColour(named) {
  const shares = new Map();
  for (const [group, amount] of named) {
    const colour = /^#[0-9a-f]{6}$/i.test(group.colour) ? group.colour : PLAIN;
    shares.set(colour, (shares.get(colour) ?? 0) + amount);
  }
  return [...shares];
}

export class HazardLayer extends SignLayer {
  /** `content(hazard)` answers the popup's, `row(hazard)` that of a line in a list. */
  constructor(map, data, catalogue, content, row, coveredHeight) {
    super(map, data, 'hazards', lookOf(catalogue, content, row), coveredHeight);
  }
}
