// The greatest value, in SI, of each number field of profiles and courses, and the fields of whole numbers. Made from
// proto/needlelab/profile.proto; not to be edited (tests/web/ranges.test.mjs).
// prettier-ignore
export const kMost = {
  x: 1000, y: 1000, z: 1000, length_m: 1, gauge: 34, outer_diameter_m: 0.005, bevel_angle_rad: 1.5, radius_m: 1,
  linear_n_per_m: 100000, quadratic_n_per_m2: 1000000000, force_n: 50, stiffness_n_per_m: 10000, puncture_force_n: 50,
  cutting_force_n: 50, friction_n_per_m: 10000, kinetic_in_n_per_m: 10000, kinetic_out_n_per_m: 10000,
  static_in_n_per_m: 10000, static_out_n_per_m: 10000, viscous_in_ns_per_m2: 100000, viscous_out_ns_per_m2: 100000,
  damping_ns_per_m: 1000, depth_m: 1, mean_n: 50, sd_n: 50, mean: 10, thickness: 10, correlation_length_m: 1,
  cutting_n: 50, attracted_n: 50, young_pa: 1000000000, poisson: 0.49, nodes: 200000, thickness_m: 1,
  attracted_force_n: 50, rejection_force_n: 50, lateral_stiffness_n_per_m2: 10000000, wall_stiffness_n_per_m: 10000,
  radius_a_m: 1, radius_b_m: 1, blend_m: 0.1, from_m: 1, to_m: 1, pulse_m: 0.01, stop_speed_m_s: 0.1,
  stop_dwell_s: 10, stop_duration_s: 10, relax_time_s: 60, relax_residual: 1, max_stiffness_n_per_m: 10000,
  max_force_n: 50, stiffness_nm_per_rad: 100, max_torque_nm: 5, cutting_share: 1, friction_coefficient: 2,
  skin_stiffness_n_per_m: 10000, bone_stiffness_n_per_m: 10000, stiffening_share: 1, offset_m: 1, time_limit_s: 86400,
  attempts: 1000, due_unix_ms: 9200000000000, target_dwell_s: 600, results_from_unix_ms: 9200000000000,
};
export const kWhole = ['gauge', 'nodes', 'attempts'];
