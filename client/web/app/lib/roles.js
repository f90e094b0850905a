// What each role may do, so that the console hides what the server would refuse. The server decides
// (db/service/requests/requests.cpp).

const kStaff = ['instructor', 'curriculum-manager', 'administrator'];
const kManagers = ['curriculum-manager', 'administrator'];

/** @type {Record<string, string[]>} */
const kRules = {
  'see own': ['trainee'],
  'see people': kStaff,
  'edit people': kManagers,
  'export person': kManagers,
  'erase person': ['administrator'],
  'see profiles': kStaff,
  'edit profiles': kManagers,
  'see courses': kStaff,
  'edit courses': kManagers,
  assign: kStaff,
  'see results': kStaff,
  'see sessions': [...kStaff, 'trainee'],
  'assign sessions': kManagers,
  annotate: ['instructor', 'administrator'],
  'set reference': kStaff,
  rescore: kStaff,
  excuse: kStaff,
  retention: kManagers,
  'export study': ['administrator', 'researcher'],
  'see live': kStaff,
  'see audit': ['administrator'],
  upkeep: ['administrator'],
  export: [...kStaff, 'researcher'],
  'own account': [...kStaff, 'trainee', 'researcher'],
};

export const kRoles = ['trainee', 'instructor', 'curriculum-manager', 'administrator', 'researcher'];

/** 'CURRICULUM_MANAGER' (as on the wire) and 'curriculum-manager' (as for people) are the same role. */
export function roleName(role) {
  return String(role ?? '')
    .toLowerCase()
    .replaceAll('_', '-');
}

/** @param {string} role @param {string} action a name of the table above */
export function may(role, action) {
  const rule = kRules[action];
  if (!rule) throw new Error(`no rule for '${action}'`);
  return rule.includes(role);
}

/** Roles that `role` may give to others; a manager cannot make researchers or administrators. */
export function grantable(role) {
  if (role === 'administrator') return kRoles;
  return role === 'curriculum-manager' ? ['trainee', 'instructor', 'curriculum-manager'] : [];
}
