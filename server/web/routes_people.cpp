// People, groups, stations, and the database itself.
#include <memory>
#include <utility>

#include "server/web/route_parts.h"

namespace needlelab {
namespace {

using Call = pb::Request;

// --- people

Result<pb::Request> listPeople(const WebCall& call) {
  pb::Request request;
  if (auto page = setPage(call, *request.mutable_list_users()->mutable_page()); !page) return page.error();
  return request;
}
WebJson peopleJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.users(), "users");
}

Result<pb::Request> addPerson(const WebCall& call) {
  pb::Request request;
  if (auto read = readBodyInto(call, *request.mutable_add_user(), {}); !read) return read.error();
  return request;
}
WebJson addedPerson(const WebCall& call, const pb::Reply& reply) {
  if (reply.has_user()) return jsonOf(reply.user());
  return WebJson{{"name", call.body.value("name", "")}, {"role", call.body.value("role", "")}};
}

Result<pb::Request> getPerson(const WebCall& call) {
  pb::Request request;
  request.mutable_get_user()->set_name(call.parts[0]);
  return request;
}
WebJson personJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.user());
}

/// Role, name, access; or, alone, the word on studies.
Result<pb::Request> changePerson(const WebCall& call) {
  pb::Request request;
  if (call.body.is_object() && call.body.contains("consent")) {
    const nlohmann::json& given = call.body["consent"];
    const bool noted = call.body.size() == 2 && call.body.contains("note") && call.body["note"].is_string();
    if (!given.is_boolean() || (call.body.size() != 1 && !noted))
      return Error{ErrorCode::kInvalidInput,
                   "consent: give {\"consent\": true or false, \"note\": TEXT} alone"};
    auto& consent = *request.mutable_set_consent();
    consent.set_name(call.parts[0]);
    consent.set_given(given.get<bool>());
    if (noted) consent.set_note(call.body["note"].get<std::string>());
    return request;
  }
  auto& change = *request.mutable_change_user();
  if (auto read = readBodyInto(call, change, {"name", "base_revision"}); !read) return read.error();
  const auto base = baseOf(call);
  if (!base) return base.error();
  change.set_name(call.parts[0]);
  change.set_base_revision(*base);
  return request;
}

Result<pb::Request> setPersonsPassword(const WebCall& call) {
  pb::Request request;
  auto& set = *request.mutable_set_password();
  if (auto read = readBodyInto(call, set, {"name"}); !read) return read.error();
  set.set_name(call.parts[0]);
  return request;
}

Result<pb::Request> importPeople(const WebCall& call) {
  pb::Request request;
  if (auto read = readBodyInto(call, *request.mutable_import_people(), {}); !read) return read.error();
  return request;
}
WebJson importJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.people_import());
}

Result<pb::Request> listConsents(const WebCall& call) {
  pb::Request request;
  request.mutable_list_consents()->set_name(call.parts[0]);
  return request;
}
WebJson consentsJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.consents(), "consents");
}

/// All of a person's records as one document, page by page of ExportPerson.
class PersonRecords {
 public:
  PersonRecords(Service& service, WebCall call) : service_(service), call_(std::move(call)) {}

  Result<std::string> next() {
    if (ended_) return std::string();
    pb::Request request;
    request.mutable_export_person()->set_name(call_.parts[0]);
    request.mutable_export_person()->set_page(page_);
    const auto reply = replyOf(service_, call_, request);
    if (!reply) return reply.error();
    std::string text = page_.empty() ? "{\"items\": [" : "";
    for (const std::string& record : reply->records().records()) {
      text += (first_ ? "\n" : ",\n") + record;
      first_ = false;
    }
    page_ = reply->records().next_page();
    ended_ = page_.empty();
    if (ended_) text += "\n]}\n";
    return text;
  }

 private:
  Service& service_;
  const WebCall call_;
  std::string page_;
  bool first_ = true, ended_ = false;
};

Result<WebStream> personRecords(Service& service, const WebCall& call) {
  auto records = std::make_shared<PersonRecords>(service, call);
  return streamFromFirst("application/json", call.parts[0] + ".json", [records] { return records->next(); });
}

Result<pb::Request> erasePerson(const WebCall& call) {
  pb::Request request;
  auto& erase = *request.mutable_erase_person();
  if (auto read = readBodyInto(call, erase, {"name"}); !read) return read.error();
  erase.set_name(call.parts[0]);
  return request;
}
WebJson erasureJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.erasure());
}

// --- groups

Result<pb::Request> listGroups(const WebCall& call) {
  pb::Request request;
  if (auto page = setPage(call, *request.mutable_list_groups()->mutable_page()); !page) return page.error();
  return request;
}
WebJson groupsJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.groups(), "groups");
}
WebJson groupJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.group());
}

Result<pb::Request> addGroup(const WebCall& call) {
  pb::Request request;
  auto& put = *request.mutable_put_group();
  if (auto read = readBodyInto(call, *put.mutable_group(), {"revision", "changed_by"}); !read)
    return read.error();
  return request;
}

Result<pb::Request> getGroup(const WebCall& call) {
  pb::Request request;
  request.mutable_get_group()->set_id(call.parts[0]);
  return request;
}

Result<pb::Request> putGroup(const WebCall& call) {
  auto request = addGroup(call);
  if (!request) return request;
  auto& put = *request->mutable_put_group();
  if (!put.group().id().empty() && put.group().id() != call.parts[0])
    return Error{ErrorCode::kInvalidInput, "id: is not that of the address"};
  put.mutable_group()->set_id(call.parts[0]);
  const auto base = baseOf(call);
  if (!base) return base.error();
  put.set_base_revision(*base);
  return request;
}

Result<pb::Request> removeGroup(const WebCall& call) {
  pb::Request request;
  const auto base = baseOf(call);
  if (!base) return base.error();
  request.mutable_remove_group()->set_id(call.parts[0]);
  request.mutable_remove_group()->set_base_revision(*base);
  return request;
}

// --- stations and upkeep

Result<pb::Request> listStations(const WebCall& call) {
  pb::Request request;
  if (auto page = setPage(call, *request.mutable_list_stations()->mutable_page()); !page) return page.error();
  return request;
}
WebJson stationsJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.stations(), "stations");
}

Result<pb::Request> listAudit(const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_audit();
  list.set_limit(200);
  list.set_who(call.query("who"));
  list.set_action(call.query("action"));
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  return request;
}
WebJson auditJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.audit(), "entries");
}

Result<pb::Request> makeBackup(const WebCall& call) {
  pb::Request request;
  if (auto read = readBodyInto(call, *request.mutable_backup(), {}); !read) return read.error();
  return request;
}
WebJson backupJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.backup_done());
}

Result<pb::Request> checkAll(const WebCall&) {
  pb::Request request;
  request.mutable_check();
  return request;
}
WebJson checkReportJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.check_report());
}

Result<pb::Request> listRetention(const WebCall&) {
  pb::Request request;
  request.mutable_list_retention();
  return request;
}
WebJson retentionJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.retention());
}

Result<pb::Request> setRetention(const WebCall& call) {
  pb::Request request;
  if (auto read = readBodyInto(call, *request.mutable_set_retention(), {}); !read) return read.error();
  return request;
}

Result<pb::Request> runRetention(const WebCall& call) {
  pb::Request request;
  if (auto read = readBodyInto(call, *request.mutable_run_retention(), {}); !read) return read.error();
  return request;
}
WebJson retentionReportJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.retention_report());
}

constexpr auto kAsk = WebAction::kRequest;

constexpr auto kPeopleRoutes = std::to_array<WebRoute>({
    {"GET", "/people", Call::kListUsers, kAsk, listPeople, peopleJson},
    {"POST", "/people", Call::kAddUser, kAsk, addPerson, addedPerson, nullptr, 201},
    {"POST", "/people/import", Call::kImportPeople, kAsk, importPeople, importJson},
    {"GET", "/people/{name}", Call::kGetUser, kAsk, getPerson, personJson},
    // consent is everybody's own; the service looks at the rest itself
    {"PATCH", "/people/{name}", Call::kSetConsent, kAsk, changePerson, personJson},
    {"POST", "/people/{name}/password", Call::kSetPassword, kAsk, setPersonsPassword, emptyReply},
    {"GET", "/people/{name}/consents", Call::kListConsents, kAsk, listConsents, consentsJson},
    {"GET", "/people/{name}/export", Call::kExportPerson, WebAction::kStream, nullptr, nullptr, nullptr, 200,
     personRecords},
    {"DELETE", "/people/{name}/data", Call::kErasePerson, kAsk, erasePerson, erasureJson},
    {"GET", "/groups", Call::kListGroups, kAsk, listGroups, groupsJson},
    {"POST", "/groups", Call::kPutGroup, kAsk, addGroup, groupJson, nullptr, 201},
    {"GET", "/groups/{id}", Call::kGetGroup, kAsk, getGroup, groupJson},
    {"PUT", "/groups/{id}", Call::kPutGroup, kAsk, putGroup, groupJson},
    {"DELETE", "/groups/{id}", Call::kRemoveGroup, kAsk, removeGroup, emptyReply},
    {"GET", "/stations", Call::kListStations, kAsk, listStations, stationsJson},
    {"GET", "/audit", Call::kListAudit, kAsk, listAudit, auditJson},
    {"POST", "/backup", Call::kBackup, kAsk, makeBackup, backupJson},
    {"POST", "/check", Call::kCheck, kAsk, checkAll, checkReportJson},
    {"GET", "/retention", Call::kListRetention, kAsk, listRetention, retentionJson},
    {"PUT", "/retention", Call::kSetRetention, kAsk, setRetention, emptyReply},
    {"POST", "/retention/run", Call::kRunRetention, kAsk, runRetention, retentionReportJson},
});

}  // namespace

std::span<const WebRoute> peopleRoutes() {
  return kPeopleRoutes;
}

}  // namespace needlelab
