/// A valid profile as text, in the form of db/samples, with every section and every kind of hazard.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace needlelab {

inline const std::string kGoodProfile = R"({
 "id": "shoulder-adult", "name": "Shoulder, adult, median", "axial_model": "ENHANCED_TRACKING_WALL",
 "needle": {"length_m": 0.06},
 "limb": {"plane": {"point_m": {"x": 0, "y": 0, "z": 0}, "normal": {"x": 0, "y": 0, "z": 1}}},
 "layers": [
  {"tissue": "SKIN", "thickness_m": 0.003, "cutting_force_n": 1.0, "attracted_force_n": 0.4, "rejection_force_n": 0.1,
   "lateral_stiffness_n_per_m2": 9000, "friction_n_per_m": 18,
   "puncture": {"linear_n_per_m": 200, "quadratic_n_per_m2": 20000, "force_n": 0.6}},
  {"tissue": "MUSCLE", "thickness_m": 0.02, "cutting_force_n": 2.0, "attracted_force_n": 0.5}],
 "tracking_wall": {"stiffness_n_per_m": 500, "stop_speed_m_s": 0.003, "stop_dwell_s": 0.05, "stop_duration_s": 0.8,
  "stop_mode": "EXPONENTIAL", "relax_time_s": 1.9, "relax_residual": 0.75},
 "virtual_fixture": {"max_stiffness_n_per_m": 400, "max_force_n": 4, "mode": "PROPORTIONAL"},
 "orientation_limit": {"stiffness_nm_per_rad": 0.5, "max_torque_nm": 0.2},
 "shaft_friction": {"stiffness_n_per_m": 140}, "max_force_n": 10,
 "targets": [{"name": "joint space", "center_m": {"x": 0, "y": 0, "z": -0.03}, "radius_m": 0.003}],
 "hazards": [
  {"name": "humeral head", "kind": "BONE", "center_m": {"x": 0.02, "y": 0, "z": -0.04}, "radius_m": 0.012},
  {"name": "axillary nerve", "kind": "NERVE", "a_m": {"x": -0.02, "y": -0.03, "z": -0.03},
   "b_m": {"x": -0.02, "y": 0.03, "z": -0.03}, "radius_m": 0.002}],
 "effects": ["CUTTING", "ATTRACTED", "CLAMPING", "ORIENTATION_LIMIT", "SHAFT_FRICTION", "PUNCTURE"],
 "description": "For tests.\nTwo lines, and Größe in UTF-8.", "sources": "set by hand"})";

/// The same profile with a section for every axial model.
inline const std::string kGoodModels = [] {
  nlohmann::json tree = nlohmann::json::parse(kGoodProfile);
  tree.update(nlohmann::json::parse(R"({
   "axial_model": "DIRECT", "effects": ["CUTTING", "ATTRACTED"],
   "direct": {"stiffness_n_per_m": 450, "step_at_layers": false},
   "voigt": {"stiffness_n_per_m": 350.5, "damping_ns_per_m": 2},
   "god_object": {"stiffness_n_per_m": 333},
   "statistical": {
    "table": [{"depth_m": 0, "mean_n": 0, "sd_n": 0}, {"depth_m": 0.004, "mean_n": 2, "sd_n": 0.5}],
    "correlation_length_m": 0.002, "seed": 4294967295, "factors": {"mean": 1.2, "thickness": 0.9},
    "source": "nobody measured it", "synthetic": ["sd_n", "factors"]},
   "precomputed": {
    "table": [{"depth_m": 0.001, "cutting_n": 1, "attracted_n": 0.3},
              {"depth_m": 0.02, "cutting_n": 2.5, "attracted_n": 0}], "source": "by hand"},
   "fem": {"nodes": 2000, "layers": [
    {"young_pa": 20000, "poisson": 0.45, "friction_n_per_m": 18, "cutting_n": 1},
    {"young_pa": 10000, "poisson": 0.49, "friction_n_per_m": 0, "cutting_n": 2}]}})"));
  for (auto& layer : tree["layers"])
    layer["first_order"] = nlohmann::json::parse(R"({"stiffness_n_per_m": 400, "puncture_force_n": 0.8,
                                                     "cutting_force_n": 0.3, "friction_n_per_m": 20})");
  for (auto& layer : tree["layers"])
    layer["okamura"] = nlohmann::json::parse(R"({"linear_n_per_m": 100, "quadratic_n_per_m2": 30000,
      "puncture_force_n": 0.7, "cutting_force_n": 0.4, "kinetic_in_n_per_m": 12, "kinetic_out_n_per_m": 11,
      "static_in_n_per_m": 19, "static_out_n_per_m": 18, "viscous_in_ns_per_m2": 290, "viscous_out_ns_per_m2": 210})");
  return tree.dump();
}();

inline const std::string kGoodCurriculum = R"({
 "id": "basics", "name": "Basics", "description": "For tests.",
 "exercises": [
  {"id": "one", "name": "First", "profile_id": "shoulder-adult", "time_limit_s": 60,
   "requirements": [{"measure": "peak_force_n", "max": 5}, {"measure": "target_reached", "min": 1, "max": 1}]},
  {"id": "two", "name": "Second", "profile_id": "shoulder-adult"}]})";

/// Returns `text` with the value at `pointer` (e.g. "/layers/0/thickness_m") replaced by the JSON `value`, or
/// erased if `value` is empty. Adds the value if it is missing.
inline std::string mutated(const std::string& text, const std::string& pointer, const std::string& value) {
  nlohmann::json tree = nlohmann::json::parse(text);
  const nlohmann::json::json_pointer where(pointer);
  if (value.empty()) {
    nlohmann::json& parent = tree.at(where.parent_pointer());
    if (parent.is_array()) {
      parent.erase(std::stoul(where.back()));
    } else {
      parent.erase(where.back());
    }
  } else {
    tree[where] = nlohmann::json::parse(value);
  }
  return tree.dump();
}

}  // namespace needlelab
