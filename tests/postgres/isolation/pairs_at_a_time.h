/// Which pieces of work two servers do at a time in the tests of isolation.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "needlelab/control.pb.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/postgres/isolation/server_works.h"
#include "tests/postgres/isolation/shared_world.h"

namespace needlelab::test {

/// What a request promises to be as if nobody had come between.
enum class Indivisible {
  kWhole,   ///< its answer, and what it stores
  kStored,  ///< what it stores: the answer is a view of one moment, which may be before or behind its line
  kSteps,   ///< each of its steps: what it counts, for its answer and its line, may be others' work, too
};
Indivisible indivisibleOf(pb::Request::CallCase call);

struct PairAtATime {
  std::string name;  ///< "user add, user add"
  ServerWork first, second;
  /// Of requests that have something stored; CALL_NOT_SET: what stores, too, as what a station sends.
  pb::Request::CallCase first_call = pb::Request::CALL_NOT_SET;
  pb::Request::CallCase second_call = pb::Request::CALL_NOT_SET;
  /// A sentence of an answer that begins so is a look at a moment behind what was stored, and not compared.
  std::string told_later = {};
  std::optional<InTwoCommits> first_commits = {}, second_commits = {};
};

/// Each request that has something stored, from two people; and different ones, stations' chunks, and lines
/// of the audit log, that touch the same rows. Throws where a request cannot be read.
std::vector<PairAtATime> pairsAtATime(const SharedWorld& world);

}  // namespace needlelab::test
