/// What one account may have stored, so that one person, or a stolen password, cannot fill the disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>

#include "common/base/result.h"
#include "needlelab/types.pb.h"
#include "server/live/day_share.h"

namespace needlelab {

/// A share of a day (DayShare) for each account, over all of its connections on both ports, of the requests
/// that store (Storing in db/service/requests.h). In memory: a restart of the server gives everybody the
/// whole share again. Memory: some 100 bytes an account that had something stored. Times: steady clock (ns),
/// from the caller. Thread: one.
class PeopleShares {
 public:
  /// Far above what people do by hand.
  struct Settings {
    /// Of trainees and researchers, who store their consent to studies, password and code: 2,700 of the
    /// longest consents.
    double own_bytes = 8.0 * 1024 * 1024;
    /// Of instructors and curriculum managers: 1,000 of the largest profiles and courses, 80,000 usual ones,
    /// 500,000 remarks.
    double staff_bytes = 1024.0 * 1024 * 1024;
    /// Of administrators, who import whole labs: 20 million records.
    double administrator_bytes = 16.0 * 1024 * 1024 * 1024;
  };
  /// What a request costs besides its own bytes: its row, its lines in the audit log (a message that is not
  /// delivered has two), their indices.
  static constexpr std::size_t kRequestBytes = 2048;

  PeopleShares() : PeopleShares(Settings{}) {}
  explicit PeopleShares(const Settings& settings) : settings_(settings) {}

  /// Takes a request of `bytes` from the account's share. kNoRoom: it does not suffice; nothing is taken
  /// then, and the message gives the share and when there is room.
  Status admit(const std::string& name, pb::Role role, std::size_t bytes, std::int64_t now_ns);

 private:
  [[nodiscard]] double shareOf(pb::Role role) const;

  const Settings settings_;
  std::unordered_map<std::string, DayShare> used_;
};

}  // namespace needlelab
