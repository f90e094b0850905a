/// The ledger that a station under test writes for the judge: one line of JSON per event, each appended with
/// a single write, so that killing this program cuts off at most its last line; the next start removes that.
/// Fields: judge/ledger.py.
#pragma once

#include <mutex>
#include <string>

#include "client/net/spool/spool.h"
#include "common/gesture/sample.h"
#include "needlelab/session.pb.h"

namespace needlelab::test {

/// Owns its file. Thread: any.
class StationLedger {
 public:
  /// Throws std::runtime_error if the file cannot be opened.
  explicit StationLedger(const std::string& path);
  ~StationLedger();
  StationLedger(const StationLedger&) = delete;
  StationLedger& operator=(const StationLedger&) = delete;

  void session(const pb::SessionDescription& description);
  /// Of the last session named.
  void sample(const GestureSample& sample);
  void acknowledged(const pb::Ack& ack);
  void closed(const pb::SessionClosed& closed);
  /// As recorded in the spool.
  void end(const SpoolSession& session);

 private:
  void removeCutLine(const std::string& path);
  void line(const std::string& text);
  int fd_ = -1;
};

}  // namespace needlelab::test
