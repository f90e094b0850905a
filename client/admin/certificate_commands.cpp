// The server's certificate and the authority that signs it. Works on DIR/tls, with the server running or
// stopped.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/admin/command.h"
#include "common/base/time/clock.h"
#include "common/wire/certificates.h"
#include "common/wire/tls_folder.h"

namespace needlelab {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

Status show(const std::filesystem::path& folder, Output& output) {
  const TlsFiles files = tlsFilesIn(folder / "tls");
  const std::pair<const char*, std::filesystem::path> both[] = {{"authority", files.ca_certificate},
                                                                {"server", files.certificate}};
  Json rows = Json::array();
  for (const auto& [what, path] : both) {
    ASSIGN_OR_RETURN(const auto certificates, readCertificates(path));
    for (const CertificateFacts& facts : certificates) {
      std::string hosts = facts.may_sign;
      for (const std::string& host : facts.hosts) hosts += (hosts.empty() ? "" : ", ") + host;
      rows.push_back({{"what", what},
                      {"file", path.string()},
                      {"subject", facts.subject},
                      {"hosts", hosts},
                      {"not_before_unix_ns", facts.not_before_unix_s * kSecond},
                      {"not_after_unix_ns", facts.not_after_unix_s * kSecond},
                      {"days_left", (facts.not_after_unix_s - wallNowNs() / kSecond) / 86'400},
                      {"sha256", facts.sha256}});
    }
  }
  return output.list({{"what", "CERTIFICATE"},
                      {"not_before_unix_ns", "VALID FROM", Column::Kind::kTime},
                      {"not_after_unix_ns", "VALID UNTIL", Column::Kind::kTime},
                      {"days_left", "DAYS LEFT"},
                      {"hosts", "FOR"},
                      {"sha256", "SHA-256"}},
                     rows);
}

/// The folder's files for a command that writes them; removes what a killed command left there.
TlsFiles filesToWrite(const std::filesystem::path& folder, Output& output) {
  TlsFiles files = tlsFilesIn(folder / "tls");
  const auto removed = removeTlsLeftovers(files);
  if (!removed) output.remark(removed.error().message);
  if (removed)
    for (const std::string& path : *removed)
      output.remark("removed " + oneLine(path) +
                    ", which a program that was cut off left; it may hold a private key");
  return files;
}

Status renew(const std::filesystem::path& folder, Output& output, const std::vector<std::string>& hosts) {
  const TlsFiles files = filesToWrite(folder, output);
  ASSIGN_OR_RETURN(const bool renewed, renewOrPrepare(files, hosts));
  if (!renewed) {
    const std::string names = fmt::format("{}", fmt::join(hosts, ","));
    output.done("the lab's authority may not sign " + names + ", so another one is prepared that may; " +
                files.ca_certificate.string() +
                " has both. Bring this file to every station, instructor and browser, then give the server "
                "its new name by `certificate authority switch --host-name " +
                names + "`; until then it keeps its certificate");
    return {};
  }
  ASSIGN_OR_RETURN(const auto facts, readCertificate(files.certificate));
  std::string names;
  for (const std::string& host : facts.hosts) names += (names.empty() ? "" : ", ") + host;
  output.done(
      "a new certificate for " + names + ", until " +
      localTime(facts.not_after_unix_s * kSecond, TimeForm::kZoned) +
      "; a server that runs takes it within a minute. Stations need nothing: the authority is the same");
  return {};
}

Status prepareNext(const std::filesystem::path& folder, Output& output,
                   const std::vector<std::string>& domains) {
  const TlsFiles files = filesToWrite(folder, output);
  RETURN_IF_ERROR(prepareAuthority(files, domains));
  output.done("a new authority is prepared; " + files.ca_certificate.string() +
              " has the old and the new one. Bring this file to every station, instructor and browser; the "
              "server keeps using the old one until `certificate authority switch`");
  return {};
}

Status switchToNext(const std::filesystem::path& folder, Output& output,
                    const std::vector<std::string>& hosts) {
  RETURN_IF_ERROR(switchAuthority(filesToWrite(folder, output), hosts));
  output.done(
      "the new authority signs the server's certificate; a server that runs takes it within a minute. "
      "Clients that have only the old ca.crt can no longer connect. `certificate authority drop` takes the "
      "old one out of ca.crt");
  return {};
}

Status dropOld(const std::filesystem::path& folder, Output& output) {
  const TlsFiles files = filesToWrite(folder, output);
  RETURN_IF_ERROR(dropOldAuthorities(files));
  output.done(files.ca_certificate.string() +
              " has only the authority in use; bring it to every station, so that they no longer trust the "
              "old one");
  return {};
}

Status moveKey(const std::filesystem::path& folder, Output& output, const std::string& to) {
  const TlsFiles files = filesToWrite(folder, output);
  RETURN_IF_ERROR(moveAuthorityKey(files, to));
  output.done("the authority's key is in " + to +
              " and no longer here; keep it off the network. The server " +
              "asks for it when it needs another certificate: copy it back to " + files.ca_key.string() +
              " (chmod 600) for that time");
  return {};
}

}  // namespace

void addCertificateCommands(CLI::App& app, ChosenCommand& chosen) {
  auto* certificate =
      app.add_subcommand("certificate", "the certificate that stations check the server by (needs --data)");
  certificate->require_subcommand(1);
  const auto hosts = std::make_shared<std::vector<std::string>>();

  certificate->add_subcommand("show", "show the certificates' names and dates")->callback([&chosen] {
    chosen.run_on_files = show;
  });
  auto* renew_command = certificate->add_subcommand(
      "renew",
      "make a new server certificate from the same authority, for the old names and these; needs tls/ca.key");
  const auto addHosts = [&hosts](CLI::App* to) {
    to->add_option("--host-name", *hosts, "another name or address; may be repeated, or A,B")
        ->delimiter(',')
        ->type_name("HOST");
  };
  addHosts(renew_command);
  renew_command->callback([&chosen, hosts] {
    chosen.run_on_files = [hosts](const std::filesystem::path& folder, Output& output) {
      return renew(folder, output, *hosts);
    };
  });

  auto* move_key = certificate->add_subcommand(
      "move-key", "move the authority's key to another medium; it is needed only for new certificates");
  const auto to = std::make_shared<std::string>();
  move_key->add_option("file", *to, "the new file there")->required()->type_name("FILE");
  move_key->callback([&chosen, to] {
    chosen.run_on_files = [to](const std::filesystem::path& folder, Output& output) {
      return moveKey(folder, output, *to);
    };
  });

  auto* authority = certificate->add_subcommand(
      "authority", "replace the authority: prepare, copy ca.crt to all machines, switch, drop");
  authority->require_subcommand(1);
  const auto domains = std::make_shared<std::vector<std::string>>();
  auto* prepare = authority->add_subcommand(
      "prepare", "make a new authority; ca.crt then holds both, and nothing else changes");
  prepare
      ->add_option(
          "--domain", *domains,
          "it may sign names in this domain, and no others; may be repeated. Without it: the server's "
          "present names")
      ->type_name("DOMAIN");
  prepare->callback([&chosen, domains] {
    chosen.run_on_files = [domains](const std::filesystem::path& folder, Output& output) {
      return prepareNext(folder, output, *domains);
    };
  });
  auto* to_next = authority->add_subcommand("switch", "sign the server's certificate with the new authority");
  addHosts(to_next);
  to_next->callback([&chosen, hosts] {
    chosen.run_on_files = [hosts](const std::filesystem::path& folder, Output& output) {
      return switchToNext(folder, output, *hosts);
    };
  });
  authority->add_subcommand("drop", "remove the old authority from ca.crt")->callback([&chosen] {
    chosen.run_on_files = dropOld;
  });
}

}  // namespace needlelab
