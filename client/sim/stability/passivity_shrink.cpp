#include "client/sim/stability/passivity_shrink.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "client/sim/stability/gesture_numbers.h"
#include "client/sim/stability/round_number.h"

namespace needlelab {
namespace {

// a smaller gesture is one that a hand could make too: outside at both ends, …
bool beginsAndEndsOutside(const PassivityGesture& gesture) {
  constexpr double kOutside_m = -5e-4;
  return !gesture.strokes.empty() && gesture.start.depth_m <= kOutside_m &&
         gesture.strokes.back().depth_m <= kOutside_m;
}

// … and no faster than the one that came in: strokes that are get the time that they need
void giveTime(PassivityGesture& gesture, double most_speed_mps, double most_turn_per_s) {
  const PassivityStroke* before = &gesture.start;
  for (PassivityStroke& stroke : gesture.strokes) {
    const double least_s = std::max(
        {0.02, wayBetween(*before, stroke) / most_speed_mps, turnBetween(*before, stroke) / most_turn_per_s});
    if (stroke.seconds < least_s) stroke.seconds = roundedTo(1.05 * least_s, 2);
    before = &stroke;
  }
}

// what a stroke does now, whatever it was drawn for
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
  // keeps the candidate when it is smaller and still fails
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
    // a stroke along fewer directions: as the one before it in one number
    for (std::size_t i = 0; i < best_.gesture.strokes.size(); ++i)
      for (double PassivityStroke::*member : {&PassivityStroke::x_m, &PassivityStroke::y_m,
                                              &PassivityStroke::tilt_x, &PassivityStroke::tilt_y}) {
        PassivityGesture candidate = best_.gesture;
        const PassivityStroke& before = i == 0 ? candidate.start : candidate.strokes[i - 1];
        candidate.strokes[i].*member = before.*member;
        take(candidate);
      }
  }

  // asks for every number in turn: `change` gives what to try in its place, false when there is no more
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
    // shorter, shallower, less aside: or the same number with fewer digits
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
  double most_speed_mps_ = 1e-3, most_turn_per_s_ = 1e-3;  // mean, of a stroke of the gesture that came in
};

}  // namespace

ShrinkResult shrunk(const PassivityGesture& gesture,
                    const std::function<bool(const PassivityGesture&)>& fails, std::size_t most_tries) {
  return Shrinker(gesture, fails, most_tries).run();
}

}  // namespace needlelab
