/// Which aids are on, as something that is cheap to ask and to compare each frame. What an exercise allows
/// and what the names are: profile/aid_list.h.
#pragma once

#include <cstdint>
#include <string_view>

#include "common/profile/aid_list.h"

namespace needlelab {

/// A set of aids; plain data.
class AidSet {
 public:
  constexpr AidSet() = default;  ///< none
  explicit AidSet(const AidList& aids);
  [[nodiscard]] constexpr bool has(pb::Exercise::Aid aid) const { return (bits_ & bit(aid)) != 0; }
  constexpr void set(pb::Exercise::Aid aid, bool on) { bits_ = on ? bits_ | bit(aid) : bits_ & ~bit(aid); }
  /// In the order of their numbers, as messages want it.
  [[nodiscard]] AidList list() const;
  friend constexpr bool operator==(const AidSet&, const AidSet&) = default;

 private:
  static constexpr std::uint32_t bit(pb::Exercise::Aid aid) { return 1u << static_cast<unsigned>(aid); }
  std::uint32_t bits_ = 0;
};

/// All but ULTRASOUND: as `usualAids`.
AidSet usualAidSet();
/// All of them, ULTRASOUND included: for whoever looks on.
AidSet allAidSet();

/// "ultrasound picture": for people. The name as in JSON is pb::Exercise::Aid_Name's.
std::string_view aidWord(pb::Exercise::Aid aid);

}  // namespace needlelab
