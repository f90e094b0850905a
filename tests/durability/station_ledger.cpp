#include "tests/durability/station_ledger.h"

#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "client/net/spool/spool_json.h"
#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab::test {
namespace {

using Json = nlohmann::json;

// "no wall" is null
Json number(double value) {
  return std::isnan(value) ? Json() : Json(value);
}

}  // namespace

StationLedger::StationLedger(const std::string& path)
    : fd_(::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0600)) {
  if (fd_ < 0) throw std::runtime_error("cannot open the ledger " + path);
  removeCutLine(path);
}

StationLedger::~StationLedger() {
  ::close(fd_);
}

/// The kernel ends a write at a page boundary if the program is killed there: the next line must not be
/// joined to such a fragment.
void StationLedger::removeCutLine(const std::string& path) {
  const off_t end = ::lseek(fd_, 0, SEEK_END);
  off_t whole = end;
  char last = 0;
  while (whole > 0 && ::pread(fd_, &last, 1, whole - 1) == 1 && last != '\n') --whole;
  if (end < 0 || (whole != end && ::ftruncate(fd_, whole) != 0))
    throw std::runtime_error("cannot look at the end of the ledger " + path);
}

void StationLedger::line(const std::string& text) {
  const std::string whole = text + "\n";
  if (::write(fd_, whole.data(), whole.size()) != static_cast<ssize_t>(whole.size()))
    throw std::runtime_error("the ledger cannot be written");
}

void StationLedger::session(const pb::SessionDescription& description) {
  const Resolution r = resolutionOf(description);
  line(Json{{"e", "session"},
            {"id", hexDigitsOf(description.session_id())},
            {"station", description.station()},
            {"resolution", {r.length_m, r.quaternion, r.force_N, r.torque_Nm, r.time_s, r.speed_mps}}}
           .dump());
}

void StationLedger::sample(const GestureSample& s) {
  // in the order of FORMAT.md's columns
  Json values = {s.tick, s.time_ns};
  const auto put = [&values](const auto& group) {
    for (const double value : group) values.push_back(number(value));
  };
  put(s.p_WT_m);
  put(s.q_WT);
  values.push_back(s.speed_mps);
  put(s.force_W_N);
  put(s.torque_W_Nm);
  put(s.wall_W_m);
  for (const double value : {s.insertion_m, s.lateral_error_m, s.plunger}) values.push_back(value);
  for (const std::int64_t value :
       {std::int64_t{s.device_ns}, std::int64_t{s.engine_ns}, std::int64_t{s.flags & 0xFFFF},
        std::int64_t{s.flags >> 16}, std::int64_t{s.buttons}, std::int64_t{s.layer}, std::int64_t{s.phase},
        std::int64_t{s.fault}})
    values.push_back(value);
  line(Json{{"e", "s"}, {"t", steadyNowNs()}, {"v", std::move(values)}}.dump());
}

void StationLedger::acknowledged(const pb::Ack& ack) {
  line(Json{{"e", "ack"},
            {"id", hexDigitsOf(ack.session_id())},
            {"t", wallNowNs()},
            {"committed", ack.committed_seqs()},
            {"safe", ack.safe_seqs()}}
           .dump());
}

void StationLedger::closed(const pb::SessionClosed& closed) {
  line(Json{{"e", "closed"},
            {"id", hexDigitsOf(closed.session_id())},
            {"t", wallNowNs()},
            {"state", static_cast<int>(closed.state())}}
           .dump());
}

void StationLedger::end(const SpoolSession& session) {
  const auto read = readSpoolJson(session.folder() / "end.json");
  if (!read.ok() || !read->is_object()) throw std::runtime_error(session.folder().string() + " has no end");
  Json end = *read;
  end["e"] = "end";
  end["id"] = hexDigitsOf(session.description().session_id());
  line(end.dump());
}

}  // namespace needlelab::test
