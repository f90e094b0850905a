#include "tests/bench/result_folder.h"

#include <cctype>
#include <ctime>

namespace needlelab::test {

std::string folderName(const std::string& machine) {
  std::string name;
  std::size_t commas = 0;
  for (const char c : machine) {
    if (c == ',' && ++commas == 2) break;
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    else if (!name.empty() && name.back() != '-')
      name += '-';
  }
  while (!name.empty() && name.back() == '-') name.pop_back();
  return name.empty() ? "unknown" : name;
}

std::string nowText() {
  char text[40];
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", &parts);
  return text;
}

}  // namespace needlelab::test
