#include "daemon/http/http_server.h"

#include <httplib.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <utility>

#include "daemon/http/host_header.h"
#include "daemon/http/tls.h"

namespace focalfleet {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t kReadBytes = 4096;
/// The time for a refusal, also where that of the connection is over.
constexpr milliseconds kRefuseWithin{100};
/// The rest of a refused request is read, so that the client gets to see the refusal instead of a
/// reset. Four times what a server's socket usually holds by then, and no client may send for long.
constexpr std::size_t kDiscardBytes = 262'144;
constexpr milliseconds kDiscardWithin{500};
/// The system's buffer of an answer that goes on. A snapshot of 5000 units has room; a larger
/// buffer would hold old states for a client that reads slowly.
constexpr int kStreamBufferBytes = 131'072;
/// The end of the server is seen within such a time.
constexpr milliseconds kStreamPatience{100};

std::string PlainResponse(const char* status) {
  const std::string body = std::string(status) + "\n";
  return "HTTP/1.1 " + std::string(status) +
         "\r\nConnection: close\r\nContent-Type: text/plain\r\nContent-Length: " +
         std::to_string(body.size()) + "\r\n\r\n" + body;
}

/// The bytes of one connection, within its limits. A request that exceeds them gets no answer of
/// the library: Finish gives the answer then.
class Connection final : public httplib::Stream {
 public:
  Connection(int socket, std::unique_ptr<ByteStream> bytes, const HttpLimits& limits,
             const std::atomic<bool>& ending)
      : socket_(socket),
        bytes_(std::move(bytes)),
        limits_(limits),
        ending_(ending),
        request_bytes_(limits.request_bytes),
        first_byte_by_(Clock::now() + limits.first_byte),
        ends_by_(Clock::now() + limits.connection) {}
  ~Connection() override {
    bytes_.reset();
    ::shutdown(socket_, SHUT_RDWR);
    ::close(socket_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  ssize_t read(char* out, std::size_t size) override {
    if (taken_ == held_ && !Refill()) return failure_ == Failure::kClosed ? 0 : -1;
    const std::size_t count = std::min(size, held_ - taken_);
    std::memcpy(out, buffer_.data() + taken_, count);
    taken_ += count;
    return static_cast<ssize_t>(count);
  }

  ssize_t write(const char* data, std::size_t size) override {
    const bool discards = failure_ == Failure::kTooLong || failure_ == Failure::kTooSlow;
    return discards || Send(data, size, ends_by_) ? static_cast<ssize_t>(size) : -1;
  }

  /// The request was admitted: its body, and its answer, may be longer and take longer.
  void Admit() {
    request_bytes_ = limits_.request_bytes + limits_.body_bytes;
    ends_by_ = Clock::now() + limits_.admitted;
  }
  /// The answer goes on: its next piece has so much time.
  void BeginStream() const {
    ::setsockopt(socket_, SOL_SOCKET, SO_SNDBUF, &kStreamBufferBytes, sizeof kStreamBufferBytes);
  }
  void AllowPiece() { ends_by_ = Clock::now() + limits_.stall; }
  [[nodiscard]] bool ending() const { return ending_; }
  /// The request that is being answered.
  HttpRouter::Admission admission;

  /// The client has its answer, also where the library had none for it.
  void Finish() {
    if (failure_ == Failure::kTooLong) Say("431 Request Header Fields Too Large");
    if (failure_ == Failure::kTooSlow && received_ > 0) Say("408 Request Timeout");
    if (received_ == 0) return;
    bytes_->EndOutput();
    const auto until = Clock::now() + kDiscardWithin;
    for (std::size_t discarded = 0; discarded < kDiscardBytes;) {
      if (!Await(POLLIN, until)) return;
      const ssize_t got = ::recv(socket_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
      if (got <= 0) return;
      discarded += static_cast<std::size_t>(got);
    }
  }
  void Say(const char* status) {
    const std::string text = PlainResponse(status);
    Send(text.data(), text.size(), Clock::now() + kRefuseWithin);
  }

  [[nodiscard]] bool is_readable() const override { return true; }
  [[nodiscard]] bool is_writable() const override { return true; }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    sockaddr_storage peer{};
    socklen_t length = sizeof peer;
    std::array<char, NI_MAXHOST> name{};
    port = 0;
    auto* const address = reinterpret_cast<sockaddr*>(&peer);
    if (::getpeername(socket_, address, &length) == 0 &&
        ::getnameinfo(address, length, name.data(), name.size(), nullptr, 0, NI_NUMERICHOST) == 0)
      ip = name.data();
  }
  void get_local_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  [[nodiscard]] socket_t socket() const override { return socket_; }

 private:
  enum class Failure : std::uint8_t { kNone, kClosed, kTooLong, kTooSlow };

  /// The socket is ready for `events`. False: it was not by then, or the server ends.
  [[nodiscard]] bool Await(short events, Clock::time_point until) const {
    while (!ending_) {
      // An end of the server is seen within such a slice.
      constexpr milliseconds kSlice{50};
      const auto left = std::chrono::ceil<milliseconds>(until - Clock::now());
      if (left.count() <= 0) return false;
      pollfd watched{.fd = socket_, .events = events, .revents = 0};
      const int ready = ::poll(&watched, 1, static_cast<int>(std::min(left, kSlice).count()));
      if (ready > 0) return true;
      if (ready < 0 && errno != EINTR) return false;
    }
    return false;
  }

  /// Bytes are moved by `step`, as soon as the socket is ready. 0: closed, or not by then.
  template <class Step>
  std::size_t Move(Clock::time_point until, Step step) {
    for (;;) {
      const ByteStream::Moved moved = step();
      if (moved.bytes > 0) return moved.bytes;
      if (moved.wants == ByteStream::Wants::kClosed) {
        failure_ = Failure::kClosed;
        return 0;
      }
      const bool reads = moved.wants == ByteStream::Wants::kRead;
      if (!Await(reads ? POLLIN : POLLOUT, until)) return 0;
    }
  }

  bool Refill() {
    if (failure_ != Failure::kNone) return false;
    taken_ = held_ = 0;
    const auto until = received_ == 0 ? std::min(first_byte_by_, ends_by_) : ends_by_;
    held_ = Move(until, [&] { return bytes_->Receive(buffer_.data(), buffer_.size()); });
    if (held_ == 0) {
      if (failure_ == Failure::kNone) failure_ = Failure::kTooSlow;
      return false;
    }
    received_ += held_;
    if (received_ > request_bytes_) failure_ = Failure::kTooLong;
    return failure_ == Failure::kNone;
  }

  bool Send(const char* data, std::size_t size, Clock::time_point until) {
    for (std::size_t sent = 0; sent < size;) {
      const std::size_t count = Move(until, [&] { return bytes_->Send(data + sent, size - sent); });
      if (count == 0) return false;
      sent += count;
    }
    return true;
  }

  int socket_;
  std::unique_ptr<ByteStream> bytes_;
  const HttpLimits& limits_;
  const std::atomic<bool>& ending_;
  std::size_t request_bytes_;
  Clock::time_point first_byte_by_;
  Clock::time_point ends_by_;
  Failure failure_ = Failure::kNone;
  std::array<char, kReadBytes> buffer_{};
  std::size_t taken_ = 0;
  std::size_t held_ = 0;
  std::size_t received_ = 0;
};

/// The connection that this thread serves. The library hands a request to handlers without it.
thread_local Connection* served_connection = nullptr;

/// A pool of threads that does at once, on the thread that accepts, what exceeds its places.
class BoundedPool final : public httplib::TaskQueue {
 public:
  explicit BoundedPool(const HttpLimits& limits)
      : pool_(limits.served + limits.streams),
        places_(limits.served + limits.streams + limits.waiting) {}

  void enqueue(std::function<void()> task) override {
    if (open_ >= places_) return task();
    ++open_;
    pool_.enqueue([this, task = std::move(task)] {
      task();
      --open_;
    });
  }
  void shutdown() override { pool_.shutdown(); }

 private:
  httplib::ThreadPool pool_;
  std::size_t places_;
  std::atomic<std::size_t> open_{0};
};

void Fill(const HttpAnswer& answer, httplib::Response* response) {
  response->status = answer.status;
  for (const auto& [name, value] : answer.headers) response->set_header(name, value);
  response->set_content(answer.body, answer.content_type);
}

void Refuse(int status, const char* why, httplib::Response* response) {
  Fill({.status = status, .body = std::string(why) + "\n"}, response);
}

/// Headers of every answer: nothing of it is kept, guessed at, framed, or read by other sites, and
/// a page runs nothing but what comes from this server.
void Harden(bool tls, httplib::Response* response) {
  response->set_header("Cache-Control", "no-store");
  response->set_header("X-Content-Type-Options", "nosniff");
  response->set_header("X-Frame-Options", "DENY");
  response->set_header("Referrer-Policy", "no-referrer");
  response->set_header("Cross-Origin-Opener-Policy", "same-origin");
  response->set_header("Cross-Origin-Resource-Policy", "same-origin");
  response->set_header("Content-Security-Policy",
                       "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' "
                       "data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
                       "frame-ancestors 'none'");
  if (tls) response->set_header("Strict-Transport-Security", "max-age=31536000");
}

HttpRequest RequestOf(const httplib::Request& from) {
  HttpRequest request{.method = from.method, .path = from.path};
  for (const auto& [name, value] : from.params) request.query.emplace(name, value);
  request.host = from.get_header_value("Host");
  request.origin = from.get_header_value("Origin");
  request.fetch_site = from.get_header_value("Sec-Fetch-Site");
  request.authorization = from.get_header_value("Authorization");
  request.content_type = from.get_header_value("Content-Type");
  request.content_encoding = from.get_header_value("Content-Encoding");
  request.address = from.remote_addr;
  request.forwarded = from.has_header("Forwarded") || from.has_header("X-Forwarded-For") ||
                      from.has_header("X-Real-IP") || from.has_header("Via");
  request.body = from.body;
  return request;
}

}  // namespace

class HttpServer::Listener final : public httplib::Server {
 public:
  explicit Listener(const HttpServer::Options& options) : options_(options) {
    new_task_queue = [this] { return new BoundedPool(options_.limits); };
    // The library's default is SO_REUSEPORT: a second daemon on the same port would not be noticed,
    // and would get every other request.
    set_socket_options([](socket_t socket) {
      const int yes = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      return Decide(request, &response);
    });
    // The path was compared with those of the routes before.
    Post(".*", [this](const httplib::Request& request, httplib::Response& response) {
      const Connection& connection = *served_connection;
      Answer(connection.admission, RequestOf(request), &response);
    });
    set_payload_max_length(options_.limits.body_bytes);
  }

  /// The port on which it will accept connections; 0 and errno: it cannot.
  std::uint16_t Bind() {
    errno = 0;
    const int port = options_.port == 0
                         ? bind_to_any_port(options_.address)
                         : (bind_to_port(options_.address, options_.port) ? options_.port : 0);
    if (port <= 0) return 0;
    // The library lets five connections wait for accept(): a sixth would be tried again after 1 s.
    ::listen(svr_sock_, static_cast<int>(options_.limits.served + options_.limits.waiting));
    const std::lock_guard lock(mutex_);
    bound_ = true;
    return static_cast<std::uint16_t>(port);
  }
  /// Accepts connections until End, or until the system refuses to. Pre: bound.
  void Accept() {
    accepting_ = std::this_thread::get_id();
    listen_after_bind();
    const std::lock_guard lock(mutex_);
    bound_ = false;
  }
  void End() {
    ending_ = true;
    // The library closes the socket when accept() fails. A close from here could hit a descriptor
    // that another thread has opened meanwhile.
    const std::lock_guard lock(mutex_);
    if (bound_) ::shutdown(svr_sock_, SHUT_RDWR);
  }

 private:
  bool process_and_close_socket(socket_t socket) override {
    auto bytes = options_.tls == nullptr ? std::make_unique<ByteStream>(socket)
                                         : options_.tls->Accept(socket);
    Connection connection(socket, std::move(bytes), options_.limits, ending_);
    if (std::this_thread::get_id() == accepting_) {
      if (options_.tls == nullptr) connection.Say("503 Service Unavailable");
      return false;
    }
    served_connection = &connection;
    bool closed = false;
    process_request(connection, /*close_connection=*/true, closed, nullptr);
    served_connection = nullptr;
    connection.Finish();
    return true;
  }

  HandlerResponse Decide(const httplib::Request& request, httplib::Response* response) const {
    Harden(options_.tls != nullptr, response);
    if (request.get_header_value_count("Host") != 1 ||
        !IsAllowedHost(request.get_header_value("Host"), options_.names)) {
      Refuse(403, "this server is not asked under that name", response);
    } else if (request.has_header("Range")) {
      // The library would copy a page once for each of any number of ranges.
      Refuse(400, "pages come whole", response);
    } else if (options_.router != nullptr) {
      return Route(request, response);
    } else {
      ShowPage(request, response);
    }
    return HandlerResponse::Handled;
  }

  HandlerResponse Route(const httplib::Request& request, httplib::Response* response) const {
    const HttpRequest asked = RequestOf(request);
    Connection& connection = *served_connection;
    connection.admission = options_.router->Admit(asked);
    if (connection.admission.refused) {
      Fill(*connection.admission.refused, response);
      return HandlerResponse::Handled;
    }
    if (!connection.admission.route->verb.empty()) connection.Admit();
    if (request.method == "POST") return HandlerResponse::Unhandled;  // its body comes first
    Answer(connection.admission, asked, response);
    return HandlerResponse::Handled;
  }

  void Answer(const HttpRouter::Admission& admission, const HttpRequest& asked,
              httplib::Response* response) const {
    const HttpAnswer answer = options_.router->Answer(admission, asked);
    if (!answer.stream) return Fill(answer, response);
    served_connection->BeginStream();
    response->set_chunked_content_provider(
        answer.content_type, [this, asked, stream = answer.stream, checked = Clock::now()](
                                 std::size_t, httplib::DataSink& out) mutable {
          return GoOn(asked, stream, &checked, &out);
        });
  }

  /// The next piece of an answer is sent. False: the connection ends.
  bool GoOn(const HttpRequest& asked, const HttpStream& stream, Clock::time_point* checked,
            httplib::DataSink* out) const {
    Connection& connection = *served_connection;
    if (connection.ending()) return false;
    if (Clock::now() - *checked >= options_.limits.recheck) {
      *checked = Clock::now();
      if (!options_.router->StillAdmits(connection.admission, asked)) return false;
    }
    const auto piece = stream(kStreamPatience);
    if (!piece) {
      out->done();
      return true;
    }
    if (*piece == nullptr) return true;
    connection.AllowPiece();
    return out->write((*piece)->data(), (*piece)->size());
  }

  void ShowPage(const httplib::Request& request, httplib::Response* response) const {
    if (request.method != "GET") {
      response->set_header("Allow", "GET");
      return Refuse(405, "only GET is answered", response);
    }
    const auto page = options_.pages.find(request.path);
    if (page == options_.pages.end()) return Refuse(404, "there is no such page", response);
    Fill(page->second(), response);
  }

  const HttpServer::Options& options_;
  std::atomic<bool> ending_{false};
  std::thread::id accepting_;
  std::mutex mutex_;
  bool bound_ = false;  // under the mutex
};

HttpServer::HttpServer(Options options)
    : options_(std::move(options)),
      listener_(std::make_unique<Listener>(options_)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

HttpServer::~HttpServer() {
  thread_.request_stop();
  listener_->End();
  thread_.join();
}

void HttpServer::Run(const std::stop_token& stop) {
  std::string trouble;
  std::mutex mutex;
  std::condition_variable_any ended;
  while (!stop.stop_requested()) {
    port_ = listener_->Bind();
    const std::string now = port_ != 0
                                ? ""
                                : "cannot listen on " + options_.address + " port " +
                                      std::to_string(options_.port) + ": " + std::strerror(errno);
    if (now != trouble) options_.tell(now);
    trouble = now;
    // An end that came before Bind() has not closed what Bind() opened.
    if (stop.stop_requested()) listener_->End();
    if (port_ != 0) listener_->Accept();
    port_ = 0;
    std::unique_lock lock(mutex);
    ended.wait_for(lock, stop, options_.retry_period, [] { return false; });
  }
}

}  // namespace focalfleet
