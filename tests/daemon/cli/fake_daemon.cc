#include "tests/daemon/cli/fake_daemon.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <stdexcept>

namespace focalfleet::test {

FakeDaemon::FakeDaemon(const std::string& path, std::map<std::string, FakeAnswer> answers)
    : path_(path), answers_(std::move(answers)) {
  auto server = LineServer::Create(path);
  if (!server) throw std::runtime_error(server.error().text);
  server_.emplace(std::move(*server));
  if (pipe2(quit_, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  thread_ = std::thread([this] { Serve(); });
}

FakeDaemon::~FakeDaemon() {
  close(quit_[1]);
  thread_.join();
  close(quit_[0]);
}

std::vector<ControlRequest> FakeDaemon::requests() const {
  const std::lock_guard lock(mutex_);
  return requests_;
}

void FakeDaemon::Serve() {
  for (;;) {
    std::array<pollfd, 2> polls{pollfd{server_->fd(), POLLIN, 0}, pollfd{quit_[0], POLLIN, 0}};
    poll(polls.data(), polls.size(), -1);
    if (polls[1].revents != 0) return;
    std::vector<IncomingLine> urgent;  // stays empty: none of the lines is urgent
    server_->Service(&urgent);
    while (const auto line = server_->Next()) {
      if (!AnswerLine(*line)) {
        server_.reset();
        return;
      }
    }
  }
}

bool FakeDaemon::AnswerLine(const IncomingLine& line) {
  const auto request = DecodeRequest(line.text);
  if (!request) {
    server_->Answer(line.client, EncodeError(0, request.error()));
    return true;
  }
  {
    const std::lock_guard lock(mutex_);
    requests_.push_back(*request);
  }
  const auto found = answers_.find(request->verb);
  if (found == answers_.end()) {
    server_->Answer(line.client, EncodeError(request->id, {ErrorCode::kInvalid, "no such verb"}));
    return true;
  }
  FakeAnswer& answer = found->second;
  if (answer.full_first > 0) {
    --answer.full_first;
    server_->Answer(line.client, EncodeError(request->id, {ErrorCode::kFull, "too many clients"}));
    return true;
  }
  for (const Json& progress : answer.progress) {
    server_->Progress(line.client, EncodeProgress(request->id, progress));
  }
  const auto unit = request->args.find("unit_id");
  if (unit != request->args.end() &&
      std::ranges::count(answer.refused_units, unit->get<std::uint32_t>()) > 0) {
    server_->Answer(line.client, EncodeError(request->id, {ErrorCode::kRefused, "not now"}));
    return true;
  }
  if (answer.hang_up || answer.answers_most == 0) return false;
  if (answer.answers_most > 0) --answer.answers_most;
  server_->Answer(line.client, answer.result ? EncodeResult(request->id, *answer.result)
                                             : EncodeError(request->id, answer.result.error()));
  return true;
}

}  // namespace focalfleet::test
