// The states of a hazard that is on the map, and how they read for people.

export const STATES = [
  { name: 'candidate', label: 'Unconfirmed', meaning: 'Drivers are not told yet' },
  { name: 'active', label: 'Active', meaning: 'Drivers are told' },
  { name: 'verifying', label: 'Being checked', meaning: 'Passing vehicles are asked' },
];

/** Off the map; officials may look at them. */
export const REJECTED = {
  name: 'rejected',
  label: 'Rejected',
  meaning: 'Taken off the map by an official: drivers are not told',
};

const GONE = { name: 'gone', label: 'Gone', meaning: 'No longer on the map' };
const ALL = [...STATES, REJECTED, GONE];

export function stateLabel(name) {
  return ALL.find((state) => state.name === name)?.label ?? name;
}

export function stateMeaning(name) {
  return ALL.find((state) => state.name === name)?.meaning ?? '';
}
