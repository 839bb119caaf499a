#include "daemon/control/line_server.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <utility>

#include "daemon/control/unix_address.h"

namespace focalfleet {
namespace {

// In the inner epoll, clients carry their id; these two cannot be ids.
constexpr std::uint64_t kListener = 0;
constexpr std::uint64_t kAgain = ~std::uint64_t{0};

std::string Reason() { return std::strerror(errno); }

/// Whether somebody accepts connections at this address.
bool Answers(const UnixAddress& address) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return true;  // cannot know: do not take it away from anybody
  const int status = ::connect(fd, address.get(), address.length());
  // EAGAIN: it lives, only its backlog is full.
  const bool answers = status == 0 || (errno != ECONNREFUSED && errno != ENOENT);
  ::close(fd);
  return answers;
}

Status CheckFree(const std::string& path, const UnixAddress& address) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0) {
    if (errno == ENOENT) return {};
    return Fail(ErrorCode::kUnavailable, path + ": " + Reason());
  }
  if (!S_ISSOCK(info.st_mode))
    return Fail(ErrorCode::kUnavailable, path + " exists and is not a socket");
  if (Answers(address))
    return Fail(ErrorCode::kRefused, path + " is in use: another process answers there");
  return {};
}

}  // namespace

class LineServer::Impl {
 public:
  Impl(std::string path, const Options& options) : path_(std::move(path)), options_(options) {}
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  Status Open();
  void Service(std::vector<IncomingLine>* lines);
  bool Queue(ClientId id, std::string_view line, bool last);

  [[nodiscard]] int fd() const { return epoll_; }
  [[nodiscard]] bool connected(ClientId id) const { return clients_.contains(id); }
  [[nodiscard]] std::size_t clients() const { return clients_.size(); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  struct Client {
    int fd = -1;
    std::string input;
    std::size_t line_end = std::string::npos;  // of the first complete line in input
    std::string output;
    std::size_t written = 0;  // of output
    std::uint32_t open = 0;   // lines handed out and not yet answered
    std::uint32_t watched = 0;
    bool input_ended = false;  // it will ask nothing more
    bool closing = false;      // only its output is still of interest
    bool deaf = false;         // it closed: what it asked still counts, answers do not

    [[nodiscard]] std::size_t waiting() const { return output.size() - written; }
    [[nodiscard]] bool has_line() const { return line_end != std::string::npos; }
  };

  Status Listen(const UnixAddress& temporary, const std::string& temporary_path);
  void Accept();
  void Drop(ClientId id);
  bool Read(Client* client);
  bool Write(Client* client);
  bool TakeLine(Client* client, std::string* line);
  bool Settle(ClientId id, Client* client);
  void Watch(ClientId id, Client* client);
  [[nodiscard]] bool Listens(const Client& client) const {
    return !client.closing && client.waiting() <= options_.output_bytes_pause;
  }

  std::string path_;
  Options options_;
  int listener_ = -1;
  int epoll_ = -1;
  int again_ = -1;  // readable while some client has a complete line that was not handed out yet
  dev_t device_ = 0;
  ino_t inode_ = 0;
  ClientId next_ = 1;
  std::map<ClientId, Client> clients_;
};

LineServer::Impl::~Impl() {
  for (auto& [id, client] : clients_) ::close(client.fd);
  for (const int fd : {listener_, epoll_, again_})
    if (fd >= 0) ::close(fd);
  struct stat info {};
  if (inode_ != 0 && ::lstat(path_.c_str(), &info) == 0 && info.st_ino == inode_ &&
      info.st_dev == device_)
    ::unlink(path_.c_str());
}

Status LineServer::Impl::Open() {
  FOCALFLEET_TRY_ASSIGN(const UnixAddress address, UnixAddress::Of(path_));
  const std::string temporary_path = path_ + ".new";
  FOCALFLEET_TRY_ASSIGN(const UnixAddress temporary, UnixAddress::Of(temporary_path));
  FOCALFLEET_TRY(CheckFree(path_, address));
  FOCALFLEET_TRY(Listen(temporary, temporary_path));
  epoll_ = ::epoll_create1(EPOLL_CLOEXEC);
  again_ = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  epoll_event listen{EPOLLIN, {.u64 = kListener}};
  epoll_event again{EPOLLIN, {.u64 = kAgain}};
  if (epoll_ < 0 || again_ < 0 || ::epoll_ctl(epoll_, EPOLL_CTL_ADD, listener_, &listen) != 0 ||
      ::epoll_ctl(epoll_, EPOLL_CTL_ADD, again_, &again) != 0)
    return Fail(ErrorCode::kUnavailable, path_ + ": " + Reason());
  return {};
}

Status LineServer::Impl::Listen(const UnixAddress& temporary, const std::string& temporary_path) {
  const auto failed = [&] {
    return Fail(ErrorCode::kUnavailable, "cannot listen at " + path_ + ": " + Reason());
  };
  listener_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (listener_ < 0) return failed();
  ::unlink(temporary_path.c_str());
  if (::bind(listener_, temporary.get(), temporary.length()) != 0) return failed();
  struct stat info {};
  if (::chmod(temporary_path.c_str(), 0660) != 0 || ::listen(listener_, 16) != 0 ||
      ::stat(temporary_path.c_str(), &info) != 0 ||
      ::rename(temporary_path.c_str(), path_.c_str()) != 0) {
    auto error = failed();
    ::unlink(temporary_path.c_str());
    return error;
  }
  device_ = info.st_dev;
  inode_ = info.st_ino;
  return {};
}

void LineServer::Impl::Accept() {
  for (;;) {
    const int fd = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) return;
    if (clients_.size() >= options_.clients_max) {
      const std::string text =
          EncodeError(0, {ErrorCode::kFull, "too many clients at " + path_}) + "\n";
      [[maybe_unused]] const ssize_t told = ::send(fd, text.data(), text.size(), MSG_NOSIGNAL);
      ::close(fd);
      continue;
    }
    const ClientId id = next_++;
    Client& client = clients_[id];
    client.fd = fd;
    client.watched = EPOLLIN;
    epoll_event event{EPOLLIN, {.u64 = id}};
    if (::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) != 0) Drop(id);
  }
}

void LineServer::Impl::Drop(ClientId id) {
  const auto it = clients_.find(id);
  if (it == clients_.end()) return;
  ::close(it->second.fd);
  clients_.erase(it);
}

/// Reads one chunk, so that one busy client does not keep the others waiting. False: the client is
/// gone.
bool LineServer::Impl::Read(Client* client) {
  std::array<char, 65536> chunk;
  const ssize_t got = ::recv(client->fd, chunk.data(), chunk.size(), 0);
  if (got > 0) {
    const std::size_t searched = client->input.size();
    client->input.append(chunk.data(), static_cast<std::size_t>(got));
    if (!client->has_line()) client->line_end = client->input.find('\n', searched);
    return true;
  }
  if (got == 0) {
    client->input_ended = true;
    return true;
  }
  // A peer that closed with answers unread: the reset comes first, its last lines after it.
  return errno == EAGAIN || errno == EINTR || errno == ECONNRESET;
}

/// Writes what goes. False: the client is gone.
bool LineServer::Impl::Write(Client* client) {
  if (client->deaf) client->written = client->output.size();
  while (client->waiting() > 0) {
    const ssize_t sent = ::send(client->fd, client->output.data() + client->written,
                                client->waiting(), MSG_NOSIGNAL);
    if (sent < 0) return errno == EAGAIN || errno == EINTR;
    client->written += static_cast<std::size_t>(sent);
  }
  client->output.clear();
  client->written = 0;
  return true;
}

bool LineServer::Impl::TakeLine(Client* client, std::string* line) {
  const std::size_t length = client->has_line() ? client->line_end : client->input.size();
  if (length > options_.line_bytes_max) {
    client->output += EncodeError(
        0, {ErrorCode::kInvalid,
            "a line of more than " + std::to_string(options_.line_bytes_max) + " bytes"});
    client->output += '\n';
    client->input.clear();
    client->line_end = std::string::npos;
    client->closing = true;
    return false;
  }
  if (!client->has_line()) return false;
  line->assign(client->input, 0, length);
  client->input.erase(0, length + 1);
  client->line_end = client->input.find('\n');
  ++client->open;
  return true;
}

/// Writes, and watches for what matters next. False: nothing matters any more, drop it.
bool LineServer::Impl::Settle(ClientId id, Client* client) {
  if (!Write(client)) return false;
  if (client->waiting() > options_.output_bytes_max) return false;
  const bool asks_nothing = client->input_ended && !client->has_line();
  const bool nothing_more =
      client->closing || (asks_nothing && (client->open == 0 || client->deaf));
  if (nothing_more && client->waiting() == 0) return false;
  Watch(id, client);
  return true;
}

void LineServer::Impl::Watch(ClientId id, Client* client) {
  const bool read = !client->input_ended && !client->has_line() && Listens(*client);
  const std::uint32_t wanted =
      (read ? std::uint32_t{EPOLLIN} : 0u) | (client->waiting() > 0 ? std::uint32_t{EPOLLOUT} : 0u);
  if (wanted == client->watched) return;
  client->watched = wanted;
  epoll_event event{wanted, {.u64 = id}};
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, client->fd, &event);
}

void LineServer::Impl::Service(std::vector<IncomingLine>* lines) {
  std::array<epoll_event, 64> events;
  const int ready = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < ready; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    if (event.data.u64 == kListener) Accept();
    const auto it = clients_.find(event.data.u64);
    if (it == clients_.end()) continue;
    // A peer that asked and closed at once ("stop", and away) is still heard.
    it->second.deaf = it->second.deaf || (event.events & (EPOLLHUP | EPOLLERR)) != 0;
    const bool readable = it->second.deaf || (event.events & EPOLLIN) != 0;
    if (readable && !Read(&it->second)) Drop(it->first);
  }
  bool more = false;
  for (auto it = clients_.begin(); it != clients_.end();) {
    const ClientId id = it->first;
    Client& client = it->second;
    ++it;
    std::string line;
    if (Listens(client) && TakeLine(&client, &line)) lines->push_back({id, std::move(line)});
    if (Settle(id, &client))
      more = more || (Listens(client) && client.has_line());
    else
      Drop(id);
  }
  std::uint64_t count = 1;
  [[maybe_unused]] const ssize_t told =
      more ? ::write(again_, &count, sizeof count) : ::read(again_, &count, sizeof count);
}

bool LineServer::Impl::Queue(ClientId id, std::string_view line, bool last) {
  const auto it = clients_.find(id);
  if (it == clients_.end()) return false;
  Client& client = it->second;
  if (last && client.open > 0) --client.open;
  if (client.closing || (!last && client.waiting() > options_.progress_bytes_max)) return true;
  client.output.append(line).push_back('\n');
  if (Settle(id, &client)) return true;
  Drop(id);
  return false;
}

LineServer::LineServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LineServer::LineServer(LineServer&&) noexcept = default;
LineServer& LineServer::operator=(LineServer&&) noexcept = default;
LineServer::~LineServer() = default;

Result<LineServer> LineServer::Create(const std::string& path, const Options& options) {
  auto impl = std::make_unique<Impl>(path, options);
  FOCALFLEET_TRY(impl->Open());
  return LineServer(std::move(impl));
}

int LineServer::fd() const { return impl_->fd(); }
void LineServer::Service(std::vector<IncomingLine>* lines) { impl_->Service(lines); }
bool LineServer::Answer(ClientId client, std::string_view line) {
  return impl_->Queue(client, line, true);
}
bool LineServer::Progress(ClientId client, std::string_view line) {
  return impl_->Queue(client, line, false);
}
bool LineServer::connected(ClientId client) const { return impl_->connected(client); }
std::size_t LineServer::clients() const { return impl_->clients(); }
const std::string& LineServer::path() const { return impl_->path(); }

}  // namespace focalfleet
