// The server's certificate: what it says, and a new one. Works on DIR/tls, whether the server runs or not.
#include <algorithm>
#include <memory>

#include "client/admin/command.h"
#include "common/base/clock.h"
#include "common/wire/certificates.h"

namespace needlelab {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

Status show(const std::filesystem::path& folder, Output& output) {
  const TlsFiles files = tlsFilesIn(folder / "tls");
  const std::pair<const char*, std::filesystem::path> both[] = {{"authority", files.ca_certificate},
                                                                {"server", files.certificate}};
  Json rows = Json::array();
  for (const auto& [what, path] : both) {
    const auto facts = readCertificate(path);
    if (!facts) return facts.error();
    std::string hosts;
    for (const std::string& host : facts->hosts) hosts += (hosts.empty() ? "" : ", ") + host;
    rows.push_back({{"what", what},
                    {"file", path.string()},
                    {"subject", facts->subject},
                    {"hosts", hosts},
                    {"not_before_unix_ns", facts->not_before_unix_s * kSecond},
                    {"not_after_unix_ns", facts->not_after_unix_s * kSecond},
                    {"days_left", (facts->not_after_unix_s - wallNowNs() / kSecond) / 86'400},
                    {"sha256", facts->sha256}});
  }
  return output.list({{"what", "CERTIFICATE"},
                      {"not_after_unix_ns", "VALID UNTIL", Column::Kind::kTime},
                      {"days_left", "DAYS LEFT"},
                      {"hosts", "FOR"},
                      {"sha256", "SHA-256"}},
                     rows);
}

Status renew(const std::filesystem::path& folder, Output& output, const std::vector<std::string>& hosts) {
  const TlsFiles files = tlsFilesIn(folder / "tls");
  if (auto done = renewServerCertificate(files, hosts); !done) return done;
  const auto facts = readCertificate(files.certificate);
  if (!facts) return facts.error();
  std::string names;
  for (const std::string& host : facts->hosts) names += (names.empty() ? "" : ", ") + host;
  output.done(
      "a new certificate for " + names + ", until " + timeText(facts->not_after_unix_s * kSecond) +
      "; a server that runs takes it at its next start. Stations need nothing: the authority is the same");
  return {};
}

}  // namespace

void addCertificateCommands(CLI::App& app, ChosenCommand& chosen) {
  auto* certificate = app.add_subcommand("certificate", "by which stations know the server (needs --data)");
  certificate->require_subcommand(1);
  const auto hosts = std::make_shared<std::vector<std::string>>();

  certificate->add_subcommand("show", "until when they are valid, and for which names")->callback([&chosen] {
    chosen.run_on_files = show;
  });
  auto* renew_command = certificate->add_subcommand(
      "renew",
      "make the server a new one by the same authority, for the old names and these; needs tls/ca.key");
  renew_command->add_option("--host-name", *hosts, "a further name or address; may be repeated")
      ->type_name("HOST");
  renew_command->callback([&chosen, hosts] {
    chosen.run_on_files = [hosts](const std::filesystem::path& folder, Output& output) {
      return renew(folder, output, *hosts);
    };
  });
}

}  // namespace needlelab
