#include "daemon/control/line_server.h"

#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <span>
#include <utility>

#include "daemon/control/line_buffer.h"
#include "daemon/control/unix_address.h"

namespace focalfleet {
namespace {

// In the inner epoll, clients carry their id; these cannot be ids.
constexpr std::uint64_t kListener = 0;
constexpr std::uint64_t kAgain = ~std::uint64_t{0};
constexpr std::uint64_t kResume = kAgain - 1;

/// A flood of connections is taken in pieces, so that those who are in are read in between.
constexpr int kAcceptsPerTurn = 16;

bool NoDescriptor(int error) { return error == EMFILE || error == ENFILE; }
bool NoRoom(int error) { return NoDescriptor(error) || error == ENOBUFS || error == ENOMEM; }

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
  void Service(std::vector<IncomingLine>* urgent);
  std::optional<IncomingLine> Next();
  bool Queue(ClientId id, std::string_view line, bool last);

  [[nodiscard]] int fd() const { return epoll_; }
  [[nodiscard]] bool connected(ClientId id) const { return clients_.contains(id); }
  [[nodiscard]] std::size_t clients() const { return clients_.size(); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  struct Client {
    int fd = -1;
    bool reserved = false;     // its place is one of the reserved ones
    std::uint64_t active = 0;  // by active_: when it was last accepted, heard or answered
    LineBuffer input;
    std::string output;
    std::size_t written = 0;  // of output
    std::uint32_t open = 0;   // lines handed out and not yet answered
    std::uint32_t watched = 0;
    bool input_ended = false;  // it will ask nothing more
    bool closing = false;      // only its output is still of interest
    bool deaf = false;         // it closed: what it asked still counts, answers do not

    [[nodiscard]] std::size_t waiting() const { return output.size() - written; }
  };

  Status Listen(const UnixAddress& temporary, const std::string& temporary_path);
  void Accept();
  bool AcceptOne();
  void Admit(int fd, bool reserved);
  void ReportAndClose(int fd, const std::string& why) const;
  bool DropIdlest(bool reserved);
  void PauseAccepting();
  void ResumeAccepting();
  void KeepSpares();
  void PromoteReserved();
  void Drop(ClientId id);
  bool Read(Client* client);
  bool Write(Client* client);
  void TakeUrgent(std::vector<IncomingLine>* urgent);
  bool CheckLength(Client* client);
  bool Settle(ClientId id, Client* client);
  void Watch(ClientId id, Client* client);
  void Remind();
  [[nodiscard]] bool Listens(const Client& client) const {
    return !client.closing && client.waiting() <= options_.output_bytes_pause;
  }
  [[nodiscard]] bool Ready(const Client& client) const {
    return client.input.has_line() && Listens(client);
  }
  [[nodiscard]] bool Idle(const Client& client) const;
  [[nodiscard]] std::size_t Taken(bool reserved) const {
    return reserved ? reserved_ : clients_.size() - reserved_;
  }
  [[nodiscard]] std::size_t reserved_max() const {
    return options_.urgent ? options_.reserved_max : 0;
  }

  std::string path_;
  Options options_;
  int listener_ = -1;
  int epoll_ = -1;
  int again_ = -1;   // readable while some client has a complete line that was not handed out yet
  int resume_ = -1;  // a timer: accept again
  bool reminded_ = false;  // again_ is readable
  dev_t device_ = 0;
  ino_t inode_ = 0;
  ClientId next_ = 1;
  ClientId turn_ = 0;  // whose line was handed out last
  std::uint64_t active_ = 0;
  std::size_t reserved_ = 0;  // of clients_
  std::map<ClientId, Client> clients_;
  std::vector<int> spares_;  // descriptors for reserved places, while there is nobody in them
};

LineServer::Impl::~Impl() {
  for (auto& [id, client] : clients_) ::close(client.fd);
  for (const int fd : {listener_, epoll_, again_, resume_})
    if (fd >= 0) ::close(fd);
  for (const int fd : spares_) ::close(fd);
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
  resume_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  const auto watch = [this](int fd, std::uint64_t what) {
    epoll_event event{EPOLLIN, {.u64 = what}};
    return ::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) == 0;
  };
  if (epoll_ < 0 || again_ < 0 || resume_ < 0 || !watch(listener_, kListener) ||
      !watch(again_, kAgain) || !watch(resume_, kResume))
    return Fail(ErrorCode::kUnavailable, path_ + ": " + Reason());
  KeepSpares();
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
  if (::chmod(temporary_path.c_str(), 0660) != 0 || ::listen(listener_, SOMAXCONN) != 0 ||
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
  for (int n = 0; n < kAcceptsPerTurn; ++n)
    if (!AcceptOne()) return;
}

/// False: nobody waits, or nobody can be taken now.
bool LineServer::Impl::AcceptOne() {
  bool spared = false;
  int fd = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd < 0 && NoDescriptor(errno)) {
    if (!DropIdlest(false)) {
      spared = !spares_.empty();
      if (spared) {
        ::close(spares_.back());
        spares_.pop_back();
      } else {
        DropIdlest(true);
      }
    }
    fd = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  }
  if (fd < 0) {
    if (NoRoom(errno)) PauseAccepting();
    return false;
  }
  if (!spared && (Taken(false) < options_.clients_max || DropIdlest(false)))
    Admit(fd, false);
  else if (Taken(true) < reserved_max() || DropIdlest(true))
    Admit(fd, true);
  else
    ReportAndClose(fd, "too many clients at " + path_ + ", and none of them is idle");
  return true;
}

void LineServer::Impl::Admit(int fd, bool reserved) {
  const ClientId id = next_++;
  Client& client = clients_[id];
  client.fd = fd;
  client.reserved = reserved;
  client.active = ++active_;
  client.watched = EPOLLIN;
  reserved_ += reserved ? 1u : 0u;
  epoll_event event{EPOLLIN, {.u64 = id}};
  if (::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) != 0) Drop(id);
}

void LineServer::Impl::ReportAndClose(int fd, const std::string& why) const {
  const std::string text = EncodeError(0, {ErrorCode::kFull, why}) + "\n";
  [[maybe_unused]] const ssize_t reported = ::send(fd, text.data(), text.size(), MSG_NOSIGNAL);
  ::close(fd);
}

/// Whether a client may lose its place: it has asked nothing that is still open, and nothing that
/// it sent waits, unless it does not read its answers.
bool LineServer::Impl::Idle(const Client& client) const {
  if (client.open > 0) return false;
  if (!Listens(client)) return true;  // what it has sent is not taken until it reads
  if (Ready(client)) return false;
  char unread = 0;  // that has come since the last look
  return ::recv(client.fd, &unread, 1, MSG_PEEK | MSG_DONTWAIT) <= 0;
}

/// Makes room. False: nobody is idle.
bool LineServer::Impl::DropIdlest(bool reserved) {
  auto idlest = clients_.end();
  for (auto it = clients_.begin(); it != clients_.end(); ++it)
    if (it->second.reserved == reserved &&
        (idlest == clients_.end() || it->second.active < idlest->second.active) && Idle(it->second))
      idlest = it;
  if (idlest == clients_.end()) return false;
  // In the middle of an answer it is told nothing: that would be part of the answer.
  if (idlest->second.waiting() == 0)
    ReportAndClose(std::exchange(idlest->second.fd, -1),
                   "too many clients at " + path_ + ": this one was idle longest");
  Drop(idlest->first);
  return true;
}

void LineServer::Impl::PauseAccepting() {
  epoll_event nothing{0, {.u64 = kListener}};
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, listener_, &nothing);
  itimerspec when{};
  const auto seconds = std::chrono::floor<std::chrono::seconds>(options_.accept_pause);
  when.it_value.tv_sec = seconds.count();
  when.it_value.tv_nsec = std::chrono::nanoseconds(options_.accept_pause - seconds).count();
  ::timerfd_settime(resume_, 0, &when, nullptr);
}

void LineServer::Impl::ResumeAccepting() {
  std::uint64_t expirations = 0;
  [[maybe_unused]] const ssize_t got = ::read(resume_, &expirations, sizeof expirations);
  epoll_event listen{EPOLLIN, {.u64 = kListener}};
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, listener_, &listen);
}

void LineServer::Impl::KeepSpares() {
  while (spares_.size() + reserved_ < reserved_max()) {
    const int fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (fd < 0) return;  // tried again with the next turn
    spares_.push_back(fd);
  }
}

/// Clients in reserved places get one of the others as soon as there is one.
void LineServer::Impl::PromoteReserved() {
  for (auto& [id, client] : clients_) {
    if (reserved_ == 0 || Taken(false) >= options_.clients_max) return;
    reserved_ -= std::exchange(client.reserved, false) ? 1u : 0u;
  }
}

void LineServer::Impl::Drop(ClientId id) {
  const auto it = clients_.find(id);
  if (it == clients_.end()) return;
  if (it->second.fd >= 0) ::close(it->second.fd);
  reserved_ -= it->second.reserved ? 1u : 0u;
  clients_.erase(it);
}

/// Reads one chunk, so that one busy client does not keep the others waiting. False: the client is
/// gone.
bool LineServer::Impl::Read(Client* client) {
  std::array<char, 65536> chunk;
  const ssize_t got = ::recv(client->fd, chunk.data(), chunk.size(), 0);
  if (got > 0) {
    client->input.Append({chunk.data(), static_cast<std::size_t>(got)});
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

/// False: its next line is too long; it is told so, and nothing more of it is taken.
bool LineServer::Impl::CheckLength(Client* client) {
  if (client->input.first_bytes() <= options_.line_bytes_max) return true;
  client->output +=
      EncodeError(0, {ErrorCode::kInvalid,
                      "a line of more than " + std::to_string(options_.line_bytes_max) + " bytes"});
  client->output += '\n';
  client->input.Clear();
  client->closing = true;
  return false;
}

/// Writes, and watches for what matters next. False: nothing matters any more, drop it.
bool LineServer::Impl::Settle(ClientId id, Client* client) {
  if (!Write(client)) return false;
  if (client->waiting() > options_.output_bytes_max) return false;
  const bool asks_nothing = client->input_ended && !client->input.has_line();
  const bool nothing_more =
      client->closing || (asks_nothing && (client->open == 0 || client->deaf));
  if (nothing_more && client->waiting() == 0) return false;
  Watch(id, client);
  return true;
}

void LineServer::Impl::Watch(ClientId id, Client* client) {
  const bool wanted_now = !client->input.has_line() && Listens(*client);
  const bool wanted_ahead = options_.urgent && client->input.size() < options_.ahead_bytes;
  const bool read = !client->input_ended && !client->closing && (wanted_now || wanted_ahead);
  const std::uint32_t wanted =
      (read ? std::uint32_t{EPOLLIN} : 0u) | (client->waiting() > 0 ? std::uint32_t{EPOLLOUT} : 0u);
  if (wanted == client->watched) return;
  client->watched = wanted;
  epoll_event event{wanted, {.u64 = id}};
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, client->fd, &event);
}

/// Takes an urgent line of each client. Lines that other clients have sent by then count as earlier
/// than it: the order of two sockets in one turn is not known.
void LineServer::Impl::TakeUrgent(std::vector<IncomingLine>* urgent) {
  const std::size_t before = urgent->size();
  for (auto& [id, client] : clients_) {
    if (client.closing) continue;
    auto line = client.input.TakeUrgent(options_.urgent);
    if (!line) continue;
    ++client.open;
    client.active = ++active_;
    urgent->push_back({.client = id, .text = std::move(*line), .reserved = client.reserved});
  }
  const auto taken = std::span(*urgent).subspan(before);
  for (auto& [id, client] : clients_)
    if (std::ranges::any_of(taken, [id = id](const auto& line) { return line.client != id; }))
      client.input.Overtake();
}

void LineServer::Impl::Service(std::vector<IncomingLine>* urgent) {
  std::array<epoll_event, 128> events;
  const int ready = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), 0);
  bool accept = false;
  for (int i = 0; i < ready; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    accept = accept || event.data.u64 == kListener;
    if (event.data.u64 == kResume) ResumeAccepting();
    const auto it = clients_.find(event.data.u64);
    if (it == clients_.end()) continue;
    // A peer that asked and closed at once ("stop", and away) is still heard.
    it->second.deaf = it->second.deaf || (event.events & (EPOLLHUP | EPOLLERR)) != 0;
    const bool readable = it->second.deaf || (event.events & EPOLLIN) != 0;
    if (readable && !Read(&it->second)) Drop(it->first);
  }
  if (options_.urgent) TakeUrgent(urgent);
  for (auto it = clients_.begin(); it != clients_.end();) {
    const ClientId id = it->first;
    Client& client = it->second;
    ++it;
    CheckLength(&client);
    if (!Settle(id, &client)) Drop(id);
  }
  // After the others were read: who has just spoken is not idle.
  if (accept) Accept();
  PromoteReserved();
  KeepSpares();
  Remind();
}

std::optional<IncomingLine> LineServer::Impl::Next() {
  std::optional<IncomingLine> next;
  auto it = clients_.upper_bound(turn_);
  for (std::size_t left = clients_.size(); left > 0 && !next; --left) {
    if (it == clients_.end()) it = clients_.begin();
    const ClientId id = it->first;
    Client& client = it->second;
    ++it;
    if (!Ready(client)) continue;
    if (CheckLength(&client)) {
      auto line = client.input.Take();
      ++client.open;
      client.active = ++active_;
      turn_ = id;
      next = {id, std::move(line->text), line->overtaken, client.reserved};
    }
    if (!Settle(id, &client)) Drop(id);
  }
  Remind();
  return next;
}

/// Sees to it that the next call comes at once where there is something left to hand out.
void LineServer::Impl::Remind() {
  const bool more = std::ranges::any_of(clients_, [this](const auto& entry) {
    const Client& client = entry.second;
    return Ready(client) || (options_.urgent && !client.closing && client.input.unseen());
  });
  if (more == std::exchange(reminded_, more)) return;
  std::uint64_t count = 1;
  [[maybe_unused]] const ssize_t reported =
      more ? ::write(again_, &count, sizeof count) : ::read(again_, &count, sizeof count);
}

bool LineServer::Impl::Queue(ClientId id, std::string_view line, bool last) {
  const auto it = clients_.find(id);
  if (it == clients_.end()) return false;
  Client& client = it->second;
  if (last && client.open > 0) --client.open;
  client.active = ++active_;
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
void LineServer::Service(std::vector<IncomingLine>* urgent) { impl_->Service(urgent); }
std::optional<IncomingLine> LineServer::Next() { return impl_->Next(); }
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
