/// The ledger that a station under test writes for the judge: one line of JSON per event, each appended with
/// a single write, so that a kill of this program cuts off its last line at most; the next start removes
/// that. Fields: README.md.
#pragma once

#include <mutex>
#include <string>

#include "client/net/spool.h"
#include "common/gesture/sample.h"
#include "needlelab/session.pb.h"

namespace needlelab::test {

/// Owns its file. Thread: any.
class StationLedger {
 public:
  /// Throws std::runtime_error when the file cannot be opened.
  explicit StationLedger(const std::string& path);
  ~StationLedger();
  StationLedger(const StationLedger&) = delete;
  StationLedger& operator=(const StationLedger&) = delete;

  void session(const pb::SessionDescription& description);
  /// Of the session that was named last.
  void sample(const GestureSample& sample);
  void acknowledged(const pb::Ack& ack);
  void closed(const pb::SessionClosed& closed);
  /// As the spool has it.
  void end(const SpoolSession& session);

 private:
  void removeCutLine(const std::string& path);
  void line(const std::string& text);
  int fd_ = -1;
};

}  // namespace needlelab::test
