// The effects of a scene, as the editor shows them. Made by haptics_test from the rows in
// common/haptics/effects; not to be edited (tests/unit/common/haptics/effects/console_effects_test.cpp).
// prettier-ignore
export const kEffects = [
  { name: 'CUTTING', label: 'Cutting: what resists the needle on its way in', title: 'Cutting' },
  { name: 'ATTRACTED', label: 'Attraction: what holds the needle on its way out', title: 'Attracted' },
  { name: 'CLAMPING', label: 'Clamping: what keeps the needle on its line', title: 'Clamping',
    section: 'virtual_fixture', fields: [['max_stiffness_n_per_m', 'Greatest stiffness'], ['max_force_n', 'Greatest clamping force']],
    choice: { name: 'mode', label: 'Mode', options: [['CONSERVATIVE', 'Conservative: returns only the energy it took'], ['PROPORTIONAL', 'Proportional: as in the paper']] },
    begin: { max_stiffness_n_per_m: 400, max_force_n: 4, mode: 'CONSERVATIVE' } },
  { name: 'ORIENTATION_LIMIT', label: 'Orientation limit: what resists tilting', title: 'Orientation limit',
    section: 'orientation_limit', fields: [['stiffness_nm_per_rad', 'Rotational stiffness'], ['max_torque_nm', 'Greatest torque']],
    begin: { stiffness_nm_per_rad: 0.5, max_torque_nm: 0.2 } },
  { name: 'SHAFT_FRICTION', label: 'Shaft friction', title: 'Shaft friction',
    section: 'shaft_friction', fields: [['stiffness_n_per_m', 'Friction stiffness']],
    begin: { stiffness_n_per_m: 140 } },
  { name: 'PUNCTURE', label: 'Puncture: membranes that give way', title: 'Puncture' },
  { name: 'CUT_MEMORY', label: 'Cut memory: cut tissue stays cut', title: 'Cut memory',
    section: 'cut_memory', fields: [['cutting_share', 'Share of the cutting force along a cut'], ['radius_m', 'Radius of a cut']],
    begin: { cutting_share: 0.23, radius_m: 0.001 } },
  { name: 'BONE', label: 'Bone: a stiff surface that no needle enters', title: 'Bone',
    section: 'bone', fields: [['stiffness_n_per_m', 'Stiffness of the bone'], ['friction_coefficient', 'Friction along the bone']],
    begin: { stiffness_n_per_m: 600, friction_coefficient: 0.3 } },
  { name: 'HUB', label: 'Hub: stops a needle that is in to its hub', title: 'Hub',
    section: 'hub', fields: [['stiffness_n_per_m', 'Stiffness of the skin under the hub']],
    begin: { stiffness_n_per_m: 300 } },
];
