/// Which pieces of work two servers do at a time in the tests of isolation.
#pragma once

#include <string>
#include <vector>

#include "needlelab/control.pb.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/postgres/isolation/shared_world.h"

namespace needlelab::test {

struct PairAtATime {
  std::string name;  ///< "user add, user add"
  ServerWork first, second;
  /// Of requests; CALL_NOT_SET: what a station sends.
  pb::Request::CallCase first_call = pb::Request::CALL_NOT_SET;
  pb::Request::CallCase second_call = pb::Request::CALL_NOT_SET;
};

/// Each request that has something stored, from two people; and different ones, and stations' chunks, that
/// touch the same rows. Throws where a request cannot be read.
std::vector<PairAtATime> pairsAtATime(const SharedWorld& world);

}  // namespace needlelab::test
