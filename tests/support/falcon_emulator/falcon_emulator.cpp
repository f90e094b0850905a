#include "tests/support/falcon_emulator/falcon_emulator.h"

#include <utility>

#include "client/device/falcon/falcon_geometry.h"

namespace needlelab::test {
namespace {

UsbIdentity identityOf(const EmulatedFalconOptions& options) {
  UsbIdentity identity;
  identity.vendor = falcon::kUsbVendor;
  identity.product = falcon::kUsbProduct;
  identity.release = 0x0400;
  identity.manufacturer = "FTDI";
  identity.product_name = "FALCON HAPTIC";
  identity.serial = options.serial;
  identity.in_endpoint = 0x81;
  identity.out_endpoint = 0x02;
  return identity;
}

}  // namespace

FalconEmulator::FalconEmulator(UsbTestbed& testbed, EmulatedFalconOptions options)
    : board_(body_, options.firmware), chip_(board_, identityOf(options)), port_(testbed, chip_) {
  board_.connect(chip_);
  board_.powerOn(options.firmware_running);
}

void FalconEmulator::powerCycle(bool firmware_running) {
  with([firmware_running](FalconBoard& board, FtdiChip& chip, FalconBody&) {
    chip.reset();
    board.powerOn(firmware_running);
  });
}

void FalconEmulator::holdRigidly(HandPath path) {
  with([&path](FalconBoard&, FtdiChip&, FalconBody& body) {
    body.holdRigidly(std::move(path), Clock::now());
  });
}

void FalconEmulator::holdAt(const Eigen::Vector3d& p_F_m) {
  holdRigidly([p_F_m](double) { return p_F_m; });
}

void FalconEmulator::holdSoftly(const SoftHand& hand, HandPath path) {
  with([&](FalconBoard&, FtdiChip&, FalconBody& body) {
    body.holdSoftly(hand, std::move(path), Clock::now());
  });
}

void FalconEmulator::setButtons(unsigned buttons) {
  with([buttons](FalconBoard& board, FtdiChip&, FalconBody&) { board.buttons = buttons; });
}

void FalconEmulator::setBoardTrouble(const BoardTrouble& trouble) {
  with([&trouble](FalconBoard& board, FtdiChip&, FalconBody&) { board.trouble = trouble; });
}

void FalconEmulator::setLineTrouble(const LineTrouble& trouble) {
  with([&trouble](FalconBoard&, FtdiChip& chip, FalconBody&) { chip.trouble() = trouble; });
}

Eigen::Vector3d FalconEmulator::grip() {
  return with([](FalconBoard&, FtdiChip&, FalconBody& body) { return Eigen::Vector3d(body.grip()); });
}

Eigen::Vector3d FalconEmulator::force() {
  return with([](FalconBoard&, FtdiChip&, FalconBody& body) { return body.force(); });
}

unsigned FalconEmulator::lights() {
  return with([](FalconBoard& board, FtdiChip&, FalconBody&) { return board.lights(); });
}

unsigned FalconEmulator::homed() {
  return with([](FalconBoard&, FtdiChip&, FalconBody& body) { return body.homed(); });
}

std::uint64_t FalconEmulator::commands() {
  return with([](FalconBoard& board, FtdiChip&, FalconBody&) { return board.commands(); });
}

std::vector<CommandSeen> FalconEmulator::history() {
  return with([](FalconBoard& board, FtdiChip&, FalconBody&) {
    return std::vector<CommandSeen>(board.history().begin(), board.history().end());
  });
}

FalconBoard::Mode FalconEmulator::mode() {
  return with([](FalconBoard& board, FtdiChip&, FalconBody&) { return board.mode(); });
}

std::string FalconEmulator::silentBecause() {
  return with([](FalconBoard& board, FtdiChip&, FalconBody&) { return board.silentBecause(); });
}

}  // namespace needlelab::test
