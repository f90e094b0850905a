/// What one of two servers does in the tests of isolation: what stations send, and lines that it writes down.
#pragma once

#include <cstdint>
#include <string>

#include "db/service/service.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/postgres/isolation/shared_world.h"

namespace needlelab::test {

/// Of the staff of SharedWorld.
Principal principalOf(const std::string& name);
std::string answerText(const Outcome& outcome);

ServerWork opening(const std::string& id, const std::string& trainee, const std::string& device);
/// Chunk `seq` of the open session. `samples`: another number makes another chunk.
ServerWork appending(std::uint64_t seq, std::size_t samples);
/// One that its station sealed, and nobody can decode.
ServerWork appendingUndecodable(std::uint64_t seq);
/// Closes the open session, or another open one.
ServerWork closing(std::uint64_t chunks, const char* session = kOpenSession);

/// The two commits of a piece of work that promises no more than that each is as if nobody had come between.
struct InTwoCommits {
  ServerWork begins, ends;  ///< their answers, one behind the other, are the whole one's
};
/// The score of a long session takes a while, in which its person may be erased.
InTwoCommits closingInTwoCommits(std::uint64_t chunks, const char* session = kOpenSession);

/// Twice: once an hour a person and host have a line, as each server remembers it.
ServerWork loggingIn(const char* who);
/// As many wrong codes of cora as are allowed: her code is locked, by a line that nobody waits for.
ServerWork typingWrongCodes();
/// What needlelab-admin has done itself, and writes down.
ServerWork noting(const char* action, const char* subject, const char* detail);

}  // namespace needlelab::test
