#include <fmt/format.h>
#include <sys/stat.h>

#include "daemon/doctor/judge.h"

namespace focalfleet::doctor {
namespace {

constexpr std::uint64_t kMegabyte = 1'000'000;
/// Least free bytes. A configuration of 5000 units adds 4 MB at most to the store, and its
/// exposures some 2 MB to the camera's folder: below the first limit a night of a hundred may not
/// find room, below the second a month does not.
constexpr std::uint64_t kBytesFail = 600 * kMegabyte;
constexpr std::uint64_t kBytesWarn = 20'000 * kMegabyte;
/// Least free inodes: an exposure is three files, and a night has a few hundred.
constexpr std::uint64_t kInodesFail = 1000;
constexpr std::uint64_t kInodesWarn = 30'000;

std::string Size(std::uint64_t bytes) {
  return bytes >= 1000 * kMegabyte ? fmt::format("{:.1f} GB", 1e-9 * static_cast<double>(bytes))
                                   : fmt::format("{:.1f} MB", 1e-6 * static_cast<double>(bytes));
}

Check JudgeFolder(const std::string& check, const FileFacts& folder, const Identity& user) {
  if (!folder.trouble.empty())
    return Fail(
        check, fmt::format("{}: {}", folder.path, folder.trouble),
        fmt::format("install --directory --owner={} --mode=0750 {}", user.name, folder.path));
  if (!S_ISDIR(folder.mode))
    return Fail(check, folder.path + " is no folder", "mend the path in the configuration");
  if (!May(user, folder, Access::kWrite) || !May(user, folder, Access::kUse))
    return Fail(
        check,
        fmt::format("user {} may not write to {} (owner {}, group {}, mode {:04o})", user.name,
                    folder.path, folder.owner, folder.group, folder.mode & 07777u),
        fmt::format("chown {} {}; chmod u+rwx {}", user.name, folder.path, folder.path));
  return Ok(check, fmt::format("user {} may write to {}", user.name, folder.path));
}

Check JudgeGpio(const FileFacts& chip, const Identity& user) {
  if (!chip.trouble.empty())
    return Fail("gpio", fmt::format("{}: {}", chip.path, chip.trouble),
                "gpiodetect lists the chips; mend sync.chip");
  if (!S_ISCHR(chip.mode))
    return Fail("gpio", chip.path + " is no device", "gpiodetect lists the chips; mend sync.chip");
  if (!May(user, chip, Access::kRead) || !May(user, chip, Access::kWrite))
    return Fail("gpio",
                fmt::format("user {} may not use {} (owner {}, group {}, mode {:04o})", user.name,
                            chip.path, chip.owner, chip.group, chip.mode & 07777u),
                fmt::format("usermod --append --groups {} {}; systemctl restart focalfleetd",
                            chip.group, user.name));
  return Ok("gpio", fmt::format("user {} may use {}", user.name, chip.path));
}

Check JudgeDisk(const DiskFacts& disk) {
  const std::string check = "disk " + disk.folder;
  if (!disk.trouble.empty())
    return Fail(check, disk.trouble, "mend the path in the configuration, or mount the disk");
  const std::string todo =
      fmt::format("make room on the disk of {0}: `df -h {0}`, `df -i {0}`", disk.folder);
  const std::string text =
      fmt::format("{} free{}", Size(disk.free_bytes),
                  disk.free_inodes ? fmt::format(", {} inodes", *disk.free_inodes) : "");
  const std::uint64_t inodes = disk.free_inodes.value_or(kInodesWarn);
  if (disk.free_bytes < kBytesFail || inodes < kInodesFail) return Fail(check, text, todo);
  if (disk.free_bytes < kBytesWarn || inodes < kInodesWarn) return Warn(check, text, todo);
  return Ok(check, text);
}

Check JudgeHealth(const Facts& facts, const StoreHealth& store) {
  const std::string& path = facts.config->store.path;
  if (!store.flaw.empty())
    return Fail("store", fmt::format("{} is damaged: {}", path, store.flaw),
                "stop the daemon, copy the file with its -wal, and take the last backup; units are "
                "homed after it");
  const std::string found = fmt::format(
      "version {}, {}, {} configurations and {} motions{}, sound", store.version, Size(store.bytes),
      store.configurations, store.motions, store.since ? " since " + ToIso8601(*store.since) : "");
  if (store.version < store.version_expected)
    return Warn("store",
                fmt::format("{}; this program expects version {}", found, store.version_expected),
                "the daemon carries it over when it starts: systemctl restart focalfleetd");
  // A backup or a rewrite of the file (VACUUM) needs as much room as the file has.
  if (!facts.disks.empty() && facts.disks.front().trouble.empty() &&
      store.bytes > facts.disks.front().free_bytes)
    return Warn("store", found + "; a copy of it finds no room on its disk",
                "move the store to a larger disk while the daemon is stopped");
  return Ok("store", found);
}

}  // namespace

void JudgeConfig(const Facts& facts, Checks* checks) {
  if (!facts.config) {
    checks->push_back(
        Fail("configuration", facts.config.error().text,
             fmt::format(
                 "mend it (focalfleetd --config {} --check reads it again), or name the daemon's "
                 "own by --config",
                 facts.config_path)));
    return;
  }
  if (!facts.buses) {
    checks->push_back(
        Fail("configuration", facts.buses.error().text, "mend the file, or fleet.units"));
    return;
  }
  const DaemonConfig::Bus& bus = facts.config->bus;
  if (bus.port == PortKind::kSocketCan && bus.interfaces.size() != *facts.buses)
    checks->push_back(Fail(
        "configuration",
        fmt::format("{}: bus.interfaces names {} interfaces, {} has {} buses", bus.interfaces_at,
                    bus.interfaces.size(), facts.config->fleet.units, *facts.buses),
        "name one interface a bus, by ascending bus_id"));
  else
    checks->push_back(
        Ok("configuration", fmt::format("{}, {} buses", facts.config_path, *facts.buses)));
}

void JudgeFiles(const Facts& facts, Checks* checks) {
  if (!facts.config) return;
  const Identity& user = facts.daemon_user;
  for (const FileFacts& folder : facts.bus_sockets_folder) {
    checks->push_back(folder.trouble.empty()
                          ? Ok("bus sockets", folder.path + " is there")
                          : Fail("bus sockets", fmt::format("{}: {}", folder.path, folder.trouble),
                                 "start focalfleet-sim, or mend bus.unix_directory"));
  }
  checks->push_back(JudgeFolder("store folder", facts.store_folder, user));
  if (facts.camera_folder)
    checks->push_back(JudgeFolder("camera folder", *facts.camera_folder, user));
  if (facts.gpio_chip) checks->push_back(JudgeGpio(*facts.gpio_chip, user));
  for (const DiskFacts& disk : facts.disks) checks->push_back(JudgeDisk(disk));
}

void JudgeStore(const Facts& facts, Checks* checks) {
  if (!facts.config) return;
  const std::string& path = facts.config->store.path;
  if (!facts.store) {
    checks->push_back(
        Warn("store", path + " does not exist", "the daemon makes it at its first start"));
    return;
  }
  if (*facts.store) {
    checks->push_back(JudgeHealth(facts, **facts.store));
    return;
  }
  const Error& error = facts.store->error();
  if (error.code == ErrorCode::kUnavailable)
    checks->push_back(Warn("store", fmt::format("not looked at: {}", error.text),
                           fmt::format("sudo -u {} focalfleet doctor", facts.daemon_user.name)));
  else
    checks->push_back(Fail("store", error.text,
                           error.code == ErrorCode::kNewer
                               ? "install the version that wrote it"
                               : "mend store.path, or take the last backup"));
}

}  // namespace focalfleet::doctor
