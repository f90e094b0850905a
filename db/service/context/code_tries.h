/// Counts trainees' wrong codes and wrong old passwords: in memory or, for several servers on one database,
/// there.
#pragma once

#include <string>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/login/shared_logins.h"
#include "db/service/context/code_guard.h"

namespace needlelab {

/// Like CodeGuard. Errors: kUnavailable if the database is away. Thread: any; may wait for the database.
class CodeTries {
 public:
  virtual ~CodeTries() = default;
  CodeTries() = default;
  CodeTries(const CodeTries&) = delete;
  CodeTries& operator=(const CodeTries&) = delete;

  virtual Result<CodeGuard::Try> begin(const std::string& name) = 0;
  virtual Status forget(const std::string& name) = 0;
  virtual Status giveBack(const std::string& name) = 0;
};

class CodesInMemory final : public CodeTries {
 public:
  explicit CodesInMemory(TimeSource& time) : guard_(time) {}
  Result<CodeGuard::Try> begin(const std::string& name) override { return guard_.begin(name); }
  Status forget(const std::string& name) override {
    guard_.forget(name);
    return {};
  }
  Status giveBack(const std::string& name) override {
    guard_.giveBack(name);
    return {};
  }

 private:
  CodeGuard guard_;
};

/// A person's wait applies at every server, and all servers together allow as many attempts as one.
class CodesInStore final : public CodeTries {
 public:
  /// `shared` must outlive it.
  explicit CodesInStore(SharedLogins& shared) : shared_(shared) {}
  Result<CodeGuard::Try> begin(const std::string& name) override;
  Status forget(const std::string& name) override;
  Status giveBack(const std::string& name) override;

 private:
  SharedLogins& shared_;
};

}  // namespace needlelab
