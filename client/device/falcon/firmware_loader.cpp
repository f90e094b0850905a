#include "client/device/falcon/firmware_loader.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_packet.h"

namespace needlelab::falcon {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kWrite{1000}, kAnswer{1000}, kReply{50};
constexpr std::size_t kMaxFirmware = 1u << 20;

constexpr std::array<std::uint8_t, 3> kGreeting = {0x0A, 0x43, 0x0D};
constexpr std::array<std::uint8_t, 4> kGreetingAnswer = {0x0A, 0x44, 0x2C, 0x0D};
constexpr std::array<std::uint8_t, 1> kCalling = {0x41};

Status controls(FtdiPort& port, std::initializer_list<std::array<std::uint16_t, 3>> requests) {
  for (const auto& [request, value, index] : requests)
    RETURN_IF_ERROR(port.control(static_cast<std::uint8_t>(request), value, index));
  return {};
}

Status setBaud(FtdiPort& port, double baud) {
  const BaudDivisor divisor = baudDivisor(baud);
  return port.control(kFtdiBaudRate, divisor.value, divisor.index);
}

std::string hex(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{}{:02X}", text.empty() ? "" : " ", byte);
  return text.empty() ? "nothing" : text;
}

const char* nameOf(LoadStep step) {
  switch (step) {
    case LoadStep::kLine:
      return "setting its line";
    case LoadStep::kGreet:
      return "greeting its loader";
    case LoadStep::kSpeedUp:
      return "setting its line for loading";
    case LoadStep::kCall:
      return "calling its loader at full speed";
    case LoadStep::kChunk:
      return "sending the firmware";
    case LoadStep::kRun:
      return "setting its line for running";
    case LoadStep::kFirstReply:
      return "waiting for the firmware to answer";
    case LoadStep::kDone:
    case LoadStep::kFailed:
      break;
  }
  return "loading";
}

}  // namespace

BaudDivisor baudDivisor(double baud) noexcept {
  constexpr double kClock = 3e6;
  // eighths 0-7 as the chip codes them
  constexpr std::array<unsigned, 8> kCode = {0, 3, 2, 4, 1, 5, 6, 7};
  // of the two divisors around the wanted one, the one with the nearer rate
  const double wanted = std::clamp(kClock / baud, 2.0, 16383.0);
  const double below = std::floor(wanted * 8), above = below + 1;
  const bool lower = std::fabs(kClock * 8 / below - baud) <= std::fabs(kClock * 8 / above - baud);
  const auto eighths = static_cast<unsigned>(lower ? below : above);
  BaudDivisor divisor;
  divisor.baud = kClock * 8 / eighths;
  const unsigned coded = (eighths >> 3) | (kCode[eighths & 7] << 14);
  divisor.value = static_cast<std::uint16_t>(coded & 0xFFFF);
  divisor.index = static_cast<std::uint16_t>(coded >> 16);
  return divisor;
}

Status FtdiInput::read(std::size_t count, std::chrono::milliseconds timeout,
                       std::vector<std::uint8_t>& bytes) {
  const std::int64_t end_ns = time_.nowNs() + std::chrono::nanoseconds(timeout).count();
  std::size_t missing = count;
  for (;;) {
    const std::size_t taken = std::min(missing, kept_.size());
    const auto until = kept_.begin() + static_cast<std::ptrdiff_t>(taken);
    bytes.insert(bytes.end(), kept_.begin(), until);
    kept_.erase(kept_.begin(), until);
    missing -= taken;
    const std::int64_t left_ns = end_ns - time_.nowNs();
    if (missing == 0 || left_ns <= 0) return {};

    std::array<std::uint8_t, 8 * kUsbPacketBytes> buffer{};
    const auto left = std::chrono::milliseconds(1 + left_ns / 1'000'000);
    ASSIGN_OR_RETURN(const auto got, port_.read(buffer, left));
    eachPayloadByte(std::span(buffer).first(got), [&](std::uint8_t byte) { kept_.push_back(byte); });
  }
}

Result<std::vector<std::uint8_t>> readFirmware(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in)
    return Error{ErrorCode::kNotFound, "Falcon firmware '" + file + "': cannot be read (" +
                                           std::strerror(errno) +
                                           "); name the maker's firmware file as falcon:FILE or in "
                                           "NEEDLELAB_FALCON_FIRMWARE"};
  std::vector<std::uint8_t> bytes;
  std::array<char, 65536> buffer{};
  while (bytes.size() <= kMaxFirmware && (in.read(buffer.data(), buffer.size()), in.gcount() > 0))
    bytes.insert(bytes.end(), buffer.begin(), buffer.begin() + in.gcount());
  if (in.bad()) return Error{ErrorCode::kNotFound, "Falcon firmware '" + file + "': reading it failed"};
  if (bytes.empty() || bytes.size() > kMaxFirmware)
    return Error{
        ErrorCode::kInvalidInput,
        "Falcon firmware '" + file + "': " +
            (bytes.empty() ? std::string("is empty") : fmt::format("is longer than {} bytes", kMaxFirmware)) +
            "; it should be the maker's firmware, some ten thousand bytes"};
  return bytes;
}

Status setRunLine(FtdiPort& port) {
  // a chip unplugged from USB while the device kept its power has also lost its line format
  if (Status done =
          controls(port, {{kFtdiLatency, 1, 0}, {kFtdiData, kData8N1, 0}, {kFtdiFlowControl, 0, 0}});
      !done.ok())
    return done;
  RETURN_IF_ERROR(setBaud(port, kRunBaud));
  return controls(port, {{kFtdiReset, kPurgeIn, 0}, {kFtdiReset, kPurgeOut, 0}});
}

Result<bool> firmwareRuns(FtdiPort& port, int tries, TimeSource& time) {
  RETURN_IF_ERROR(setRunLine(port));
  FtdiInput input(port, time);
  PacketReader reader;
  for (int i = 0; i < tries; ++i) {
    // a loader waiting for more firmware echoes, and an echo looks like the report of a device just switched
    // on: send two patterns of lights, because no set of pressed buttons matches both
    const Command ask{{}, i % 2 == 0 ? kOutRed : kOutBlue};
    RETURN_IF_ERROR(port.write(encodeCommand(ask), kWrite));
    std::vector<std::uint8_t> bytes;
    RETURN_IF_ERROR(input.read(kPacketBytes, kReply, bytes));
    Report report;
    for (const std::uint8_t byte : bytes)
      if (reader.push(byte, report) && report != Report{ask.motor, ask.bits}) return true;
  }
  return false;
}

FirmwareLoader::FirmwareLoader(FtdiPort& port, std::span<const std::uint8_t> firmware, std::string file,
                               TimeSource& time)
    : port_(port), time_(time), input_(port, time), firmware_(firmware), file_(std::move(file)) {}

bool FirmwareLoader::step() {
  if (next_ == LoadStep::kDone || next_ == LoadStep::kFailed) return false;
  const LoadStep now = next_;
  if (Status done = doStep(); !done.ok()) {
    result_ = Error{done.error().code, std::string("loading the Falcon's firmware, ") + nameOf(now) + ": " +
                                           done.error().message};
    next_ = LoadStep::kFailed;
    return false;
  }
  return next_ != LoadStep::kDone;
}

Status FirmwareLoader::doStep() {
  Status done;
  switch (next_) {
    case LoadStep::kLine:
      done = setLine();
      next_ = LoadStep::kGreet;
      break;
    case LoadStep::kGreet:
      done = exchange(kGreeting, kGreetingAnswer, "greeting");
      next_ = LoadStep::kSpeedUp;
      break;
    case LoadStep::kSpeedUp:
      done = controls(port_, {{kFtdiModemControl, kDtrLow, 0}});
      if (done.ok()) done = setBaud(port_, kLoaderBaud);
      next_ = LoadStep::kCall;
      break;
    case LoadStep::kCall:
      done = exchange(kCalling, kCalling, "call");
      next_ = LoadStep::kChunk;
      break;
    case LoadStep::kChunk:
      done = sendChunk();
      if (sent_ == firmware_.size()) next_ = LoadStep::kRun;
      break;
    case LoadStep::kRun:
      done = setRunLine(port_);
      input_.forget();
      next_ = LoadStep::kFirstReply;
      break;
    case LoadStep::kFirstReply:
      done = firstReply();
      next_ = LoadStep::kDone;
      break;
    case LoadStep::kDone:
    case LoadStep::kFailed:
      break;
  }
  return done;
}

Status FirmwareLoader::setLine() {
  if (Status done =
          controls(port_, {{kFtdiReset, kPurgeIn, 0}, {kFtdiReset, kPurgeOut, 0}, {kFtdiLatency, 16, 0}});
      !done.ok())
    return done;
  RETURN_IF_ERROR(setBaud(port_, kGreetingBaud));
  return controls(port_, {{kFtdiData, kData8N1, 0},
                          {kFtdiFlowControl, 0, 0},
                          {kFtdiModemControl, kRtsLow, 0},
                          {kFtdiModemControl, kDtrLow, 0},
                          {kFtdiModemControl, kDtrHigh, 0}});
}

Status FirmwareLoader::exchange(std::span<const std::uint8_t> question, std::span<const std::uint8_t> answer,
                                const char* what) {
  RETURN_IF_ERROR(port_.write(question, kWrite));
  std::vector<std::uint8_t> got;
  RETURN_IF_ERROR(input_.read(answer.size(), kAnswer, got));
  if (std::equal(got.begin(), got.end(), answer.begin(), answer.end())) return {};
  return Error{ErrorCode::kUnavailable, std::string("its ") + what + " " + hex(question) +
                                            " was answered by " + hex(got) + " instead of " + hex(answer) +
                                            "; check its power supply, unplug it from power and USB, plug in "
                                            "both again"};
}

Status FirmwareLoader::sendChunk() {
  const auto chunk = firmware_.subspan(sent_, std::min(kChunkBytes, firmware_.size() - sent_));
  RETURN_IF_ERROR(port_.write(chunk, kWrite));
  std::vector<std::uint8_t> echo;
  RETURN_IF_ERROR(input_.read(chunk.size(), kAnswer, echo));
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    if (i < echo.size() && echo[i] == chunk[i]) continue;
    const std::string byte = fmt::format("byte {} (0x{:X}) of '", sent_ + i, sent_ + i) + file_ + "', " +
                             fmt::format("0x{:02X}, ", chunk[i]);
    return Error{
        ErrorCode::kCorrupt,
        byte +
            (i < echo.size() ? fmt::format("came back as 0x{:02X}", echo[i])
                             : fmt::format("did not come back within {:g} s", 1e-3 * kAnswer.count())) +
            "; unplug the Falcon from power and USB, plug in both again, and see that the file is the "
            "maker's firmware"};
  }
  sent_ += chunk.size();
  return {};
}

Status FirmwareLoader::firstReply() {
  constexpr int kTries = 20;
  ASSIGN_OR_RETURN(const auto runs, firmwareRuns(port_, kTries, time_));
  if (runs) return {};
  return Error{ErrorCode::kUnavailable, fmt::format("all {} bytes of '{}' were taken but no firmware "
                                                    "answers; is it the maker's firmware for the Falcon?",
                                                    sent_, file_)};
}

}  // namespace needlelab::falcon
