/// The passivity observer: sums the energy that force and torque give to the hand, and finds force steps that
/// no spring explains. (Hannaford and Ryu 2002 call the running sum of power the passivity observer; here it
/// only observes.)
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>

#include "client/sim/stability/passivity_gesture.h"
#include "client/sim/stability/plant.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// The sums so far. Energies by the trapezoidal rule over neighbouring ticks, force × way of the tip and
/// torque × turn of the needle; positive is given to the hand.
struct PassivityRecord {
  bool finite = true;
  double max_force_N = 0;
  double net_J = 0;            ///< over everything
  double worst_running_J = 0;  ///< greatest that any insertion had given at any moment since its entry
  double worst_step_N = 0;  ///< greatest force step beyond ΣK·|Δp|/c; falls of declared releases left out
  double worst_torque_step_Nm = 0;  ///< greatest change of the torque in a tick, exits left out
  std::uint64_t ticks = 0;
  std::uint32_t insertions = 0;
  std::uint32_t flags = 0;  ///< StepFlag of any tick
};

/// Thread: one at a time.
class PassivityObserver {
 public:
  /// `axial_stiffness_N_per_m`: K_t + K_f + the steepest membrane; the clamping stiffness of the tick is
  /// added to it.
  explicit PassivityObserver(double axial_stiffness_N_per_m) : axial_N_per_m_(axial_stiffness_N_per_m) {}

  /// `slant`: c of this tick, see FORCE_MODEL.md, "Contact".
  void add(const TipSample& tip, const StepReport& report, double slant);
  [[nodiscard]] const PassivityRecord& record() const { return record_; }

 private:
  struct Seen {
    TipSample tip;
    StepReport report;
  };
  double axial_N_per_m_;
  std::optional<Seen> last_;
  double insertion_J_ = 0;
  PassivityRecord record_;
};

/// Work of two neighbouring ticks by the trapezoidal rule: force × way + torque × turn. In J.
double workBetween(const TipSample& from, const Wrench& before, const TipSample& to, const Wrench& now);

/// What may be wrong with a gesture's forces.
enum class PassivityCheck : std::uint8_t { kFinite, kEnergy, kForceStep };
inline constexpr std::array<std::string_view, 3> kPassivityCheckNames = {"finite", "energy_j",
                                                                         "force_step_n"};

struct PassivityLimits {
  double energy_J = 5e-5;  ///< that an insertion, or all of the gesture, may give to the hand
  double step_N = 0.05;    ///< beyond ΣK·|Δp|/c, falls of declared releases left out
};

/// One failed check.
struct PassivityFinding {
  PassivityCheck check = PassivityCheck::kFinite;
  double measured = 0, limit = 0;
};

/// The motion is prescribed; the scene is the gesture's, rendered by `model` (likeForLike). Errors: those of
/// the profile and of the source.
Result<PassivityRecord> runGesture(const PassivityGesture& gesture, AxialModel model,
                                   const ForceSourceFactory& source);

/// The judged energy: the greater of the whole gesture's net energy and the running maximum of any insertion
/// since its entry. This is stricter than the net energy, where energy lost in cutting can hide energy given
/// to the hand.
double judgedEnergy_J(const PassivityRecord& record);

/// The first failed check, in the order of PassivityCheck.
std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits);
/// Whether that one check failed.
std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits,
                                          PassivityCheck check);

/// Random gestures of prescribed motion: seeds in a row, the limbs take turns.
struct GestureSearch {
  std::uint64_t gestures = 400, first_seed = 1;
  std::uint64_t with_stages = 0;  ///< … and so many more, on the seeds that follow, with `range.stages`
  double rate_hz = 1000;
  GestureRange range;
  PassivityLimits limits;
};

struct GestureFindings {
  PassivityRecord worst;  ///< of each number; ticks and insertions are sums
  std::uint64_t gestures = 0, failed = 0;
};
/// Called with each gesture that fails.
using GestureFails =
    std::function<void(std::uint64_t seed, const PassivityGesture& gesture, const PassivityFinding& finding)>;

/// Deterministic. Errors: those of a source, e.g. a model that is not built.
Result<GestureFindings> searchGestures(const GestureSearch& search, AxialModel model,
                                       const ForceSourceFactory& source, const GestureFails& fails = {});

}  // namespace needlelab
