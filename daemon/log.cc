#include "daemon/log.h"

#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>

namespace focalfleet {

Status OpenLog(const DaemonConfig::Log& log) {
  std::shared_ptr<spdlog::logger> logger;
  try {  // spdlog's own way of saying that a file cannot be opened
    spdlog::sink_ptr sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
    if (!log.file.empty()) sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(log.file);
    logger = std::make_shared<spdlog::logger>("focalfleetd", std::move(sink));
  } catch (const spdlog::spdlog_ex& error) {
    return Fail(ErrorCode::kUnavailable, error.what());
  }
  logger->set_level(spdlog::level::from_str(log.level));
  logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
  // A crash must not take the last sentences with it.
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
  return {};
}

}  // namespace focalfleet
