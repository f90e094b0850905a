/// The pieces of work that two servers do at the same time in the isolation tests.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "needlelab/control.pb.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/postgres/isolation/server_works.h"
#include "tests/postgres/isolation/shared_world.h"

namespace needlelab::test {

/// What a request guarantees to be unaffected by work in between.
enum class Indivisible {
  kWhole,   ///< its answer and what it stores
  kStored,  ///< what it stores: the answer is a view of one moment, which may be before or after its line
  kSteps,   ///< each of its steps: the counts in its answer and its line may include others' work
};
Indivisible indivisibleOf(pb::Request::CallCase call);

struct PairAtATime {
  std::string name;  ///< "user add, user add"
  ServerWork first, second;
  /// For requests that store something; CALL_NOT_SET: other work that stores, e.g. what a station sends.
  pb::Request::CallCase first_call = pb::Request::CALL_NOT_SET;
  pb::Request::CallCase second_call = pb::Request::CALL_NOT_SET;
  /// A sentence of an answer with this beginning describes a moment after the data were stored, and is not
  /// compared.
  std::string told_later = {};
  std::optional<InTwoCommits> first_commits = {}, second_commits = {};
};

/// Each request that stores something, from two people; and different requests, stations' chunks, and audit
/// lines that touch the same rows. Throws if a request cannot be parsed.
std::vector<PairAtATime> pairsAtATime(const SharedWorld& world);

}  // namespace needlelab::test
