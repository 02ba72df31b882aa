// The states of a hazard that is on the map, and how they read for people.

export const STATES = [
  { name: 'candidate', label: 'Unconfirmed', meaning: 'Drivers are not told yet' },
  { name: 'active', label: 'Active', meaning: 'Drivers are told' },
  { name: 'verifying', label: 'Being checked', meaning: 'Passing vehicles are asked' },
];

const OFF_MAP = { gone: 'Gone', rejected: 'Rejected' };

export function stateLabel(name) {
  return STATES.find((state) => state.name === name)?.label ?? OFF_MAP[name] ?? name;
}

export function stateMeaning(name) {
  return STATES.find((state) => state.name === name)?.meaning ?? '';
}
