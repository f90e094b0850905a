#include "client/sim/stability/gesture_numbers.h"

#include <algorithm>
#include <cmath>

#include "client/sim/stability/round_number.h"

namespace needlelab {
namespace {

// a number of a message, by value and back
template <typename Message, typename Get, typename Set>
void visit(Message& message, Get get, Set set, const NumberVisit& number) {
  double value = (message.*get)();
  number(value);
  (message.*set)(value);
}

// the numbers that a layer can do without
void visitLayer(pb::Layer& layer, const NumberVisit& number) {
  using L = pb::Layer;
  visit(layer, &L::thickness_m, &L::set_thickness_m, number);
  visit(layer, &L::cutting_force_n, &L::set_cutting_force_n, number);
  visit(layer, &L::attracted_force_n, &L::set_attracted_force_n, number);
  visit(layer, &L::rejection_force_n, &L::set_rejection_force_n, number);
  visit(layer, &L::lateral_stiffness_n_per_m2, &L::set_lateral_stiffness_n_per_m2, number);
  visit(layer, &L::friction_n_per_m, &L::set_friction_n_per_m, number);
  if (!layer.has_puncture()) return;
  using P = pb::Puncture;
  visit(*layer.mutable_puncture(), &P::linear_n_per_m, &P::set_linear_n_per_m, number);
  visit(*layer.mutable_puncture(), &P::quadratic_n_per_m2, &P::set_quadratic_n_per_m2, number);
  visit(*layer.mutable_puncture(), &P::force_n, &P::set_force_n, number);
}

// numbers that must stay above zero: rounded, never made 0
void visitSections(pb::Profile& profile, const NumberVisit& number) {
  using W = pb::TrackingWall;
  visit(*profile.mutable_needle(), &pb::Needle::length_m, &pb::Needle::set_length_m, number);
  auto& wall = *profile.mutable_tracking_wall();
  visit(wall, &W::stiffness_n_per_m, &W::set_stiffness_n_per_m, number);
  visit(wall, &W::stop_speed_m_s, &W::set_stop_speed_m_s, number);
  visit(wall, &W::stop_dwell_s, &W::set_stop_dwell_s, number);
  visit(wall, &W::stop_duration_s, &W::set_stop_duration_s, number);
  visit(wall, &W::relax_time_s, &W::set_relax_time_s, number);
  visit(wall, &W::relax_residual, &W::set_relax_residual, number);
  if (profile.has_virtual_fixture()) {
    using F = pb::VirtualFixture;
    auto& fixture = *profile.mutable_virtual_fixture();
    visit(fixture, &F::max_stiffness_n_per_m, &F::set_max_stiffness_n_per_m, number);
    visit(fixture, &F::max_force_n, &F::set_max_force_n, number);
  }
  if (profile.has_orientation_limit()) {
    using O = pb::OrientationLimit;
    auto& limit = *profile.mutable_orientation_limit();
    visit(limit, &O::stiffness_nm_per_rad, &O::set_stiffness_nm_per_rad, number);
    visit(limit, &O::max_torque_nm, &O::set_max_torque_nm, number);
  }
  if (profile.has_shaft_friction()) {
    using S = pb::ShaftFriction;
    visit(*profile.mutable_shaft_friction(), &S::stiffness_n_per_m, &S::set_stiffness_n_per_m, number);
  }
}

void visitPlace(PassivityStroke& stroke, const NumberVisit& number) {
  for (double* value : {&stroke.x_m, &stroke.y_m, &stroke.depth_m, &stroke.tilt_x, &stroke.tilt_y})
    number(*value);
}

}  // namespace

void visitStrokes(PassivityGesture& gesture, const NumberVisit& number) {
  visitPlace(gesture.start, number);
  for (PassivityStroke& stroke : gesture.strokes) {
    visitPlace(stroke, number);
    number(stroke.seconds);
  }
}

void visitLayers(PassivityGesture& gesture, const NumberVisit& number) {
  for (auto& layer : *gesture.profile.mutable_layers()) visitLayer(layer, number);
}

void visitAll(PassivityGesture& gesture, const NumberVisit& number) {
  visitStrokes(gesture, number);
  visitLayers(gesture, number);
  visitSections(gesture.profile, number);
}

double wayBetween(const PassivityStroke& a, const PassivityStroke& b) {
  return norm(Vec3{a.x_m - b.x_m, a.y_m - b.y_m, a.depth_m - b.depth_m});
}

double turnBetween(const PassivityStroke& a, const PassivityStroke& b) {
  return std::abs(a.tilt_x - b.tilt_x) + std::abs(a.tilt_y - b.tilt_y);
}

double sizeOf(const PassivityGesture& gesture) {
  PassivityGesture copy = gesture;  // the visitors hand out references
  double digits = 0, seconds = 0, magnitudes = 0;
  visitAll(copy, [&](double& value) { digits += significantDigits(value); });
  visitStrokes(copy, [&](double& value) { magnitudes += std::min(std::abs(value), 10.0); });
  // directions that change from stroke to stroke are what makes a gesture hard to follow
  double changes = 0;
  const PassivityStroke* before = &gesture.start;
  for (const PassivityStroke& stroke : gesture.strokes) {
    seconds += stroke.seconds;
    for (double PassivityStroke::*member :
         {&PassivityStroke::x_m, &PassivityStroke::y_m, &PassivityStroke::tilt_x, &PassivityStroke::tilt_y})
      changes += stroke.*member != before->*member;
    before = &stroke;
  }
  double membranes = 0;
  for (const auto& layer : gesture.profile.layers()) membranes += layer.has_puncture();
  return 1000.0 * static_cast<double>(gesture.strokes.size()) + 400.0 * gesture.profile.effects_size() +
         300.0 * gesture.profile.layers_size() + 100.0 * membranes + 50.0 * changes +
         50.0 * (gesture.tremor_m > 0) + 50.0 * (gesture.encoder_step_m > 0) +
         100.0 * !gesture.profile.limb().has_plane() +
         30.0 * (gesture.profile.tracking_wall().stop_mode() != pb::TrackingWall::RAMP) + 10 * seconds +
         digits + 5 * magnitudes;
}

}  // namespace needlelab
