#include "tests/support/reference/reference_cut_memory.h"

#include <algorithm>
#include <cmath>

#include "tests/support/reference/reference_engine.h"

namespace needlelab::test {
namespace {

constexpr std::size_t kTracks = 16;
constexpr double kNewCut_m = 1e-6, kRounding_m = 1e-12;

Vec3 q(const CutTick& tick, double s) {
  return tick.p_entry_W_m + tick.u_W * s;  // Q(s) = P0 + u·s
}

Vec3 acrossOf(Vec3 arm, Vec3 u) {
  return arm - u * dot(arm, u);
}

// x_c = min(x, s of all intact membranes already met)
double cutPosition(const CutTick& tick) {
  double x_c = tick.x;
  for (const auto& membrane : tick.membranes)
    if (membrane.met && !membrane.open) x_c = std::min(x_c, membrane.place);
  return x_c;
}

}  // namespace

double ReferenceCutMemory::distanceTo(const Track& track, Vec3 p_W_m) {
  return norm(acrossOf(p_W_m - track.p_entry_W_m, track.v_W));
}

double ReferenceCutMemory::alongTo(const Track& track, Vec3 p_W_m) {
  return dot(p_W_m - track.p_entry_W_m, track.v_W);
}

bool ReferenceCutMemory::passes(const Track& track, Vec3 p_W_m, double more_m) const {
  return distanceTo(track, p_W_m) <= radius_m_ + more_m;
}

// "the way to the end, (ℓ − a)/(u·v) (negative beyond the end), or, if shorter, the one to where u is r away
// from the line"
double ReferenceCutMemory::wayWithin(const Track& track, Vec3 p_W_m, Vec3 u_W) const {
  const double cosine = dot(u_W, track.v_W);
  if (cosine <= 0) return alongTo(track, p_W_m) <= track.length ? 0 : -1;
  const double to_end = (track.length - alongTo(track, p_W_m)) / cosine;
  if (planted_ == Defect::kCutWithoutSides) return to_end;  // planted
  const Vec3 a = acrossOf(p_W_m - track.p_entry_W_m, track.v_W), b = acrossOf(u_W, track.v_W);
  if (normSquared(b) <= 1e-12) return to_end;
  // |a + b·t| = r
  const double half = dot(a, b) / normSquared(b);
  const double rest = (normSquared(a) - radius_m_ * radius_m_) / normSquared(b);
  return std::min(to_end, -half + std::sqrt(std::max(0.0, half * half - rest)));
}

// 1. Move of the line
void ReferenceCutMemory::turn(const CutTick& tick) {
  if (!own_) return;
  tracks_[*own_].p_entry_W_m = tick.p_entry_W_m;
  tracks_[*own_].v_W = tick.u_W;
  if (planted_ != Defect::kCutKeptInTurn) tracks_[*own_].length += tick.turned_by;  // otherwise planted
}

// 2. Membranes
bool ReferenceCutMemory::openMembranes(CutTick& tick) const {
  const double x_c_before = cutPosition(tick);
  bool released = false;
  for (std::size_t i = 0; i < tick.membranes.size(); ++i) {
    CutTick::Membrane& membrane = tick.membranes[i];
    if (!membrane.met || membrane.open) continue;
    for (const Track& track : tracks_) {
      const double more_m = planted_ == Defect::kHoleEverywhere ? 1.0 : 0.0;  // planted: the first
      if (track.open[i] && passes(track, q(tick, membrane.place), more_m)) membrane.open = true;
    }
    if (membrane.open && tick.x_before > membrane.place) released = true;
  }
  const double follows = cutPosition(tick) - x_c_before;
  if (planted_ == Defect::kHoleLeavesWalls) return released;  // planted
  tick.wall += follows;
  tick.friction_wall += follows;
  return released;
}

// 3. End of the cut
double ReferenceCutMemory::endOfCut(const CutTick& tick, double more_m) const {
  const Vec3 at = q(tick, tick.wall);
  double end = own_ ? std::max(0.0, tracks_[*own_].length) : 0.0;
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    if (own_ == i || !passes(tracks_[i], at, 1e-9 + more_m) || alongTo(tracks_[i], at) < -radius_m_) continue;
    end = std::max(end, tick.wall + wayWithin(tracks_[i], at, tick.u_W));
  }
  return end;
}

// 5. Tracks: the place of a new one
std::size_t ReferenceCutMemory::placeFor(const CutTick& tick) {
  const Vec3 at = q(tick, tick.wall);
  for (std::size_t i = 0; i < tracks_.size(); ++i)
    if (passes(tracks_[i], tick.p_entry_W_m) && passes(tracks_[i], at) && tick.cuts &&
        tracks_[i].length <= alongTo(tracks_[i], at) && planted_ != Defect::kCutsKeptApart)  // planted
      return i;
  const std::size_t place = next_;
  next_ = (next_ + 1) % kTracks;
  if (place == tracks_.size()) tracks_.emplace_back();
  tracks_[place] = {};
  tracks_[place].open.assign(tick.membranes.size(), false);
  return place;
}

// 5. Tracks
void ReferenceCutMemory::record(const CutTick& tick, double end) {
  if (!own_) {
    const bool new_cut = tick.cuts && tick.wall > end + kNewCut_m;
    if (!new_cut && !tick.ruptured) return;
    own_ = placeFor(tick);
    tracks_[*own_].length = 0;
    tracks_[*own_].p_entry_W_m = tick.p_entry_W_m;
    tracks_[*own_].v_W = tick.u_W;
  }
  Track& own = tracks_[*own_];
  const double cut_to = planted_ == Defect::kCutToTip ? tick.x : tick.wall;  // planted: the first
  if (tick.cuts) own.length = std::max(own.length, cut_to);
  for (std::size_t i = 0; i < tick.membranes.size(); ++i)
    if (tick.membranes[i].open) own.open[i] = true;
}

ReferenceCutMemory::Released ReferenceCutMemory::step(CutTick& tick) {
  Released released;
  if (tick.entry) own_.reset();
  turn(tick);
  released.membrane = openMembranes(tick);
  double end = 0;
  if (tick.cuts) {
    end = endOfCut(tick);
    const bool new_cut = !own_ && tick.wall > end + kNewCut_m;
    for (const double more_m : {-kRounding_m, kRounding_m})
      if (!own_ && (tick.wall > endOfCut(tick, more_m) + kNewCut_m) != new_cut) undecided_ = true;
    // 4. Wall
    const double to = std::min(cutPosition(tick) - share_ * tick.cut_reach, end);
    const double move = std::max(0.0, to - tick.wall);
    const double further = move - std::max(0.0, tick.x - tick.x_before);
    tick.wall = std::max(tick.wall, to);
    released.wall = move > 0 && further > kRounding_m;
    released.undecided = std::abs(further) < 10 * kRounding_m;
  }
  tick.x_c = cutPosition(tick);
  record(tick, end);
  return released;
}

}  // namespace needlelab::test
