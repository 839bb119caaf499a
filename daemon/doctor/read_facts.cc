#include "daemon/doctor/read_facts.h"

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "daemon/dds/loopback_config.h"
#include "daemon/files/text_file.h"
#include "daemon/tables/read_table.h"
#include "fleet/files/layout_file.h"

namespace focalfleet::doctor {
namespace {

constexpr const char* kServiceUser = "focalfleet";  // deploy/systemd/focalfleetd.service.in

std::string FolderOf(const std::string& file) {
  const std::string folder = std::filesystem::path(file).parent_path().string();
  return folder.empty() ? "." : folder;
}

DiskFacts LookAtDisk(const std::string& folder) {
  DiskFacts disk{.folder = folder, .trouble = {}, .free_bytes = 0, .free_inodes = {}};
  struct statvfs status {};
  if (::statvfs(folder.c_str(), &status) != 0) {
    disk.trouble = std::strerror(errno);
    return disk;
  }
  disk.free_bytes = status.f_bavail * status.f_frsize;
  if (status.f_files > 0) disk.free_inodes = status.f_favail;
  return disk;
}

Result<std::size_t> BusesOf(const DaemonConfig& config) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(config.fleet.units, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(const Layout layout, ReadLayout(text, config.fleet.units, {}));
  return layout.buses().size();
}

Result<DdsNeeds> DdsNeedsOf(const DaemonConfig& config) {
  if (config.dds.config.empty()) return NeedsOf(kLoopbackConfig);
  FOCALFLEET_TRY_ASSIGN(const std::string xml, ReadTextFile(config.dds.config));
  return NeedsOf(xml);
}

/// Facts of what the configuration names.
void ReadNamed(const DaemonConfig& config, Facts* facts) {
  facts->buses = BusesOf(config);
  facts->dds = DdsNeedsOf(config);
  if (config.bus.port == PortKind::kSocketCan)
    for (const std::string& name : config.bus.interfaces)
      facts->interfaces.push_back({name, LookAtLink(name)});
  if (config.bus.port == PortKind::kUnix)
    facts->bus_sockets_folder.push_back(LookAtFile(config.bus.unix_directory));
  facts->store_folder = LookAtFile(FolderOf(config.store.path));
  facts->disks.push_back(LookAtDisk(FolderOf(config.store.path)));
  if (!config.camera.directory.empty()) {
    facts->camera_folder = LookAtFile(config.camera.directory);
    facts->disks.push_back(LookAtDisk(config.camera.directory));
  }
  if (!config.sync.chip.empty()) facts->gpio_chip = LookAtFile(config.sync.chip);
  std::error_code failed;
  if (std::filesystem::exists(config.store.path, failed) || failed)
    facts->store = InspectHealth(config.store.path);
}

}  // namespace

FileFacts LookAtFile(const std::string& path) {
  FileFacts file;
  file.path = path;
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) {
    file.trouble = std::strerror(errno);
    return file;
  }
  file.uid = status.st_uid;
  file.gid = status.st_gid;
  file.mode = status.st_mode;
  const passwd* const user = ::getpwuid(file.uid);
  file.owner = user != nullptr ? user->pw_name : std::to_string(file.uid);
  const group* const members = ::getgrgid(file.gid);
  file.group = members != nullptr ? members->gr_name : std::to_string(file.gid);
  return file;
}

Identity IdentityOf(std::uint32_t uid) {
  Identity identity{.uid = uid, .groups = {}, .name = std::to_string(uid)};
  const passwd* const user = ::getpwuid(uid);
  if (user == nullptr) return identity;
  identity.name = user->pw_name;
  constexpr int kGroupsMax = 1024;
  std::vector<gid_t> groups(kGroupsMax);
  int count = kGroupsMax;
  if (::getgrouplist(user->pw_name, user->pw_gid, groups.data(), &count) < 0) count = kGroupsMax;
  identity.groups.assign(groups.begin(), groups.begin() + count);
  return identity;
}

Identity OwnIdentity() {
  Identity identity = IdentityOf(::geteuid());
  identity.groups.assign(1, ::getegid());
  std::vector<gid_t> groups(static_cast<std::size_t>(std::max(0, ::getgroups(0, nullptr))));
  const int count = ::getgroups(static_cast<int>(groups.size()), groups.data());
  for (int k = 0; k < count; ++k) identity.groups.push_back(groups[static_cast<std::size_t>(k)]);
  return identity;
}

Identity IdentityOfDaemon(const Facts& facts, const char* service_user) {
  if (facts.daemon.process) return facts.daemon.process->user;
  if (facts.store_folder.trouble.empty() && !facts.store_folder.path.empty())
    return IdentityOf(facts.store_folder.uid);
  const passwd* const user = ::getpwnam(service_user);
  return user != nullptr ? IdentityOf(user->pw_uid) : facts.operator_user;
}

Facts ReadFacts(const ReadOptions& options) {
  const Error unknown{ErrorCode::kUnavailable, "the configuration cannot be read"};
  Facts facts{.program_version = options.program_version,
              .config_path = options.config_path,
              .config = LoadConfig(options.config_path),
              .buses = tl::unexpected(unknown),
              .host = ReadHost(),
              .interfaces = {},
              .bus_sockets_folder = {},
              .store_folder = {},
              .camera_folder = {},
              .gpio_chip = {},
              .disks = {},
              .store = {},
              .dds = tl::unexpected(unknown),
              .daemon = {},
              .operator_user = OwnIdentity(),
              .daemon_user = {}};
  if (facts.config) ReadNamed(*facts.config, &facts);
  std::string socket = options.socket;
  if (socket.empty())
    socket = facts.config ? facts.config->control.socket : options.socket_otherwise;
  facts.daemon = ReadDaemon(socket);
  facts.daemon_user = IdentityOfDaemon(facts, kServiceUser);
  return facts;
}

}  // namespace focalfleet::doctor
