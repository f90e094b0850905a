// The metrics: names, meanings and sources.
#include <fmt/core.h>
#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <map>
#include <string>

#include "common/base/program.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "db/service/requests/requests.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/login_state.h"
#include "server/live/monitor/monitor.h"
#include "server/live/port/live_peer.h"
#include "server/live/work/server_work.h"
#include "server/together/remote_live.h"
#include "server/together/server_together.h"

namespace needlelab {

namespace {

[[maybe_unused]] bool isName(std::string_view name) {
  if (name.empty() || (name[0] >= '0' && name[0] <= '9')) return false;
  for (const char c : name) {
    if (!isLetterOrDigit(c) && c != '_' && c != ':') return false;
  }
  return true;
}

void appendEscaped(std::string& out, std::string_view text, bool quotes) {
  for (const char c : text) {
    if (c == '\\' || (quotes && c == '"')) out += '\\';
    if (c == '\n') {
      out += "\\n";
    } else {
      out += c;
    }
  }
}

/// The shortest digits that parse to the same number; NaN, +Inf and -Inf in Prometheus's notation.
void appendNumber(std::string& out, double value) {
  if (std::isnan(value)) {
    out += "NaN";
  } else if (std::isinf(value)) {
    out += value > 0 ? "+Inf" : "-Inf";
  } else {
    char digits[40];
    const auto [end, error] = std::to_chars(digits, digits + sizeof digits, value);
    assert(error == std::errc());
    out.append(digits, end);
  }
}

}  // namespace

void PrometheusText::metric(std::string_view name, std::string_view type, std::string_view help) {
  assert(isName(name));
  name_ = name;
  text_ += "# HELP " + name_ + ' ';
  appendEscaped(text_, help, false);
  text_ += "\n# TYPE " + name_ + ' ';
  text_ += type;
  text_ += '\n';
}

void PrometheusText::sample(double value, Labels labels, std::string_view suffix) {
  text_ += name_;
  text_ += suffix;
  char separator = '{';
  for (const auto& [label, text] : labels) {
    assert(isName(label));
    text_ += std::exchange(separator, ',');
    text_ += label;
    text_ += "=\"";
    appendEscaped(text_, text, true);
    text_ += '"';
  }
  if (separator == ',') text_ += '}';
  text_ += ' ';
  appendNumber(text_, value);
  text_ += '\n';
}

void PrometheusText::counter(std::string_view name, double value, std::string_view help) {
  metric(name, "counter", help);
  sample(value);
}

void PrometheusText::gauge(std::string_view name, double value, std::string_view help) {
  metric(name, "gauge", help);
  sample(value);
}

namespace {

double real(std::uint64_t count) {
  return static_cast<double>(count);
}

/// `unit`: of the stored values, e.g. 1e-9 for ns shown as seconds.
template <typename Histogram>
void histogram(PrometheusText& out, std::string_view name, const Histogram& values, double unit,
               std::string_view help) {
  out.metric(name, "histogram", help);
  std::uint64_t through = 0;
  const auto bounds = values.bounds();
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    through += values.buckets()[i];
    const std::string bound = fmt::format("{:g}", static_cast<double>(bounds[i]) * unit);
    out.sample(real(through), {{"le", bound}}, "_bucket");
  }
  out.sample(real(values.count()), {{"le", "+Inf"}}, "_bucket");
  out.sample(static_cast<double>(values.sum()) * unit, {}, "_sum");
  out.sample(real(values.count()), {}, "_count");
}

/// Sums over the open connections.
struct Open {
  std::map<std::pair<int, int>, std::uint64_t> by_role_and_state;
  std::uint64_t control_bytes = 0, max_control_bytes = 0, live_bytes = 0, live_dropped = 0;
  std::uint64_t bytes_received = 0, bytes_sent = 0;
};

Open openConnections(const ServerContext& context) {
  Open open;
  for (const auto& [id, peer] : context.connections) {
    ++open.by_role_and_state[{static_cast<int>(peer->who().role), static_cast<int>(peer->state())}];
    const Channel& channel = peer->channel();
    open.control_bytes += channel.controlQueueBytes();
    open.max_control_bytes = std::max<std::uint64_t>(open.max_control_bytes, channel.controlQueueBytes());
    open.live_bytes += channel.live().bytes();
    open.live_dropped += channel.live().dropped();
    open.bytes_received += channel.bytesReceived();
    open.bytes_sent += channel.bytesSent();
  }
  return open;
}

void connections(PrometheusText& out, const ServerContext& context, const Open& open) {
  const ServerCounters& counters = context.counters;
  out.metric("needlelab_connections", "gauge", "Connections by role (none: not logged in) and state.");
  for (int role = pb::ROLE_UNSPECIFIED; role <= pb::Role_MAX; ++role) {
    for (int state = 0; state < static_cast<int>(ConnectionState::kClosed); ++state) {
      const auto found = open.by_role_and_state.find({role, state});
      const std::string_view name =
          role == pb::ROLE_UNSPECIFIED ? "none" : roleName(static_cast<pb::Role>(role));
      out.sample(found == open.by_role_and_state.end() ? 0 : real(found->second),
                 {{"role", name}, {"state", nameOf(static_cast<ConnectionState>(state))}});
    }
  }
  out.counter("needlelab_connections_total", real(counters.connections), "Connections accepted.");
  out.counter("needlelab_connections_refused_total", real(counters.connections_refused),
              "Connections closed at once because there were too many.");
  out.counter("needlelab_handshakes_failed_total", real(counters.handshakes_failed),
              "TLS handshakes that failed or took too long.");
  out.counter("needlelab_logins_total", real(counters.logins), "Log-ins that succeeded.");
  out.counter("needlelab_logins_refused_total", real(counters.logins_refused), "Log-ins refused.");
  out.counter("needlelab_messages_refused_total", real(counters.messages_refused), "Messages refused.");
  out.counter("needlelab_messages_refused_unparsed_total", real(counters.messages_refused_unparsed),
              "Messages refused by their first bytes.");
  out.metric("needlelab_messages_parsed_total", "counter", "Messages parsed, by thread; not live frames.");
  out.sample(real(counters.messages_parsed - counters.messages_parsed_off_thread), {{"thread", "network"}});
  out.sample(real(counters.messages_parsed_off_thread), {{"thread", "parsers"}});
  out.counter("needlelab_decoded_bytes_total", real(counters.decoded_bytes),
              "Memory that parsed messages took, an estimate.");
  out.gauge("needlelab_decoded_bytes_in_flight", real(context.in_flight.decoded.taken()),
            "Memory of larger messages and bodies that are not done yet, an estimate.");
  out.gauge("needlelab_reply_bytes_unread", real(context.in_flight.replies.taken()),
            "Bytes of replies that are being made (1 MiB each) or are not read yet.");
  out.gauge("needlelab_logins_waiting", real(context.logins.waiting.size()),
            "Log-ins of people that wait for the password check.");
  out.counter("needlelab_received_bytes_total", real(counters.bytes_received + open.bytes_received),
              "Bytes received from peers, without TLS.");
  out.counter("needlelab_sent_bytes_total", real(counters.bytes_sent + open.bytes_sent),
              "Bytes sent to peers, without TLS.");
}

void durablePlane(PrometheusText& out, const ServerContext& context, const StoreFacts& facts) {
  const ServerCounters& counters = context.counters;
  out.metric("needlelab_chunks_total", "counter", "Chunks received, by what became of them.");
  out.sample(real(counters.chunks_stored), {{"result", "stored"}});
  out.sample(real(counters.chunks_repeated), {{"result", "repeated"}});
  out.sample(real(counters.chunks_refused), {{"result", "refused"}});
  out.counter("needlelab_chunks_quarantined_total", real(counters.chunks_quarantined),
              "Chunks stored as they came that cannot be decoded.");
  out.counter("needlelab_chunks_contradicting_total", real(counters.chunks_contradicting),
              "Chunks refused because other bytes are stored in their place.");
  out.gauge("needlelab_chunks_in_flight", real(context.in_flight.chunks.taken()),
            "Chunks received and not yet committed.");
  out.gauge("needlelab_chunk_bytes_in_flight", real(context.in_flight.chunk_bytes.taken()),
            "Bytes of these chunks.");
  out.counter("needlelab_acks_total", real(counters.acks),
              "Acknowledgements sent; one may cover many chunks.");
  out.counter("needlelab_stations_deposed_total", real(counters.stations_deposed),
              "Connections that ended because their station had logged in again, perhaps at another server.");
  out.counter("needlelab_sessions_closed_total", real(counters.sessions_closed), "Sessions closed.");
  out.gauge("needlelab_sessions_open", real(facts.sessions_open),
            "Sessions in the database that are not closed.");

  const DbWriter::Counters writer = context.store.writer().counters();
  out.gauge("needlelab_writer_failed", context.store.writer().failed() ? 1 : 0,
            "1 after a write or fsync failed: nothing is stored any more.");
  out.gauge("needlelab_writer_queue_items", real(writer.waiting),
            "Items that wait for the database's writer.");
  out.counter("needlelab_writer_items_total", real(writer.items), "Items committed.");
  out.counter("needlelab_writer_items_refused_total", real(writer.refused), "Items that failed alone.");
  out.counter("needlelab_writer_chunks_together_total", real(writer.together),
              "Chunks that were stored with others in one statement (PostgreSQL).");
  out.counter("needlelab_writer_chunks_checked_ahead_total", real(writer.checked_ahead),
              "Chunks that were checked while the writer waited for the engine's server (PostgreSQL).");
  histogram(out, "needlelab_commit_seconds", writer.commit_ns, 1e-9, "COMMIT of a group, fsync included.");
  histogram(out, "needlelab_group_work_seconds", writer.work_ns, 1e-9,
            "A group's work from BEGIN to COMMIT.");
  histogram(out, "needlelab_checkpoint_seconds", writer.checkpoint_ns, 1e-9,
            "A checkpoint of the write-ahead log.");
  histogram(out, "needlelab_commit_group_items", writer.group_items, 1, "Items committed together.");
}

void livePlane(PrometheusText& out, const ServerContext& context, const Open& open) {
  out.counter("needlelab_live_frames_received_total", real(context.hub.framesIn()),
              "Live frames from stations.");
  out.counter("needlelab_live_frames_sent_total", real(context.hub.framesOut()),
              "Live frames given to viewers.");
  out.counter("needlelab_live_frames_dropped_total", real(context.counters.live_dropped + open.live_dropped),
              "Live frames dropped because a viewer was too slow.");
  out.gauge("needlelab_stations_online", real(context.hub.stationsOnline() - context.hub.remoteStations()),
            "Stations that are connected to this server.");
  out.gauge("needlelab_control_queue_bytes", real(open.control_bytes),
            "Unsent control messages, all connections.");
  out.gauge("needlelab_control_queue_bytes_largest", real(open.max_control_bytes),
            "Unsent control messages of the connection that has most.");
  out.gauge("needlelab_live_queue_bytes", real(open.live_bytes), "Unsent live frames, all connections.");
}

/// Metrics between the servers of a lab; none if it has only one.
void otherServers(PrometheusText& out, const ServerContext& context) {
  if (context.together.remote == nullptr) return;
  const RemoteLive& remote = *context.together.remote;
  const RemoteLive::Counters& counters = remote.counters();
  const LiveCarrier::Counters carried = remote.carried();
  out.gauge("needlelab_live_link_up", remote.isUp() ? 1 : 0,
            "1 while the live connection between the lab's servers is up.");
  out.counter("needlelab_live_link_connections_total", real(carried.connections),
              "Connections to NATS that were made.");
  out.gauge("needlelab_live_servers", real(remote.servers().size()),
            "Other servers of the lab that are heard.");
  out.gauge("needlelab_live_name_taken", remote.duplicateName().empty() ? 0 : 1,
            "1 while another server of the lab has this one's name.");
  out.gauge("needlelab_stations_elsewhere", real(context.hub.remoteStations()),
            "Stations that are connected to other servers of the lab.");
  out.gauge("needlelab_stations_watched_elsewhere", real(remote.remotelyWatched()),
            "Stations of this server that are watched at others.");
  out.metric("needlelab_live_link_messages_total", "counter", "Messages between the lab's servers.");
  out.sample(real(carried.messages_in), {{"direction", "in"}});
  out.sample(real(carried.messages_out), {{"direction", "out"}});
  out.metric("needlelab_live_link_bytes_total", "counter", "Bytes of these messages.");
  out.sample(real(carried.bytes_in), {{"direction", "in"}});
  out.sample(real(carried.bytes_out), {{"direction", "out"}});
  out.metric(
      "needlelab_live_link_dropped_total", "counter",
      "Messages between the lab's servers that were dropped: the queue was full, or the link was down.");
  out.sample(real(carried.dropped_in), {{"direction", "in"}});
  out.sample(real(carried.dropped_out), {{"direction", "out"}});
  out.metric(
      "needlelab_live_link_refused_total", "counter",
      "Messages between the lab's servers that were not used: malformed or of another lab, too late or "
      "of a server that has not the station, not permitted by NATS.");
  out.sample(real(counters.malformed + carried.malformed), {{"why", "malformed"}});
  out.sample(real(counters.stale), {{"why", "stale"}});
  out.sample(real(carried.refused), {{"why", "not_permitted"}});
  out.metric("needlelab_live_asked_total", "counter",
             "Messages of people to stations at other servers: sent, and what became of them.");
  out.sample(real(counters.asked), {{"what", "sent"}});
  out.sample(real(counters.answered), {{"what", "answered"}});
  out.sample(real(counters.not_here), {{"what", "not_here"}});
  out.sample(real(counters.unanswered), {{"what", "unanswered"}});
}

void storage(PrometheusText& out, const ServerContext& context, const StoreFacts& facts) {
  out.gauge("needlelab_database_bytes", real(facts.database_bytes), "Size of the database's file.");
  out.gauge("needlelab_wal_bytes", real(facts.wal_bytes), "Size of the write-ahead log's file.");
  out.gauge("needlelab_wal_pages_waiting", real(context.store.writer().counters().wal_pages_waiting),
            "Pages in the log that the last checkpoint left there.");
  out.gauge("needlelab_erasure_pending", context.store.writer().counters().log_pending ? 1 : 0,
            "1 while the log still has what was erased, because somebody reads.");
  out.gauge("needlelab_clock_ahead", facts.clock_ahead ? 1 : 0,
            "1 while the clock has jumped ahead, so that retention removes nothing by itself.");
  out.gauge(
      "needlelab_ack_survives", static_cast<double>(facts.durability),
      "What an ack survives. 0: nothing; 1: the end of a program; 2: a power cut; 3: the loss of a disk.");
  out.gauge("needlelab_acknowledged_missing", context.store.writer().lack().empty() ? 0 : 1,
            "1 when PostgreSQL turned out to lack what was acknowledged, until the server's end.");
  if (context.together.access_listener) {
    const auto hearing = context.together.access_listener->hearing();
    out.gauge("needlelab_access_heard", hearing.is_deaf || !hearing.fault.empty() ? 0 : 1,
              "Of a server of several on one database: 1 when it hears of the others' access changes.");
    out.gauge("needlelab_access_silence_seconds", hearing.silence_s,
              "Seconds since the other servers' access changes were last known; below 0: never.");
    out.counter("needlelab_access_changes_total", real(hearing.changes),
                "Access changes at other servers that it was told of.");
    out.counter("needlelab_access_connections_total", real(hearing.connections),
                "Number of connections made for hearing access changes.");
  }
  out.gauge("needlelab_disk_free_bytes", real(facts.free_bytes),
            "Free on the disk of the data folder (on SQLite with the database, on PostgreSQL with keys and "
            "lists).");
  out.gauge("needlelab_disk_room_level", static_cast<double>(context.limits.disk_room.level()),
            "Room on the disk of the data folder. 0: enough; 1: no new session is taken; 2: nothing recorded "
            "is stored.");
  out.gauge("needlelab_read_only", context.store.readOnly() ? 1 : 0,
            "1 when the disk of the data folder was too full at the start to open the database in it for "
            "writing.");
  out.counter(
      "needlelab_refused_for_room_total", real(context.counters.refused_for_room),
      "Sessions, chunks and requests refused because the disk, or a station's or a person's share, is "
      "used up.");
  out.gauge("needlelab_disk_size_bytes", real(facts.disk_bytes), "Size of the disk of the data folder.");
  out.gauge("needlelab_database_readable", facts.fault.empty() ? 1 : 0,
            "0 when the database could not be read.");
  // without a backup the metric is absent; the alarm also fires then
  out.metric("needlelab_backup_age_seconds", "gauge",
             "Age of the last verified backup; absent when there is none.");
  if (facts.backup_unix_ns) out.sample(static_cast<double>(wallNowNs() - *facts.backup_unix_ns) / 1e9);
  out.gauge("needlelab_unsafe_chunks", real(facts.unsafe_chunks),
            "Chunks committed that are not Safe: in no verified backup on another disk nor, with "
            "--durability two-disks, "
            "on two disks by their ack.");
  out.counter("needlelab_backups_total", real(context.counters.backups), "Verified backups made.");
  if (facts.certificate_end_unix_s != 0)
    out.gauge("needlelab_certificate_not_after_seconds", static_cast<double>(facts.certificate_end_unix_s),
              "When the server's certificate ends, seconds since 1970.");
}

void browsers(PrometheusText& out, const ServerContext& context) {
  const WebCounters& web = context.web;
  out.gauge("needlelab_web_connections", real(web.connections_open), "Connections of browsers.");
  out.counter("needlelab_web_connections_total", real(web.connections), "Connections of browsers accepted.");
  out.counter("needlelab_web_connections_refused_total", real(web.connections_refused),
              "Connections of browsers closed at once because there were too many.");
  out.counter("needlelab_web_handshakes_failed_total", real(web.handshakes_failed),
              "TLS handshakes of browsers that failed or took too long.");
  out.gauge("needlelab_web_live_viewers", real(web.live_open), "Live pages that are open.");
  out.counter("needlelab_web_live_dropped_total", real(web.live_dropped),
              "Live pages that were cut because they did not read.");
  out.metric("needlelab_web_requests_total", "counter",
             "Requests of browsers answered, by route and status.");
  const std::map<std::string, std::map<unsigned, std::uint64_t>> sorted(web.requests.begin(),
                                                                        web.requests.end());
  for (const auto& [route, by_status] : sorted) {
    for (const auto& [status, count] : by_status)
      out.sample(real(count), {{"route", route}, {"status", std::to_string(status)}});
  }
  out.metric("needlelab_web_request_seconds", "histogram",
             "From a request's header to the end of its reply.");
  std::uint64_t through = 0;
  for (std::size_t i = 0; i < WebCounters::kLatency_s.size(); ++i) {
    through += web.latency[i];
    const std::string bound = fmt::format("{:g}", WebCounters::kLatency_s[i]);
    out.sample(real(through), {{"le", bound}}, "_bucket");
  }
  through += web.latency.back();
  out.sample(real(through), {{"le", "+Inf"}}, "_bucket");
  out.sample(web.latency_sum_s, {}, "_sum");
  out.sample(real(through), {}, "_count");
}

void process(PrometheusText& out, const ProcessFacts& facts) {
  out.counter("process_cpu_seconds_total", facts.cpu_s, "Processor time, user and system.");
  out.gauge("process_resident_memory_bytes", real(facts.rss_bytes), "Resident memory.");
  out.gauge("needlelab_heap_live_bytes", real(facts.heap_live_bytes),
            "Memory that the program has taken from the C library and not returned.");
  out.gauge("process_open_fds", real(facts.open_files), "Open files.");
  out.gauge("process_max_fds", real(facts.max_files), "Most files that may be open.");
  out.gauge("process_threads", real(facts.threads), "Threads.");
  out.gauge("process_start_time_seconds", facts.started_unix_s,
            "When the process was started, seconds since 1970.");
  out.metric("needlelab_build_info", "gauge", "1, with the version in its labels.");
  out.sample(1, {{"version", programVersion()}, {"compiler", __VERSION__}});
}

}  // namespace

std::string metricsText(const ServerContext& context, const StoreFacts& facts) {
  const Open open = openConnections(context);
  PrometheusText out;
  connections(out, context, open);
  durablePlane(out, context, facts);
  livePlane(out, context, open);
  otherServers(out, context);
  storage(out, context, facts);
  browsers(out, context);
  process(out, facts.process);
  return out.text();
}

}  // namespace needlelab
