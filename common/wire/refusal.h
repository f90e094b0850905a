/// Refusals of the wire and errors of the program, translated both ways.
#pragma once

#include <string>

#include "common/base/result.h"
#include "needlelab/session.pb.h"

namespace needlelab {

pb::Refusal makeRefusal(pb::Refusal::Reason reason, std::string text, bool fatal = false);
/// The reason that fits an error: kInvalidInput → INVALID, kNotFound → NOT_FOUND, kDenied → ROLE, others
/// INTERNAL.
pb::Refusal refusalOf(const Error& error);
/// What a peer's refusal means to us; the message names the reason, and both versions where they are given.
Error errorOf(const pb::Refusal& refusal);
/// "LOGIN", "GAP", …
std::string reasonName(pb::Refusal::Reason reason);

}  // namespace needlelab
