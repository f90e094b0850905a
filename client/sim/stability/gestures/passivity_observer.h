/// The passivity observer: sums the energy that force and torque give to the hand, and finds force steps that
/// no spring explains. (Hannaford and Ryu 2002 call the running sum of power the passivity observer; here it
/// only observes.)
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>

#include "client/sim/stability/gestures/passivity_gesture.h"
#include "client/sim/stability/loop/plant.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// The sums so far. Energies use the trapezoidal rule over neighbouring ticks: force × displacement of the
/// tip plus torque × rotation of the needle; positive is given to the hand.
struct PassivityRecord {
  bool finite = true;
  double max_force_N = 0;
  double net_J = 0;            ///< over the whole gesture
  double worst_running_J = 0;  ///< maximum that any insertion had given at any moment since its entry
  double worst_step_N = 0;     ///< largest force step beyond ΣK·|Δp|/c, without falls of declared releases
  double worst_torque_step_Nm = 0;  ///< largest change of torque per tick, without exits
  std::uint64_t ticks = 0;
  std::uint32_t insertions = 0;
  std::uint32_t flags = 0;  ///< StepFlag of any tick
};

/// Thread: one at a time.
class PassivityObserver {
 public:
  /// `axial_stiffness_N_per_m`: that of SceneModel; each tick's clamping stiffness is added.
  explicit PassivityObserver(double axial_stiffness_N_per_m) : axial_N_per_m_(axial_stiffness_N_per_m) {}

  /// `slant`: c of this tick; see FORCE_MODEL.md, "Contact".
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

/// Work between two neighbouring ticks by the trapezoidal rule: force × displacement + torque × rotation. In
/// J.
double workBetween(const TipSample& from, const Wrench& before, const TipSample& to, const Wrench& now);

/// Checks of a gesture's forces.
enum class PassivityCheck : std::uint8_t { kFinite, kEnergy, kForceStep };
inline constexpr std::array<std::string_view, 3> kPassivityCheckNames = {"finite", "energy_j",
                                                                         "force_step_n"};

struct PassivityLimits {
  double energy_J = 5e-5;  ///< maximum that an insertion, or the whole gesture, may give to the hand
  double step_N = 0.05;    ///< beyond ΣK·|Δp|/c, without falls of declared releases
};

/// One failed check.
struct PassivityFinding {
  PassivityCheck check = PassivityCheck::kFinite;
  double measured = 0, limit = 0;
};

/// Prescribed motion; the scene is the gesture's, rendered by `model` (likeForLike). Errors: those of the
/// profile and of the source.
Result<PassivityRecord> runGesture(const PassivityGesture& gesture, AxialModel model,
                                   const ForceSourceFactory& source);

/// The judged energy: the larger of the whole gesture's net energy and the running maximum of any insertion
/// since its entry. Stricter than the net energy, in which energy lost in cutting can hide energy given to
/// the hand.
double judgedEnergy_J(const PassivityRecord& record);

/// The first failed check, in the order of PassivityCheck; only `only`, if given.
std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits,
                                          std::optional<PassivityCheck> only = {});

/// Random gestures of prescribed motion with consecutive seeds; the limbs alternate.
struct GestureSearch {
  std::uint64_t gestures = 400, first_seed = 1;
  std::uint64_t with_stages = 0;  ///< additional gestures, on the following seeds, with `range.stages`
  double rate_hz = 1000;
  GestureRange range;
  PassivityLimits limits;
};

struct GestureFindings {
  PassivityRecord worst;  ///< of each number; ticks and insertions are sums
  std::uint64_t gestures = 0, failed = 0;
};
/// Called for each failed gesture; false ends the search.
using GestureFails =
    std::function<bool(std::uint64_t seed, const PassivityGesture& gesture, const PassivityFinding& finding)>;

/// Deterministic. Errors: those of a source, e.g. a model that is not built in.
Result<GestureFindings> searchGestures(const GestureSearch& search, AxialModel model,
                                       const ForceSourceFactory& source, const GestureFails& fails = {});

}  // namespace needlelab
