// The device's surroundings: commands, and the script that times them.
#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "tests/support/virtuose_standin/world.h"

namespace standin {
namespace {

bool readPoseWords(std::istringstream& in, Pose& pose) {
  return static_cast<bool>(in >> pose.p.x >> pose.p.y >> pose.p.z >> pose.q.x >> pose.q.y >> pose.q.z >>
                           pose.q.w);
}

bool readFlag(std::istringstream& in, bool& flag) {
  int value = 0;
  if (!(in >> value) || value < 0 || value > 1) return false;
  flag = value == 1;
  return true;
}

bool readBits(std::istringstream& in, unsigned& bits) {
  std::string text;
  if (!(in >> text)) return false;
  char* end = nullptr;
  bits = static_cast<unsigned>(std::strtoul(text.c_str(), &end, 0));
  return *end == '\0';
}

}  // namespace

bool World::command(const std::string& line) {
  std::istringstream in(line);
  std::string name, word;
  in >> name;
  Pose pose;
  double number = 0;
  if (name == "place") {
    if (!readPoseWords(in, pose)) return false;
    plant_.place(pose);
  } else if (name == "hand") {
    if (!readPoseWords(in, pose) || !(in >> number)) return false;
    plant_.aimAt(pose, number);
  } else if (name == "let_go" || name == "hold") {
    plant_.hold(name == "hold");
    sensor_ = name == "hold";
  } else if (name == "dead_man") {
    return readFlag(in, sensor_);
  } else if (name == "switch") {
    return readFlag(in, switch_);
  } else if (name == "daemon") {
    if (!readFlag(in, daemon_)) return false;
    if (!daemon_)
      for (Context& context : contexts_) {
        if (context.state == Context::State::kOpen) context.state = Context::State::kCut;
        if (context.state == Context::State::kLeftOpen) context.state = Context::State::kFree;
        context.permits_power = false;
      }
  } else if (name == "overheat") {
    return readFlag(in, forced_overheat_);
  } else if (name == "estop") {
    if (!(in >> word) || (word != "press" && word != "free")) return false;
    stopped_ = word == "press";
    if (stopped_) switch_ = false;
  } else if (name == "link_down") {
    if (!(in >> number)) return false;
    link_back_s_ = now_s_ + number;
  } else if (name == "slow") {
    return static_cast<bool>(in >> slow_s_);
  } else if (name == "version") {
    if (!(in >> word)) return false;
    right_version_ = word == "right";
  } else if (name == "alarm") {
    return readBits(in, more_alarms_);
  } else if (name == "failure") {
    return readBits(in, failures_);
  } else if (name == "button") {
    if (!(in >> number) || number < 1 || number > 3) return false;
    return readFlag(in, buttons_[static_cast<std::size_t>(number)]);
  } else if (name == "jump") {
    Vec3 by;
    if (!(in >> by.x >> by.y >> by.z)) return false;
    plant_.jump(by);
  } else if (name == "bad_turn") {
    return static_cast<bool>(in >> turn_scale_);
  } else if (name == "fail") {
    int code = 0;
    if (!(in >> word >> code)) return false;
    std::erase_if(failing_, [&](const auto& row) { return row.first == word; });
    if (code != 0) failing_.emplace_back(word, code);
  } else {
    return false;
  }
  return true;
}

int World::script(const std::string& text) {
  std::vector<Event> events;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream in(line.substr(0, line.find('#')));
    Event event{};
    if (!(in >> std::ws) || in.eof()) continue;
    if (!(in >> event.time_s) || !std::getline(in >> std::ws, event.command)) return number;
    events.push_back(event);
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const Event& a, const Event& b) { return a.time_s < b.time_s; });
  events_ = std::move(events);
  next_event_ = 0;
  return 0;
}

// in device time, a cycle is a millisecond; commands at time 0 do not wait for the first reading
void World::runScript() {
  const double since_s = first_read_cycle_ < 0 ? 0 : static_cast<double>(cycles_ - first_read_cycle_) * 1e-3;
  while (next_event_ < events_.size() && events_[next_event_].time_s <= since_s + 1e-9)
    command(events_[next_event_++].command);
}

}  // namespace standin
