#include "common/wire/refusal.h"

#include <utility>

#include "common/wire/version.h"

namespace needlelab {

pb::Refusal makeRefusal(pb::Refusal::Reason reason, std::string text, bool fatal) {
  pb::Refusal refusal;
  refusal.set_reason(reason);
  refusal.set_text(std::move(text));
  refusal.set_fatal(fatal);
  return refusal;
}

pb::Refusal refusalOf(const Error& error) {
  const auto reason = [&] {
    switch (error.code) {
      case ErrorCode::kInvalidInput:
        return pb::Refusal::INVALID;
      case ErrorCode::kNotFound:
        return pb::Refusal::NOT_FOUND;
      case ErrorCode::kAlreadyExists:
        return pb::Refusal::CONFLICT;
      case ErrorCode::kConflict:
        return pb::Refusal::REVISION_CONFLICT;
      case ErrorCode::kDenied:
        return pb::Refusal::ROLE;
      case ErrorCode::kVersion:
        return pb::Refusal::VERSION;
      case ErrorCode::kUnavailable:
      case ErrorCode::kCorrupt:
      case ErrorCode::kFailed:
        break;
    }
    return pb::Refusal::INTERNAL;
  }();
  auto refusal = makeRefusal(reason, error.message);
  refusal.set_current_revision(error.current_revision);
  return refusal;
}

Error errorOf(const pb::Refusal& refusal) {
  const auto code = [&] {
    switch (refusal.reason()) {
      case pb::Refusal::VERSION:
        return ErrorCode::kVersion;
      case pb::Refusal::LOGIN:
      case pb::Refusal::ROLE:
        return ErrorCode::kDenied;
      case pb::Refusal::INVALID:
      case pb::Refusal::TOO_LARGE:
        return ErrorCode::kInvalidInput;
      case pb::Refusal::UNKNOWN_SESSION:
      case pb::Refusal::NOT_FOUND:
        return ErrorCode::kNotFound;
      case pb::Refusal::CONTRADICTION:
      case pb::Refusal::CONFLICT:
        return ErrorCode::kAlreadyExists;
      case pb::Refusal::REVISION_CONFLICT:
        return ErrorCode::kConflict;
      case pb::Refusal::RATE_LIMITED:
      case pb::Refusal::QUEUE_OVERFLOW:
      case pb::Refusal::TIMEOUT:
      case pb::Refusal::SHUTTING_DOWN:
        return ErrorCode::kUnavailable;
      default:
        return ErrorCode::kFailed;
    }
  }();
  std::string text = "the peer refused (" + reasonName(refusal.reason()) + "): " + refusal.text();
  if (refusal.reason() == pb::Refusal::VERSION) {
    text += " [peer " + versionText(refusal.ours()) + ", we " + versionText(refusal.theirs()) + "]";
  }
  return {code, std::move(text), refusal.current_revision()};
}

std::string reasonName(pb::Refusal::Reason reason) {
  const std::string& name = pb::Refusal::Reason_Name(reason);
  return name.empty() ? "reason " + std::to_string(reason) : name;
}

}  // namespace needlelab
