/// A stiff contact of a point with any surface: the rendered point (the proxy) stays on the surface (Zilles
/// and Salisbury 1995), a spring joins it to the measured tip, and it sticks or slips along the surface by
/// Coulomb's cone (Harwin and Melder 2002). BONE and PALPATION use it.
///
/// No force steps: in a tick the stretch changes by little more than the tip's movement. If the proxy would
/// move further, over an edge, it does so over the next ticks.
///
/// Energy: the proxy moves only if that shortens the spring.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>

#include "common/haptics/geometry.h"
#include "common/haptics/sim_state.h"

namespace needlelab::proxy_contact {

/// On a curved surface the cone turns under the proxy as it slips; at most this many slips per tick follow
/// it.
inline constexpr int kMaxSlips = 8;
/// A place closer than this to the surface is on it.
inline constexpr double kOnSurface_m = 1e-9;
/// How much faster than the tip the proxy may fall over an edge: 4 mm in 0.2 s.
inline constexpr double kFallSpeed_mps = 0.020;

// A surface is a type with
//   double depth(p_W_m) const;                    positive beyond it; changes by no more than p moves
//   Vec3 normal(p_W_m, motion) const;             out of it, at the nearest place on it
//   static constexpr bool kIsConvex               if not (on_bones.h), also:
//   Vec3 onto(p_W_m) const;                       a place on it, near a place
//   bool meets(from, to, begins_on, at&) const;   whether a way meets it, and where
//   bool reaches(from, to, tip) const;            whether the proxy may go there
//   static constexpr double kStill_m              as it costs time to ask, a shorter slip waits for the next
//   tick

// the nearest place on the surface; `motion`: of the tip, where the normal is undefined
template <class Surface>
Vec3 onto(const Surface& surface, Vec3 p_W_m, Vec3 motion) {
  if constexpr (Surface::kIsConvex)
    return p_W_m + surface.normal(p_W_m, motion) * surface.depth(p_W_m);
  else
    return surface.onto(p_W_m);
}

// moves a place outside the surface onto it; one beyond it stays, or comes out of a surface with hollows
template <class Surface>
Vec3 outOf(const Surface& surface, Vec3 p_W_m, Vec3 motion) {
  if (Surface::kIsConvex && surface.depth(p_W_m) > kOnSurface_m) return p_W_m;
  return onto(surface, p_W_m, motion);
}

// √(2 + μ²): the greatest change of the stretch over the tip's movement, along a flat surface
inline double steepestStretch(double friction) {
  return std::sqrt(2.0 + friction * friction);
}

// how far the stretch may change in a tick. Along a flat surface, and where the skin shortens it, the tip's
// movement never changes it by more than the first term. A proxy that falls over an edge spreads its movement
// over the next ticks
inline double mostChange(double friction, double period_s, double way_m) {
  return steepestStretch(friction) * way_m + kFallSpeed_mps * period_s;
}

// the greatest share, at most 1, of `move` with |change + share·move| <= max_m
inline double shareWithin(Vec3 change, Vec3 move, double max_m) {
  assert(!(max_m < 0.0));
  const double room = std::max(0.0, max_m * max_m - normSquared(change));
  const double along = dot(change, move), size = normSquared(move);
  if (!(size + 2.0 * along > room)) return 1.0;
  return std::clamp((std::sqrt(along * along + size * room) - along) / size, 0.0, 1.0);
}

// moves a proxy that followed the tip outside the surface back onto it, in the same way as a slip
template <class Surface>
void backOnto(const Surface& surface, Vec3 tip_W_m, double max_m, ProxyContact& contact) {
  const Vec3 proxy_W_m = contact.p_proxy_W_m, stretch = proxy_W_m - tip_W_m;
  if (!(surface.depth(proxy_W_m) < -kOnSurface_m)) return;
  const Vec3 move = onto(surface, proxy_W_m, stretch) - proxy_W_m;
  if (!(normSquared(stretch + move) < normSquared(stretch))) return;
  contact.p_proxy_W_m = proxy_W_m + move * shareWithin(stretch - contact.stretch_W_m, move, max_m);
}

// Moves the proxy along the surface toward the tip until friction holds it or the stretch has changed by
// max_m. Returns false when the tip has left the surface and the proxy has reached it. A convex surface has
// nothing between a proxy and a tip beyond the tangent plane there; one with hollows is looked at on the way.
template <class Surface>
bool followTip(const Surface& surface, double friction, Vec3 tip_W_m, double max_m, ProxyContact& contact) {
  Vec3& proxy_W_m = contact.p_proxy_W_m;
  backOnto(surface, tip_W_m, max_m, contact);
  for (int slip = 0; slip <= kMaxSlips; ++slip) {
    const Vec3 to_tip = tip_W_m - proxy_W_m;
    const Vec3 change = -to_tip - contact.stretch_W_m;
    const Vec3 normal = surface.normal(proxy_W_m, to_tip);
    const double pressed_m = -dot(normal, to_tip);
    if (!(pressed_m > 0.0)) {
      const double share = shareWithin(change, to_tip, max_m);
      const Vec3 step = to_tip * share;
      if constexpr (!Surface::kIsConvex) {
        Vec3 at_W_m;
        if (surface.meets(proxy_W_m, proxy_W_m + step, true, at_W_m)) {
          const bool moved = !(at_W_m == proxy_W_m);
          proxy_W_m = at_W_m;
          if (moved) continue;
          return true;
        }
      }
      proxy_W_m = proxy_W_m + step;
      return share < 1.0;
    }
    const Vec3 along = to_tip + normal * pressed_m;
    const double along_m = norm(along), sticks_m = friction * pressed_m;
    if (along_m <= sticks_m || slip == kMaxSlips) return true;
    if constexpr (!Surface::kIsConvex)
      if (along_m - sticks_m <= Surface::kStill_m) return true;
    const Vec3 move = along * (1.0 - sticks_m / along_m);
    // on a curved surface a long slip could lengthen the spring: then try a shorter one
    const double max_share = shareWithin(change, move, max_m);
    const bool outside = surface.depth(proxy_W_m) < -kOnSurface_m;
    bool moved = false, cut = max_share < 1.0;
    for (double share = max_share; !moved && share > 0.05 * max_share; share *= 0.5) {
      Vec3 step = outOf(surface, proxy_W_m + move * share, to_tip) - proxy_W_m;
      if (outside) {
        const double step_share = shareWithin(change, step, max_m);
        step = step * step_share;
        cut = cut || step_share < 1.0;
      }
      moved = normSquared(to_tip - step) < normSquared(to_tip);
      if constexpr (!Surface::kIsConvex)
        moved = moved && surface.reaches(proxy_W_m, proxy_W_m + step, tip_W_m);
      if (moved) proxy_W_m = proxy_W_m + step;
    }
    if (!moved || cut) return true;
  }
  return true;
}

}  // namespace needlelab::proxy_contact
