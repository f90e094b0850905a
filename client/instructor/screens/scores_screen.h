/// Measures beside requirements and experts, and how the trainee gets on; export.
#pragma once

#include <string>

#include "client/instructor/model/desk.h"

namespace needlelab {

/// Thread: the surface's.
class ScoresScreen {
 public:
  void show(Desk& desk);

 private:
  void showMeasures(const ReportData& data);
  void showProgress(const ReportData& data);
  void showExport(Desk& desk);
  std::string file_ = "report.html";
  const void* asked_for_ = nullptr;  // the gesture whose score was asked for
};

}  // namespace needlelab
