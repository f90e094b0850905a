// The axial models, as the editor shows them. Made by haptics_test from the rows in
// common/haptics/models; not to be edited (tests/unit/common/haptics/models/console_models_test.cpp).
// prettier-ignore
export const kModels = [
  { name: 'ENHANCED_TRACKING_WALL', label: 'Enhanced tracking wall', follows_layers: true },
  { name: 'TRACKING_WALL', label: 'Tracking wall', follows_layers: true },
  { name: 'DIRECT', label: 'Direct',
    section: 'direct', fields: [['stiffness_n_per_m', 'Stiffness (Direct)']] },
  { name: 'VOIGT', label: 'Voigt',
    section: 'voigt', fields: [['stiffness_n_per_m', 'Stiffness (Voigt)'], ['damping_ns_per_m', 'Damping (Voigt)']] },
  { name: 'GOD_OBJECT', label: 'God object',
    section: 'god_object', fields: [['stiffness_n_per_m', 'Stiffness (God object)']] },
  { name: 'FIRST_ORDER', label: 'First order',
    layer_section: 'first_order', fields: [['stiffness_n_per_m', 'Stiffness (first order)'], ['puncture_force_n', 'Puncture force (first order)'], ['cutting_force_n', 'Cutting force (first order)'], ['friction_n_per_m', 'Friction (first order)']] },
  { name: 'STATISTICAL', label: 'Statistical', table: true },
  { name: 'PRECOMPUTED', label: 'Precomputed', table: true },
  { name: 'FEM', label: 'Finite elements', table: true },
  { name: 'OKAMURA', label: 'Okamura (Karnopp friction)',
    layer_section: 'okamura', fields: [['linear_n_per_m', 'Stiffness (Okamura)'], ['quadratic_n_per_m2', 'Stiffening (Okamura)'], ['puncture_force_n', 'Puncture force (Okamura)'], ['cutting_force_n', 'Cutting force (Okamura)'], ['kinetic_in_n_per_m', 'Kinetic friction in'], ['kinetic_out_n_per_m', 'Kinetic friction out'], ['static_in_n_per_m', 'Static friction in'], ['static_out_n_per_m', 'Static friction out'], ['viscous_in_ns_per_m2', 'Viscous friction in'], ['viscous_out_ns_per_m2', 'Viscous friction out']] },
  { name: 'DAHL', label: 'Dahl (Kim and Lee)',
    layer_section: 'okamura', fields: [['linear_n_per_m', 'Stiffness (Okamura)'], ['quadratic_n_per_m2', 'Stiffening (Okamura)'], ['puncture_force_n', 'Puncture force (Okamura)'], ['cutting_force_n', 'Cutting force (Okamura)'], ['kinetic_in_n_per_m', 'Kinetic friction in'], ['kinetic_out_n_per_m', 'Kinetic friction out'], ['static_in_n_per_m', 'Static friction in'], ['static_out_n_per_m', 'Static friction out'], ['viscous_in_ns_per_m2', 'Viscous friction in'], ['viscous_out_ns_per_m2', 'Viscous friction out']] },
];
