// Measures by what pages look for them. Made by scoring_test from common/scoring/measures/measure_rows.cpp;
// not to be edited (tests/unit/common/scoring/measures/console_measures_test.cpp).
// prettier-ignore
export const kMeasures = {
  time: 'needle_time_s',
  force: 'peak_force_n',
  speed: 'peak_speed_m_s',
  depth: 'greatest_depth_m',
  own_line: 'largest_lateral_error_m',
  planned_line: 'largest_planned_line_error_m',
  target: 'target_reached',
  hazard: 'hazards_touched',
  bone: 'bone_contacts',
  hub: 'hub_contacts',
  expert_path: 'dtw_distance_m',
  shares: ['injected_share', 'injected_in_target_share'],
  yes_or_no: ['ends_in_tissue', 'target_reached', 'aspirated_before_injection'],
  need_plan: ['planned_entry_error_m', 'planned_angle_error_rad', 'mean_planned_line_error_m', 'largest_planned_line_error_m'],
};
