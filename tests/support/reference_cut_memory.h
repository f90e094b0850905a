/// CUT_MEMORY's independent judge: a slow, literal transcription of FORCE_MODEL.md, "Memory of the cut", written
/// from the text alone.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/haptics/geometry.h"

namespace needlelab::test {

enum class Defect : std::uint8_t;

/// What an insertion knows after a tick without the memory. The memory changes `wall`, `friction_wall`, `x_c`
/// and which membranes are open.
struct CutTick {
  struct Membrane {
    bool met = false;   ///< it has its place
    bool open = false;  ///< it ruptured, or opened at a hole
    double place = 0;   ///< s
  };
  bool entry = false;
  Vec3 p_entry_W_m;        ///< P0
  Vec3 u_W;                ///< after a turn of this tick
  double turned_by = 0;    ///< x_new − x_old of that turn
  double x_before = 0;     ///< x at the tick before, moved by that turn; 0 at entry
  double x = 0;            ///< of the tip
  double x_c = 0;          ///< no cutting beyond
  double wall = 0;         ///< w
  double friction_wall = 0;  ///< w_f
  double cut_reach = 0;    ///< Δ_cut
  bool ruptured = false;   ///< a membrane ruptured in this tick
  std::vector<Membrane> membranes;  ///< one a layer, whether or not it has one
};

/// Remembers the cuts of all insertions, and changes each tick by them.
class ReferenceCutMemory {
 public:
  ReferenceCutMemory(double share, double radius_m, Defect planted)
      : share_(share), radius_m_(radius_m), planted_(planted) {}

  /// What the tick releases.
  struct Released {
    bool membrane = false;       ///< a membrane that held opened at a hole
    bool wall = false;           ///< w moved further than the tip
    bool undecided = false;      ///< rounding decides about `wall`
  };
  Released step(CutTick& tick);
  /// The tip is outside.
  void exit();

 private:
  struct Track {
    Vec3 p_entry_W_m;
    Vec3 u_W;
    double length = 0;           ///< ℓ
    std::vector<bool> open;      ///< by layer
  };

  [[nodiscard]] double distanceTo(const Track& track, Vec3 point) const;
  [[nodiscard]] double wayWithin(const Track& track, Vec3 point, Vec3 u) const;
  [[nodiscard]] std::optional<double> endOfOthers(const CutTick& tick) const;
  void keepTrack(const CutTick& tick);
  Track& makeTrack(const CutTick& tick);

  double share_, radius_m_;
  Defect planted_;
  std::vector<Track> tracks_;  ///< from the oldest to the newest
  // of the insertion under way
  std::optional<std::size_t> own_;
  std::vector<bool> held_;  ///< membranes that held in the tick before
};

}  // namespace needlelab::test
