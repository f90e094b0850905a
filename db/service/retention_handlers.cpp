// What happens to recordings after a time: the policies, and where things stand.
#include <charconv>

#include "db/retention_store.h"
#include "db/schema.h"
#include "db/service/handlers.h"

namespace needlelab::handlers {
namespace {

std::string textOfPolicy(const pb::RetentionPolicy& policy) {
  std::string text;
  if (policy.has_thin_after_days()) {
    text = "thin after " + std::to_string(policy.thin_after_days()) + " days to " +
           std::to_string(policy.thin_rate_hz()) + " Hz";
  }
  if (policy.has_delete_after_days())
    text +=
        (text.empty() ? "" : ", ") + ("delete after " + std::to_string(policy.delete_after_days()) + " days");
  if (text.empty()) text = "keep";
  return text + (policy.without_backup() ? ", also without a backup" : "");
}

}  // namespace

Result<pb::Reply> listRetention(const Context& context, const pb::ListRetention&) {
  RetentionStore store(context.reader);
  const auto policies = store.policies();
  if (!policies) return policies.error();
  const auto space = store.space();
  if (!space) return space.error();
  pb::Reply reply;
  auto* retention = reply.mutable_retention();
  for (const auto& policy : *policies) *retention->add_policies() = policy;
  retention->set_database_bytes(space->database_bytes);
  retention->set_free_bytes(space->free_bytes);
  auto counts = context.reader.prepare(
      "SELECT recording, count(*) FROM sessions WHERE recording > 1 GROUP BY recording");
  for (;;) {
    const auto row = counts.step();
    if (!row) return row.error();
    if (!*row) break;
    if (counts.integer(0) == 2) retention->set_thinned_sessions(counts.natural(1));
    if (counts.integer(0) == 3) retention->set_deleted_sessions(counts.natural(1));
  }
  const auto last = MetaStore(context.reader).get("retention_unix_ns");
  if (!last) return last.error();
  if (*last) {
    std::int64_t value = 0;
    std::from_chars((*last)->data(), (*last)->data() + (*last)->size(), value);
    retention->set_last_run_unix_ns(value);
  }
  return reply;
}

Result<pb::Reply> setRetention(const Context& context, const pb::SetRetention& call) {
  pb::RetentionPolicy policy = call.policy();
  policy.set_by(context.who.name);
  policy.set_changed_unix_ns(context.now_unix_ns);
  const std::string subject = policy.exercise_id().empty() ? "(default)" : policy.exercise_id();
  const auto status = write(context, subject, call.as_default() ? "as the default" : textOfPolicy(policy),
                            [&](Connection& writer) {
                              RetentionStore store(writer);
                              if (call.as_default()) return store.removePolicy(policy.exercise_id());
                              // in one transaction with the policy, which would make its own name a known one
                              auto known = store.checkExercise(policy.exercise_id());
                              return known ? store.setPolicy(policy) : known;
                            });
  if (!status) return status.error();
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

}  // namespace needlelab::handlers
