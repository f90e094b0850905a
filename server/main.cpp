// needlelab-server: stores stations' recordings, serves people, distributes live samples.
#include <fmt/core.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <map>
#include <string>
#include <string_view>

#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/base/usage/usage.h"
#include "common/wire/protocol.h"
#include "db/backup/encrypted_backup.h"
#include "server/base/log.h"
#include "server/nats/nats_address.h"
#include "server/server.h"
#include "server/service_manager.h"
#include "server/web/routes.h"

namespace {

/// A thousand stations need a thousand sockets; the usual soft limit is 1024 files.
void raiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= limit.rlim_max) return;
  limit.rlim_cur = limit.rlim_max;
  if (setrlimit(RLIMIT_NOFILE, &limit) != 0) {
    needlelab::logEvent(needlelab::LogLevel::kWarning, "file_limit_not_raised", {});
  }
}

}  // namespace

int main(int argc, char** argv) try {
  needlelab::keepOutOfCoreDumps();
  needlelab::keepProtobufQuiet();
  needlelab::ServerOptions options;
  options.handle_signals = true;
  std::string log_level = "info", log_format = "text";
  std::uint64_t min_free_mib = 64;
  double max_backup_age_h = 0;
  unsigned retention_every_h = 24;

  CLI::App app("needlelab-server: stores what stations record, serves people, fans out live samples.");
  app.set_version_flag("--version", "needlelab-server " + needlelab::programVersion());
  app.add_option("--data", options.data, "Folder of the database and of tls/; made at the first start")
      ->required();
  app.add_option(
         "--store", options.store_url,
         "At the first start: the database is on PostgreSQL, at postgresql://USER@HOST/DATABASE, and DIR "
         "has keys and lists only (DIR/store remembers it). Without it: DIR/needlelab.db")
      ->type_name("URL");
  app.add_flag("--together", options.together,
               "Other servers, each with a DIR of its own (needlelab-admin server join) and started with "
               "--together, work on the same database on PostgreSQL");
  const std::map<std::string, needlelab::Durability> levels = {
      {"any", needlelab::Durability::kNothing},
      {"power-cut", needlelab::Durability::kPowerCut},
      {"two-disks", needlelab::Durability::kDiskLoss}};
  app.add_option(
         "--durability", options.min_durability,
         "What an ack must survive, or nothing is stored: any, power-cut or two-disks (PostgreSQL with "
         "a synchronous standby by name; an ack then makes a recording Safe)")
      ->transform(CLI::CheckedTransformer(levels))
      ->default_str("any");
  app.add_option("--listen", options.listen, "HOST:PORT to listen on; port 0 picks a free one")
      ->capture_default_str();
  app.add_option("--port-file", options.port_file, "Write the port to this file once the server listens");
  app.add_option("--host-name", options.host_names,
                 "Further name or address for the server's certificate; may be repeated, or A,B")
      ->delimiter(',');
  app.add_option(
      "--ca-domain", options.ca_domains,
      "At the first start: the certificate authority may sign names in this domain, and no others; "
      "may be repeated. Without it: the names of --host-name");
  app.add_option(
      "--metrics", options.metrics,
      "PORT or HOST:PORT for GET /metrics (Prometheus) and /healthz; a port alone is on 127.0.0.1");
  app.add_option("--metrics-port-file", options.metrics_port_file,
                 "Write the port of --metrics to this file");
  options.web.listen = "127.0.0.1:7751";
  auto* const web =
      app.add_option("--web", options.web.listen,
                     "HOST:PORT for browsers (HTTPS, the same certificate), or off; port 0 picks a free one")
          ->capture_default_str();
  app.add_option("--web-port-file", options.web.port_file, "Write the port of --web to this file");
  app.add_option("--web-root", options.web.root,
                 "Folder of the console's files; default: where they were installed or built");
  app.add_option(
      "--web-proxy", options.web.proxies,
      "ADDRESS or ADDRESS/BITS of a reverse proxy in front of --web: its header says who asks; may "
      "be repeated");
  app.add_option("--web-proxy-header", options.web.proxy_header,
                 "The header that the proxy writes: X-Forwarded-For or Forwarded")
      ->capture_default_str();
  app.add_option("--max-backup-age", max_backup_age_h,
                 "/healthz fails when the last verified backup is older than so many hours; 0: never")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--backup-key", options.backup_key,
                 "File of a key (needlelab-admin backup-key new): backups are encrypted with it. Without it: "
                 "$CREDENTIALS_DIRECTORY/backup.key, if there is one")
      ->type_name("FILE");
  app.add_option(
         "--retention-every", retention_every_h,
         "Hours between two runs of retention, the first 10 minutes after the start; 0: only when asked")
      ->check(CLI::Range(0u, 8760u))
      ->capture_default_str();
  app.add_option("--max-connections", options.max_connections,
                 "Connections at once; beyond that, whoever has the most of them loses one")
      ->check(CLI::Range(std::size_t{1}, std::size_t{100'000}))
      ->capture_default_str();
  app.add_option(
         "--min-free", min_free_mib,
         "MiB of DIR's disk below which nothing recorded is stored, and a new folder is not made; below four "
         "times as much no session is begun; 0: nothing is refused")
      ->capture_default_str();
  app.add_option("--live", options.live.nats.address,
                 "The NATS that connects the lab's servers for live views: nats://HOST:PORT or "
                 "tls://HOST:PORT, several separated by commas. Without it: the lab has one server")
      ->type_name("URL");
  app.add_option("--live-ca", options.live.nats.ca,
                 "Authority of the NATS servers' certificates, with tls://; default: the system's")
      ->type_name("FILE");
  app.add_option("--live-user", options.live.nats.user,
                 "File of this server's user at NATS: lines 'user = NAME' and 'password = TEXT', or NATS's "
                 "own (.creds). Without it: $CREDENTIALS_DIRECTORY/nats.user, if there is one")
      ->type_name("FILE");
  app.add_option(
      "--live-name", options.live.name,
      "This server's name among the lab's servers, for people; default: as needlelab-admin server join "
      "named it, without --together the machine's");
  app.add_option("--live-lab", options.live.lab,
                 "The lab's name in NATS's subjects; default: the id of the database (PostgreSQL)");
  app.add_option("--log-format", log_format, "text or json, one object a line")->capture_default_str();
  app.add_option("--log-level", log_level, "debug, info, warning, error or off")->capture_default_str();
  app.add_flag_callback(
      "--openapi",
      [] {
        const std::string_view text = needlelab::openApiText();
        std::fwrite(text.data(), 1, text.size(), stdout);
        throw CLI::Success();
      },
      "Print the description of the web interface (OpenAPI 3.1, JSON) and end");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return needlelab::afterOutput(needlelab::endOfParsing(app, error, argc, argv), "needlelab-server");
  }

  const auto fail = [](const needlelab::Error& error) {
    std::fprintf(stderr, "needlelab-server: %s\n", error.message.c_str());
    return needlelab::exitCodeOf(error);
  };
  const auto level = needlelab::parseLogLevel(log_level);
  if (!level.ok()) return fail(level.error());
  needlelab::setLogLevel(*level);
  const auto format = needlelab::parseLogFormat(log_format);
  if (!format.ok()) return fail(format.error());
  needlelab::setLogFormat(*format);
  options.min_free_bytes = min_free_mib << 20;
  options.backup_key = needlelab::backupKeyFile(options.backup_key);
  if (!options.live.nats.address.empty())
    options.live.nats.user = needlelab::natsUserFile(options.live.nats.user);
  // if the default web port is taken, e.g. by a second server on the machine, run without it
  options.web_optional = web->count() == 0;
  options.retention_every = std::chrono::hours(retention_every_h);
  options.monitor.max_backup_age = std::chrono::seconds(static_cast<std::int64_t>(max_backup_age_h * 3600));

  // before starting threads, because it removes environment variables
  const auto handed_over = needlelab::takeListenSockets();
  if (!handed_over.ok()) return fail(handed_over.error());
  if (handed_over->size() > 1)
    return fail({needlelab::ErrorCode::kInvalidInput,
                 fmt::format("systemd hands over {} sockets, one is used", handed_over->size())});
  if (!handed_over->empty()) options.listen_fd = handed_over->front();
  raiseFileLimit();
  auto server = needlelab::Server::start(std::move(options));
  if (!server.ok()) return fail(server.error());
  return (*server)->run();
} catch (const std::exception& error) {
  // e.g. out of memory or threads: report it in one line; unacknowledged data is still in the stations'
  // spools
  std::fprintf(stderr, "needlelab-server: %s\n", error.what());
  return needlelab::kExitFailed;
}
