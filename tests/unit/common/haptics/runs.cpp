#include "tests/unit/common/haptics/runs.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "tests/support/reference/reference_engine.h"

namespace needlelab::test {
namespace {

// Collects the differences in one tick.
class Difference {
 public:
  void number(const char* name, double engine, double reference, double tolerance) {
    if (std::isnan(engine) && std::isnan(reference)) return;
    if (std::abs(engine - reference) <= tolerance) return;  // false if one of them is NaN
    text_ << "  " << name << ": engine " << engine << ", reference " << reference << ", off by "
          << engine - reference << "\n";
  }
  void vector(const char* name, Vec3 engine, Vec3 reference, double tolerance) {
    number(name, engine.x, reference.x, tolerance);
    number(name, engine.y, reference.y, tolerance);
    number(name, engine.z, reference.z, tolerance);
  }
  void whole(const char* name, std::int64_t engine, std::int64_t reference) {
    if (engine != reference)
      text_ << "  " << name << ": engine " << engine << ", reference " << reference << "\n";
  }
  [[nodiscard]] std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

// Where the cone limits a turn, FORCE_MODEL.md, "Clamping" requires only 1e-12 rad per tick, and sliding
// along the cone amplifies that by the ratio of lengths: two correct results then agree to about 1e-8 N, so
// the limit is 1e-6 N. Everywhere else it is 1e-9 N.
std::string differences(const StepReport& a, const StepReport& b, const ReferenceEngine& reference) {
  const double more = reference.coneBoundTicks() > 0 ? 1e-6 : 0.0, more_m = 1e-2 * more;
  const std::uint32_t undecided = reference.undecidedFlags();
  Difference d;
  d.vector("force_N", a.wrench_W.force_N, b.wrench_W.force_N, 1e-9 + more);
  d.vector("torque_Nm", a.wrench_W.torque_Nm, b.wrench_W.torque_Nm, 1e-9 + more);
  d.vector("p_wall_W_m", a.p_wall_W_m, b.p_wall_W_m, 1e-11 + more_m);
  d.whole("phase", static_cast<int>(a.phase), static_cast<int>(b.phase));
  d.whole("layer", a.layer, b.layer);
  d.number("depth_m", a.depth_m, b.depth_m, 1e-12);
  d.number("insertion_m", a.insertion_m, b.insertion_m, 1e-11 + more_m);
  d.number("speed_mps", a.speed_mps, b.speed_mps, 1e-8 + 100 * more_m);
  d.number("lateral_error_m", a.lateral_error_m, b.lateral_error_m, 1e-11 + more_m);
  d.number("cutting_N", a.cutting_N, b.cutting_N, 1e-9 + more);
  d.number("attracted_N", a.attracted_N, b.attracted_N, 1e-9 + more);
  d.number("friction_N", a.friction_N, b.friction_N, 1e-9 + more);
  d.number("puncture_N", a.puncture_N, b.puncture_N, 1e-9 + more);
  d.number("clamping_N", a.clamping_N, b.clamping_N, 1e-9 + more);
  d.number("clamping_stiffness_N_per_m", a.clamping_stiffness_N_per_m, b.clamping_stiffness_N_per_m,
           1e-7 + 1e3 * more);
  d.whole("flags", a.flags & ~undecided, b.flags & ~undecided);
  return d.text();
}

double dotAngle(Quat a, Quat b, Vec3 torque) {
  // The rotation vector from a to b in W, to first order, which is accurate enough for neighbouring ticks.
  const Quat turn = b * conjugate(a);
  const double sign = turn.w < 0 ? -2.0 : 2.0;
  return sign * (turn.x * torque.x + turn.y * torque.y + turn.z * torque.z);
}

double work(const Motion& motion, const std::vector<StepReport>& reports, bool with_torque) {
  double sum = 0;
  for (std::size_t k = 1; k < motion.size(); ++k) {
    const Wrench &a = reports[k - 1].wrench_W, &b = reports[k].wrench_W;
    sum += dot((a.force_N + b.force_N) * 0.5, motion[k].p_WT_m - motion[k - 1].p_WT_m);
    if (with_torque) sum += dotAngle(motion[k - 1].q_WT, motion[k].q_WT, (a.torque_Nm + b.torque_Nm) * 0.5);
  }
  return sum;
}

}  // namespace

SceneModel compiled(const SceneSpec& spec, double rate_hz) {
  auto model = compile(spec, rate_hz);
  if (!model.ok()) throw std::invalid_argument(model.error().message);
  return std::move(model).value();
}

std::optional<std::string> firstDifference(const SceneSpec& spec, double rate_hz, const Motion& motion,
                                           Seen* seen, Defect planted) {
  EngineRun engine(spec, rate_hz);
  ReferenceEngine reference(spec, rate_hz, planted);
  for (std::size_t k = 0; k < motion.size(); ++k) {
    const StepReport a = engine.step(motion[k]), b = reference.step(motion[k]);
    if (seen != nullptr) {
      seen->flags |= a.flags;
      seen->phases |= 1u << static_cast<unsigned>(a.phase);
      seen->ticks += a.phase == Phase::kFree ? 0 : 1;
      seen->tracks_undecided = reference.tracksUndecided();
    }
    if (const std::string text = differences(a, b, reference); !text.empty())
      return "tick " + std::to_string(k) + " of " + std::to_string(motion.size()) + ":\n" + text;
  }
  return std::nullopt;
}

double energyToHand(const Motion& motion, const std::vector<StepReport>& reports) {
  return work(motion, reports, true);
}

double forceWork(const Motion& motion, const std::vector<StepReport>& reports) {
  return work(motion, reports, false);
}

}  // namespace needlelab::test
