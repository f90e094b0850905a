/// The work of one of two servers in the isolation tests: what stations send, and the lines it records.
#pragma once

#include <cstdint>
#include <string>

#include "db/service/service.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/postgres/isolation/shared_world.h"

namespace needlelab::test {

/// Of SharedWorld's staff.
Principal principalOf(const std::string& name);
std::string answerText(const Outcome& outcome);

ServerWork opening(const std::string& id, const std::string& trainee, const std::string& device);
/// Appends chunk `seq` of the open session. `samples`: another number gives another chunk.
ServerWork appending(std::uint64_t seq, std::size_t samples);
/// Appends one that its station sealed but that cannot be decoded.
ServerWork appendingUndecodable(std::uint64_t seq);
/// Closes the open session, or another open one.
ServerWork closing(std::uint64_t chunks, const char* session = kOpenSession);

/// The two commits of a piece of work that only guarantees that each commit is unaffected by others.
struct InTwoCommits {
  ServerWork begins, ends;  ///< their answers, concatenated, equal the whole one's
};
/// Scoring a long session takes a while, in which its person may be erased.
InTwoCommits closingInTwoCommits(std::uint64_t chunks, const char* session = kOpenSession);

/// Twice: a person and host get one line per hour, remembered by each server.
ServerWork loggingIn(const char* who);
/// Types as many wrong codes of cora's as allowed: her code gets locked, with a line that no request waits
/// for.
ServerWork typingWrongCodes();
/// Records what needlelab-admin has done itself.
ServerWork noting(const char* action, const char* subject, const char* detail);

}  // namespace needlelab::test
