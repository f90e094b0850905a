#include "tests/stability/search/shrink.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>

namespace needlelab::test {

int significantDigits(double value) {
  std::array<char, 40> text{};
  const auto* end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::scientific).ptr;
  int digits = 0, upto_last_nonzero = 0;
  for (const char* c = text.data(); c != end && *c != 'e'; ++c) {
    if (*c < '0' || *c > '9') continue;
    ++digits;
    if (*c != '0') upto_last_nonzero = digits;
  }
  return upto_last_nonzero;
}

namespace {

// called with each number in turn, always in the same order; its changes are written back
using NumberVisit = std::function<void(double&)>;

// visits a message's number by value and writes it back
template <typename Message, typename Get, typename Set>
void visit(Message& message, Get get, Set set, const NumberVisit& number) {
  double value = (message.*get)();
  number(value);
  (message.*set)(value);
}

// the optional numbers of a layer
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

// places, tilts and times
void visitStrokes(PassivityGesture& gesture, const NumberVisit& number) {
  visitPlace(gesture.start, number);
  for (PassivityStroke& stroke : gesture.strokes) {
    visitPlace(stroke, number);
    number(stroke.seconds);
  }
}

// numbers of the layers and their membranes
void visitLayers(PassivityGesture& gesture, const NumberVisit& number) {
  for (auto& layer : *gesture.profile.mutable_layers()) visitLayer(layer, number);
}

// both, and the scene's sections that must stay above zero
void visitAll(PassivityGesture& gesture, const NumberVisit& number) {
  visitStrokes(gesture, number);
  visitLayers(gesture, number);
  visitSections(gesture.profile, number);
}

// the distance between two strokes' ends, plus the sum of the changes of their tilts' tangents
double wayBetween(const PassivityStroke& a, const PassivityStroke& b) {
  return norm(Vec3{a.x_m - b.x_m, a.y_m - b.y_m, a.depth_m - b.depth_m});
}

double turnBetween(const PassivityStroke& a, const PassivityStroke& b) {
  return std::abs(a.tilt_x - b.tilt_x) + std::abs(a.tilt_y - b.tilt_y);
}

}  // namespace

double sizeOf(const PassivityGesture& gesture) {
  PassivityGesture copy = gesture;  // the visitors pass references
  double digits = 0, seconds = 0, magnitudes = 0;
  visitAll(copy, [&](double& value) { digits += significantDigits(value); });
  visitStrokes(copy, [&](double& value) { magnitudes += std::min(std::abs(value), 10.0); });
  // changes of direction between strokes make a gesture hard to follow
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

namespace {

// a smaller gesture must also be possible for a hand: outside at both ends, …
bool beginsAndEndsOutside(const PassivityGesture& gesture) {
  constexpr double kOutside_m = -5e-4;
  return !gesture.strokes.empty() && gesture.start.depth_m <= kOutside_m &&
         gesture.strokes.back().depth_m <= kOutside_m;
}

// … and not faster than the original: strokes that are too fast get more time
void giveTime(PassivityGesture& gesture, double most_speed_mps, double most_turn_per_s) {
  const PassivityStroke* before = &gesture.start;
  for (PassivityStroke& stroke : gesture.strokes) {
    const double min_s = std::max(
        {0.02, wayBetween(*before, stroke) / most_speed_mps, turnBetween(*before, stroke) / most_turn_per_s});
    if (stroke.seconds < min_s) stroke.seconds = roundedTo(1.05 * min_s, 2);
    before = &stroke;
  }
}

// the stroke's current purpose, independent of the original one
StrokeKind kindOf(const PassivityStroke& stroke, const PassivityStroke& before) {
  if (stroke.depth_m < 0) return StrokeKind::kExit;
  if (stroke.depth_m > before.depth_m) return StrokeKind::kInsert;
  if (stroke.depth_m < before.depth_m) return StrokeKind::kRetreat;
  if (wayBetween(stroke, before) > 0) return StrokeKind::kAside;
  return turnBetween(stroke, before) > 0 ? StrokeKind::kTilt : StrokeKind::kHold;
}

class Shrinker {
 public:
  Shrinker(const PassivityGesture& gesture, const std::function<bool(const PassivityGesture&)>& fails,
           std::size_t most_tries)
      : fails_(fails), most_tries_(most_tries) {
    best_.gesture = gesture;
    size_ = sizeOf(gesture);
    const PassivityStroke* before = &gesture.start;
    for (const PassivityStroke& stroke : gesture.strokes) {
      most_speed_mps_ = std::max(most_speed_mps_, wayBetween(*before, stroke) / stroke.seconds);
      most_turn_per_s_ = std::max(most_turn_per_s_, turnBetween(*before, stroke) / stroke.seconds);
      before = &stroke;
    }
  }

  ShrinkResult run() {
    for (std::size_t taken_before = 0;; taken_before = best_.taken) {
      removeStrokes();
      removeEffects();
      removeLayers();
      simplify();
      zeroNumbers();
      roundNumbers();
      if (best_.taken == taken_before || best_.tried >= most_tries_) break;
    }
    const PassivityStroke* before = &best_.gesture.start;
    for (PassivityStroke& stroke : best_.gesture.strokes) {
      stroke.kind = kindOf(stroke, *before);
      before = &stroke;
    }
    return best_;
  }

 private:
  // keeps the candidate if it is smaller and still fails
  bool take(PassivityGesture candidate) {
    // a hundredth of a millimetre is the least that a reader can picture
    visitStrokes(candidate, [](double& value) { value = std::abs(value) < 1e-5 ? 0 : value; });
    giveTime(candidate, most_speed_mps_, most_turn_per_s_);
    const double size = sizeOf(candidate);
    if (!(size < size_) || best_.tried >= most_tries_ || !beginsAndEndsOutside(candidate)) return false;
    ++best_.tried;
    if (!fails_(candidate)) return false;
    ++best_.taken;
    best_.gesture = std::move(candidate);
    size_ = size;
    return true;
  }

  // halves, quarters, …, single strokes (Zeller and Hildebrandt's delta debugging, without its complements)
  void removeStrokes() {
    for (std::size_t length = std::max<std::size_t>(best_.gesture.strokes.size() / 2, 1);; length /= 2) {
      for (std::size_t from = 0; from < best_.gesture.strokes.size();) {
        PassivityGesture candidate = best_.gesture;
        const auto first = candidate.strokes.begin() + static_cast<std::ptrdiff_t>(from);
        const std::size_t count = std::min(length, candidate.strokes.size() - from);
        candidate.strokes.erase(first, first + static_cast<std::ptrdiff_t>(count));
        if (!take(candidate)) from += length;
      }
      if (length == 1) return;
    }
  }

  void removeEffects() {
    for (int i = best_.gesture.profile.effects_size() - 1; i >= 0; --i) {
      PassivityGesture candidate = best_.gesture;
      auto& effects = *candidate.profile.mutable_effects();
      effects.erase(effects.begin() + i);
      take(candidate);
    }
  }

  void removeLayers() {
    for (int i = best_.gesture.profile.layers_size() - 1; i >= 0; --i) {
      PassivityGesture candidate = best_.gesture;
      auto& layers = *candidate.profile.mutable_layers();
      if (layers.size() > 1) {
        layers.erase(layers.begin() + i);
        if (take(candidate)) continue;
      }
      candidate = best_.gesture;
      candidate.profile.mutable_layers(i)->clear_puncture();
      take(candidate);
    }
  }

  void simplify() {
    const auto tryWith = [&](const auto& change) {
      PassivityGesture candidate = best_.gesture;
      change(candidate);
      take(candidate);
    };
    tryWith([](PassivityGesture& g) {
      g.tremor_m = 0;
      g.tremor_seed = 1;
    });
    tryWith([](PassivityGesture& g) { g.encoder_step_m = 0; });
    tryWith([](PassivityGesture& g) {
      auto& plane = *g.profile.mutable_limb()->mutable_plane();
      plane.mutable_point_m()->set_x(0);
      plane.mutable_point_m()->set_y(0);
      plane.mutable_point_m()->set_z(0);
      plane.mutable_normal()->set_x(0);
      plane.mutable_normal()->set_y(0);
      plane.mutable_normal()->set_z(1);
    });
    tryWith([](PassivityGesture& g) {
      g.profile.mutable_tracking_wall()->set_stop_mode(pb::TrackingWall::RAMP);
    });
    // a stroke in fewer directions: equal to the previous one in one number
    for (std::size_t i = 0; i < best_.gesture.strokes.size(); ++i)
      for (double PassivityStroke::*member : {&PassivityStroke::x_m, &PassivityStroke::y_m,
                                              &PassivityStroke::tilt_x, &PassivityStroke::tilt_y}) {
        PassivityGesture candidate = best_.gesture;
        const PassivityStroke& before = i == 0 ? candidate.start : candidate.strokes[i - 1];
        candidate.strokes[i].*member = before.*member;
        take(candidate);
      }
  }

  // tries every number in turn: `change` gives the next value to try instead, or false when none is left
  template <typename Change>
  void eachNumber(void (*visitor)(PassivityGesture&, const NumberVisit&), const Change& change) {
    std::size_t count = 0;
    visitor(best_.gesture, [&](double&) { ++count; });
    for (std::size_t wanted = 0; wanted < count; ++wanted) {
      for (int attempt = 0;; ++attempt) {
        PassivityGesture candidate = best_.gesture;
        std::size_t at = 0;
        bool more = false;
        visitor(candidate, [&](double& value) {
          if (at++ == wanted) more = change(attempt, value);
        });
        if (!more || take(candidate)) break;
      }
    }
  }

  void zeroNumbers() {
    const auto zero = [](int attempt, double& value) {
      value = 0;
      return attempt == 0;
    };
    eachNumber(visitStrokes, zero);
    eachNumber(visitLayers, zero);
  }

  void roundNumbers() {
    // shorter, shallower, less sideways: or the same number with fewer digits
    eachNumber(visitStrokes, [](int attempt, double& value) {
      static constexpr std::array<double, 6> kFactors = {0.5, 1, 1.5, 2, 0.75, 1};
      static constexpr std::array<int, 6> kDigits = {1, 1, 1, 1, 2, 2};
      if (attempt >= 6) return false;
      value = roundedTo(value * kFactors[static_cast<std::size_t>(attempt)],
                        kDigits[static_cast<std::size_t>(attempt)]);
      return true;
    });
    eachNumber(visitAll, [](int attempt, double& value) {
      value = roundedTo(value, attempt + 1);
      return attempt < 2;
    });
  }

  const std::function<bool(const PassivityGesture&)>& fails_;
  std::size_t most_tries_;
  ShrinkResult best_;
  double size_;
  double most_speed_mps_ = 1e-3, most_turn_per_s_ = 1e-3;  // mean speed, of a stroke of the original gesture
};

}  // namespace

ShrinkResult shrunk(const PassivityGesture& gesture,
                    const std::function<bool(const PassivityGesture&)>& fails, std::size_t most_tries) {
  return Shrinker(gesture, fails, most_tries).run();
}

}  // namespace needlelab::test
