#include "daemon/process/dds_setup.h"

#include <spdlog/spdlog.h>

#include <cstdlib>
#include <utility>

namespace focalfleet {

DdsOptions DdsOptionsOf(const DaemonConfig::Dds& dds) {
  return {.domain = dds.domain,
          .config_xml = dds.config.empty() ? "" : "file://" + dds.config,
          .security = dds.security};
}

DdsOptions StatusOptionsOf(const DaemonConfig& config) {
  DdsOptions options = DdsOptionsOf(config.dds);
  if (config.sector.present()) options.partition = SectorPartition(config.sector.number);
  return options;
}

void WarnOfDdsEnvironment(const DaemonConfig::Dds& dds) {
  if (std::getenv("CYCLONEDDS_URI") != nullptr)
    spdlog::warn("CYCLONEDDS_URI is set and is not used: dds.config says where status goes, {}",
                 dds.config.empty() ? "the loopback interface only" : dds.config);
}

std::unique_ptr<CredentialWatch> WatchCredentials(const DaemonConfig::Dds& dds,
                                                  DdsTroubles* troubles,
                                                  std::function<void(WallTime end)> renew) {
  if (dds.security.empty()) return nullptr;
  return std::make_unique<CredentialWatch>(CredentialWatch::Options{
      .folder = dds.security,
      .note = [troubles](const ShellNote& note) { troubles->Note(note); },
      .renew =
          [renew = std::move(renew)](WallTime end) {
            spdlog::info("DDS: new credentials, a new participant joins beside the old one");
            renew(end);
          },
      .tell =
          [](const std::string& trouble) {
            spdlog::error("DDS: the credentials cannot be read: {}", trouble);
          }});
}

}  // namespace focalfleet
