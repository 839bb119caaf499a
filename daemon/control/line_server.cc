#include "daemon/control/line_server.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <span>
#include <utility>

#include "daemon/control/listening_socket.h"
#include "daemon/control/server_client.h"
#include "daemon/control/spare_descriptors.h"

namespace focalfleet {
namespace {

// In the inner epoll, clients carry their id; these cannot be ids.
constexpr std::uint64_t kListener = 0;
constexpr std::uint64_t kAgain = ~std::uint64_t{0};
constexpr std::uint64_t kResume = kAgain - 1;

/// Limit of the connections accepted in a turn: in a flood of them, present clients are read in
/// between.
constexpr int kAcceptsPerTurn = 16;

std::size_t LineBytesMax(const LineServer::Options& options, const ServerClient& client) {
  return options.line_bytes_max_of ? options.line_bytes_max_of(client.caller.role)
                                   : options.line_bytes_max;
}

bool NoDescriptor(int error) { return error == EMFILE || error == ENFILE; }
bool NoRoom(int error) { return NoDescriptor(error) || error == ENOBUFS || error == ENOMEM; }

}  // namespace

class LineServer::Impl {
 public:
  Impl(ListeningSocket listener, const Options& options)
      : listener_(std::move(listener)), options_(options) {
    if (!options_.urgent) options_.reserved_max = 0;
  }
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
  [[nodiscard]] const std::string& path() const { return listener_.path(); }

 private:
  using Client = ServerClient;

  void Accept();
  bool AcceptOne();
  void Admit(int fd, Caller caller, bool reserved);
  bool TurnAway(int fd, const Caller& caller) const;
  bool DropIdlest(bool reserved);
  void PauseAccepting();
  void ResumeAccepting();
  void PromoteReserved();
  void Drop(ClientId id);
  void TakeUrgent(std::vector<IncomingLine>* urgent);
  bool Settle(ClientId id, Client* client);
  void Watch(ClientId id, Client* client);
  void Remind();
  [[nodiscard]] std::size_t Taken(bool reserved) const {
    return reserved ? reserved_ : clients_.size() - reserved_;
  }
  void KeepSpares() {
    spares_.Keep(options_.reserved_max - std::min(options_.reserved_max, reserved_));
  }

  ListeningSocket listener_;
  Options options_;
  int epoll_ = -1;
  int again_ = -1;         // readable while a complete line of some client waits
  int resume_ = -1;        // a timer: the end of a pause in accepting
  bool reminded_ = false;  // again_ is readable
  ClientId next_ = 1;
  ClientId turn_ = 0;  // client whose line was handed out last
  std::uint64_t active_ = 0;
  std::size_t reserved_ = 0;  // clients in reserved places
  std::map<ClientId, Client> clients_;
  SpareDescriptors spares_;  // for reserved places that no client has
};

LineServer::Impl::~Impl() {
  for (auto& [id, client] : clients_) ::close(client.fd);
  for (const int fd : {epoll_, again_, resume_})
    if (fd >= 0) ::close(fd);
}

Status LineServer::Impl::Open() {
  epoll_ = ::epoll_create1(EPOLL_CLOEXEC);
  again_ = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  resume_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  const auto watch = [this](int fd, std::uint64_t what) {
    epoll_event event{EPOLLIN, {.u64 = what}};
    return ::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) == 0;
  };
  if (epoll_ < 0 || again_ < 0 || resume_ < 0 || !watch(listener_.fd(), kListener) ||
      !watch(again_, kAgain) || !watch(resume_, kResume))
    return Fail(ErrorCode::kUnavailable, path() + ": " + std::strerror(errno));
  KeepSpares();
  return {};
}

void LineServer::Impl::Accept() {
  for (int n = 0; n < kAcceptsPerTurn; ++n)
    if (!AcceptOne()) return;
}

/// False: no connection waits, or none can be accepted now.
bool LineServer::Impl::AcceptOne() {
  bool spared = false;
  int fd = listener_.Accept();
  if (fd < 0 && NoDescriptor(errno)) {
    if (!DropIdlest(false)) {
      spared = spares_.Release();
      if (!spared) DropIdlest(true);
    }
    fd = listener_.Accept();
  }
  if (fd < 0) {
    if (NoRoom(errno)) PauseAccepting();
    return false;
  }
  Caller caller{.peer = PeerOf(fd)};
  caller.role = options_.role_of ? options_.role_of(caller.peer) : Role::kEngineer;
  if (TurnAway(fd, caller)) return true;
  if (!spared && (Taken(false) < options_.clients_max || DropIdlest(false)))
    Admit(fd, std::move(caller), false);
  else if (Taken(true) < options_.reserved_max || DropIdlest(true))
    Admit(fd, std::move(caller), true);
  else
    ReportAndClose(fd, ErrorCode::kFull,
                   "too many clients at " + path() + ", and none of them is idle");
  return true;
}

/// True: the newcomer has no role, and is gone.
bool LineServer::Impl::TurnAway(int fd, const Caller& caller) const {
  if (caller.role != Role::kNone) return false;
  ReportAndClose(fd, ErrorCode::kRefused,
                 NameOf(caller) + " has no role here: " + path() +
                     " answers members of the groups that control.viewers, control.operators and "
                     "control.engineers name");
  if (options_.turned_away) options_.turned_away(caller);
  return true;
}

void LineServer::Impl::Admit(int fd, Caller caller, bool reserved) {
  const ClientId id = next_++;
  Client& client = clients_[id];
  client.fd = fd;
  client.reserved = reserved;
  client.caller = std::move(caller);
  client.active = ++active_;
  client.watched = EPOLLIN;
  reserved_ += reserved ? 1u : 0u;
  epoll_event event{EPOLLIN, {.u64 = id}};
  if (::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) != 0) Drop(id);
}

/// Makes room for a client. False: no client is idle.
bool LineServer::Impl::DropIdlest(bool reserved) {
  auto idlest = clients_.end();
  for (auto it = clients_.begin(); it != clients_.end(); ++it)
    if (it->second.reserved == reserved &&
        (idlest == clients_.end() || it->second.active < idlest->second.active) &&
        it->second.Idle(options_.output_bytes_pause))
      idlest = it;
  if (idlest == clients_.end()) return false;
  // In the middle of an answer the reason is not sent: it would be part of the answer.
  if (idlest->second.waiting() == 0)
    ReportAndClose(std::exchange(idlest->second.fd, -1), ErrorCode::kFull,
                   "too many clients at " + path() + ": this one was idle longest");
  Drop(idlest->first);
  return true;
}

void LineServer::Impl::PauseAccepting() {
  epoll_event nothing{0, {.u64 = kListener}};
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, listener_.fd(), &nothing);
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
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, listener_.fd(), &listen);
}

/// Clients in reserved places get other places as soon as there are any.
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

/// Writes, and watches for the next events. False: the client has ended, drop it.
bool LineServer::Impl::Settle(ClientId id, Client* client) {
  if (!client->Write()) return false;
  if (client->waiting() > options_.output_bytes_max) return false;
  const bool asks_nothing = client->input_ended && !client->input.has_line();
  const bool nothing_more =
      client->closing || (asks_nothing && (client->open == 0 || client->deaf));
  if (nothing_more && client->waiting() == 0) return false;
  Watch(id, client);
  return true;
}

void LineServer::Impl::Watch(ClientId id, Client* client) {
  const bool wanted_now = !client->input.has_line() && client->Listens(options_.output_bytes_pause);
  const bool wanted_ahead = options_.urgent && client->input.size() < options_.ahead_bytes;
  const bool read = !client->input_ended && !client->closing && (wanted_now || wanted_ahead);
  const std::uint32_t wanted =
      (read ? std::uint32_t{EPOLLIN} : 0u) | (client->waiting() > 0 ? std::uint32_t{EPOLLOUT} : 0u);
  if (wanted == client->watched) return;
  client->watched = wanted;
  epoll_event event{wanted, {.u64 = id}};
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, client->fd, &event);
}

/// Takes an urgent line of each client. Lines that other clients have sent by then count as
/// earlier: the order of two sockets within a turn is unknown.
void LineServer::Impl::TakeUrgent(std::vector<IncomingLine>* urgent) {
  const std::size_t before = urgent->size();
  for (auto& [id, client] : clients_) {
    if (client.closing) continue;
    auto line = client.input.TakeUrgent(options_.urgent);
    if (!line) continue;
    ++client.open;
    client.active = ++active_;
    urgent->push_back({.client = id,
                       .text = std::move(*line),
                       .reserved = client.reserved,
                       .caller = client.caller});
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
    // A peer that sent a request and closed at once is still heard.
    it->second.deaf = it->second.deaf || (event.events & (EPOLLHUP | EPOLLERR)) != 0;
    const bool readable = it->second.deaf || (event.events & EPOLLIN) != 0;
    if (readable && !it->second.Read()) Drop(it->first);
  }
  if (options_.urgent) TakeUrgent(urgent);
  for (auto it = clients_.begin(); it != clients_.end();) {
    const ClientId id = it->first;
    Client& client = it->second;
    ++it;
    client.CheckLength(LineBytesMax(options_, client));
    if (!Settle(id, &client)) Drop(id);
  }
  // Accept comes after the clients were read: a client that has just sent a line is not idle.
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
    if (!client.Ready(options_.output_bytes_pause)) continue;
    if (client.CheckLength(LineBytesMax(options_, client))) {
      auto line = client.input.Take();
      ++client.open;
      client.active = ++active_;
      turn_ = id;
      next = {id, std::move(line->text), line->overtaken, client.reserved, client.caller};
    }
    if (!Settle(id, &client)) Drop(id);
  }
  Remind();
  return next;
}

/// fd() is readable exactly while lines are left to hand out.
void LineServer::Impl::Remind() {
  const bool more = std::ranges::any_of(clients_, [this](const auto& entry) {
    const Client& client = entry.second;
    return client.Ready(options_.output_bytes_pause) ||
           (options_.urgent && !client.closing && client.input.unseen());
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
  const bool was_ready = client.Ready(options_.output_bytes_pause);
  if (last && client.open > 0) --client.open;
  client.active = ++active_;
  if (client.closing || (!last && client.waiting() > options_.progress_bytes_max)) return true;
  client.output.append(line).push_back('\n');
  if (!Settle(id, &client)) {
    Drop(id);
    return false;
  }
  if (!was_ready && client.Ready(options_.output_bytes_pause)) Remind();
  return true;
}

LineServer::LineServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LineServer::LineServer(LineServer&&) noexcept = default;
LineServer& LineServer::operator=(LineServer&&) noexcept = default;
LineServer::~LineServer() = default;

Result<LineServer> LineServer::Create(const std::string& path, const Options& options) {
  FOCALFLEET_TRY_ASSIGN(ListeningSocket listener, ListeningSocket::Create(path, options.file_mode));
  auto impl = std::make_unique<Impl>(std::move(listener), options);
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
