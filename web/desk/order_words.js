// How a work order reads: its state, what is next, to whom its hazard is assigned.

import { ago } from '../format.js';

export const ORDER_STATES = ['waiting', 'sent', 'closed', 'failed', 'cancelled'];

const STATE_LABELS = { waiting: 'Waiting', sent: 'Sent', closed: 'Closed', failed: 'Failed',
  cancelled: 'Cancelled' };

/** The label of a state by itself, as for a filter. */
export function orderStateLabel(state) {
  return STATE_LABELS[state] ?? state;
}

/** A recipient that gives an order a number of its own has it open. */
export function orderState({ state, reference }) {
  return state === 'sent' && reference !== null ? 'Open at the recipient' : orderStateLabel(state);
}

/** What is next, or what was last: "Next attempt in 5 min." */
export function orderTurn(order) {
  const { state, attempts, next_attempt: next, sent, closed, closed_by: by } = order;
  const at = (time) => ago(Date.parse(time));
  if (state === 'waiting') {
    const when = Date.parse(next) <= Date.now() ? 'now' : at(next);
    return attempts === 0 ? `To be sent ${when}` : `Next attempt ${when}`;
  }
  if (state === 'sent') return `Taken ${at(sent)}`;
  if (state === 'closed') return `Closed ${at(closed)}${by === null ? '' : ` by ${by}`}`;
  if (state === 'failed') return `Given up after ${attempts} ${attempts === 1 ? 'attempt' : 'attempts'}`;
  return 'Never sent: the hazard was taken back';
}

/** "Roads north, due 2026-12-01"; of nobody's hazard "nobody". */
export function assignmentText({ team, due, overdue }) {
  if (team === null) return 'nobody';
  if (due === null) return team;
  return `${team}, ${overdue ? 'overdue since' : 'due'} ${due}`;
}
