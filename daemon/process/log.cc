#include "daemon/process/log.h"

#include <spdlog/details/file_helper.h>
#include <spdlog/formatter.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "daemon/control/printable.h"
#include "daemon/loop/event_log.h"
#include "daemon/systemd/journal_socket.h"

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

/// A file that can be opened anew. spdlog's own sink has no way to ask for that.
class FileSink : public spdlog::sinks::base_sink<std::mutex> {
 public:
  /// Throws as spdlog does where the file cannot be opened.
  explicit FileSink(std::string path) : path_(std::move(path)), file_(Open()) {}
  /// As the constructor; after an exception the earlier file is in use.
  void Reopen() {
    const std::lock_guard lock(mutex_);
    file_ = Open();
  }
  [[nodiscard]] const std::string& path() const { return path_; }

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    spdlog::memory_buf_t line;
    formatter_->format(message, line);
    file_->write(line);
  }
  void flush_() override { file_->flush(); }

 private:
  using File = std::unique_ptr<spdlog::details::file_helper>;
  [[nodiscard]] File Open() const {
    auto file = std::make_unique<spdlog::details::file_helper>();
    file->open(path_);
    return file;
  }

  std::string path_;
  File file_;
};

/// The journal, with the fields of each event (loop/event_log.h).
class JournalSink : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit JournalSink(const std::string& socket) : journal_(socket) {}

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    const std::string text = Printable({message.payload.data(), message.payload.size()});
    std::vector<std::pair<const char*, std::string>> values = {
        {"MESSAGE", text},
        {"PRIORITY", std::to_string(PriorityOf(message.level))},
        {"SYSLOG_IDENTIFIER", "focalfleetd"}};
    if (const EventFields* const fields = FieldsOfThisEvent()) {
      if (fields->message_id != nullptr) values.emplace_back("MESSAGE_ID", fields->message_id);
      if (fields->alarm != nullptr) values.emplace_back("ALARM", fields->alarm);
      if (fields->unit) values.emplace_back("UNIT_ID", std::to_string(fields->unit->value));
      if (fields->bus) values.emplace_back("BUS", std::to_string(fields->bus->value));
      if (fields->configuration)
        values.emplace_back("CONFIGURATION", std::to_string(*fields->configuration));
    }
    std::vector<JournalField> event;
    for (const auto& [name, value] : values) event.push_back({name, value});
    if (!journal_.Send(event)) otherwise_.log(message);
  }
  void flush_() override {}
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    otherwise_.set_formatter(std::move(formatter));
  }

 private:
  /// As syslog(3) numbers them.
  static int PriorityOf(spdlog::level::level_enum level) {
    constexpr std::array kPriorities = {7, 7, 6, 4, 3, 2, 2};  // trace .. off
    return kPriorities[static_cast<std::size_t>(level)];
  }

  JournalSocket journal_;
  spdlog::sinks::stderr_sink_mt otherwise_;
};

spdlog::sink_ptr SinkOf(const DaemonConfig::Log& log, const JournalPlace& journal) {
  if (!log.file.empty()) return std::make_shared<FileSink>(log.file);
  if (log.journal && journal.takes_standard_error)
    return std::make_shared<JournalSink>(journal.socket);
  return std::make_shared<spdlog::sinks::stderr_sink_mt>();
}

}  // namespace

JournalPlace JournalOfThisProcess() {
  return {.takes_standard_error =
              StandardErrorIsJournal([](const char* name) { return std::getenv(name); }),
          .socket = JournalSocket::kPath};
}

Status OpenLog(const DaemonConfig::Log& log, const JournalPlace& journal) {
  // spdlog would create missing folders, even those of a misspelt path.
  const std::filesystem::path folder = std::filesystem::path(log.file).parent_path();
  std::error_code failed;
  if (!folder.empty() && !std::filesystem::is_directory(folder, failed))
    return Fail(ErrorCode::kUnavailable,
                log.file_at + ": log.file: there is no folder " + folder.string());
  std::shared_ptr<spdlog::logger> logger;
  try {  // spdlog throws where a file cannot be opened
    logger = std::make_shared<spdlog::logger>("focalfleetd", SinkOf(log, journal));
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

void ReopenLog() {
  for (const spdlog::sink_ptr& sink : spdlog::default_logger()->sinks()) {
    const auto file = std::dynamic_pointer_cast<FileSink>(sink);
    if (file == nullptr) continue;
    try {
      file->Reopen();
    } catch (const spdlog::spdlog_ex& error) {
      spdlog::error("log.file stays as it is: {}", error.what());
      continue;
    }
    spdlog::info("the log goes on in {}, opened anew", file->path());
  }
}

}  // namespace focalfleet
