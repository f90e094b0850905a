/// CUT_MEMORY's independent judge: a slow, literal transcription of FORCE_MODEL.md, "Memory of the cut",
/// written from the text alone.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/haptics/geometry.h"

namespace needlelab::test {

enum class Defect : std::uint8_t;

/// An insertion after a tick without the memory. The memory changes `wall`, `friction_wall`, `x_c` and which
/// membranes are open. Lengths along u, in m.
struct CutTick {
  struct Membrane {
    bool met = false;   ///< it has its place
    bool open = false;  ///< it ruptured, or opened at a hole
    double place = 0;   ///< s
  };
  bool entry = false;
  Vec3 p_entry_W_m;                 ///< P0
  Vec3 u_W;                         ///< after this tick's turn
  double turned_by = 0;             ///< x_new − x_old of that turn
  double x_before = 0;              ///< x at the previous tick, moved by that turn; 0 at entry
  double x = 0;                     ///< of the tip
  double x_c = 0;                   ///< no cutting beyond
  double wall = 0;                  ///< w
  double friction_wall = 0;         ///< w_f
  bool cuts = false;                ///< CUTTING is live
  double cut_reach = 0;             ///< Δ_cut
  bool ruptured = false;            ///< a membrane ruptured in this tick
  std::vector<Membrane> membranes;  ///< one per layer, whether or not it has one
};

/// Remembers the cuts of all insertions, and changes each tick by them. The radius must be above 0.
class ReferenceCutMemory {
 public:
  ReferenceCutMemory(double share, double radius_m, Defect planted)
      : share_(share), radius_m_(radius_m), planted_(planted) {}

  /// What a tick releases.
  struct Released {
    bool membrane = false;   ///< a membrane that held opened at a hole
    bool wall = false;       ///< w moved further than the tip
    bool undecided = false;  ///< rounding decides about `wall`
  };
  Released step(CutTick& tick);
  /// "CUT_MEMORY leaves the insertion's own track at the old hole, and the insertion has none" ("Puncture"):
  /// before this tick's step.
  void leaveTrack(Vec3 hole_W_m) {
    if (own_) tracks_[*own_].p_entry_W_m = hole_W_m;
    own_.reset();
  }
  /// Whether in some tick rounding decided if the insertion gets its own track.
  [[nodiscard]] bool undecided() const { return undecided_; }

 private:
  struct Track {
    Vec3 p_entry_W_m;
    Vec3 v_W;
    double length = 0;       ///< ℓ
    std::vector<bool> open;  ///< by layer
  };

  static double distanceTo(const Track& track, Vec3 p_W_m);
  static double alongTo(const Track& track, Vec3 p_W_m);
  [[nodiscard]] bool passes(const Track& track, Vec3 p_W_m, double more_m = 0) const;
  [[nodiscard]] double wayWithin(const Track& track, Vec3 p_W_m, Vec3 u_W) const;
  void turn(const CutTick& tick);
  bool openMembranes(CutTick& tick) const;
  [[nodiscard]] double endOfCut(const CutTick& tick, double more_m = 0) const;
  std::size_t placeFor(const CutTick& tick);
  void record(const CutTick& tick, double end);

  double share_, radius_m_;
  Defect planted_;
  std::vector<Track> tracks_;  ///< by place, at most 16
  std::size_t next_ = 0;       ///< the slot for a new track
  std::optional<std::size_t> own_;
  bool undecided_ = false;
};

}  // namespace needlelab::test
