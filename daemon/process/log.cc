#include "daemon/process/log.h"

#include <spdlog/formatter.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "daemon/control/printable.h"

namespace focalfleet {
namespace {

/// The formatter makes each event one line, whatever its text holds: names of verbs, exposures and
/// files come from outside.
class OneLine : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    const std::string text = Printable({message.payload.data(), message.payload.size()});
    spdlog::details::log_msg clean = message;
    clean.payload = text;
    pattern_.format(clean, out);
  }
  [[nodiscard]] std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<OneLine>();
  }

 private:
  spdlog::pattern_formatter pattern_{"%Y-%m-%dT%H:%M:%S.%e%z %l %v"};
};

}  // namespace

Status OpenLog(const DaemonConfig::Log& log) {
  // spdlog would create missing folders, even those of a misspelt path.
  const std::filesystem::path folder = std::filesystem::path(log.file).parent_path();
  std::error_code failed;
  if (!folder.empty() && !std::filesystem::is_directory(folder, failed))
    return Fail(ErrorCode::kUnavailable,
                log.file_at + ": log.file: there is no folder " + folder.string());
  std::shared_ptr<spdlog::logger> logger;
  try {  // spdlog throws where a file cannot be opened
    spdlog::sink_ptr sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
    if (!log.file.empty()) sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(log.file);
    logger = std::make_shared<spdlog::logger>("focalfleetd", std::move(sink));
  } catch (const spdlog::spdlog_ex& error) {
    return Fail(ErrorCode::kUnavailable, log.file_at + ": log.file: " + error.what());
  }
  logger->set_level(spdlog::level::from_str(log.level));
  logger->set_formatter(std::make_unique<OneLine>());
  // A crash must not take the last sentences with it.
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
  return {};
}

}  // namespace focalfleet
