// A small HTTP server for pages that the daemon makes itself. The server has threads of its own and
// takes no lock of the core. Each connection carries one request, and is bounded in bytes, in time,
// and in how many there may be, so that no client can hold up another for long. A request that the
// router admitted has wider bounds, and its body is read only then.
//
// Requests are answered only under the server's own names (host_header.h), and no answer permits
// pages of other sites to read it. Pages without a router are for GET and for everybody. An address
// in use is reported and tried again.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "daemon/http/http_message.h"
#include "daemon/http/router.h"
#include "daemon/http/tls.h"

namespace focalfleet {

/// Limits that a server sets to its clients.
struct HttpLimits {
  /// A request line with its headers. Prometheus sends some 300 bytes, a browser up to 2 kB.
  std::size_t request_bytes = 16'384;
  /// Connections that are served at once, and those that may wait for one of them. Above both, a
  /// connection is answered 503 at once.
  std::size_t served = 16;
  std::size_t waiting = 48;
  /// The first byte of a request must come within `first_byte`. The whole connection ends within
  /// `connection`. Prometheus gives up after 10 s: with all places taken by silent clients, a
  /// request waits (16 + 48) / 16 times `first_byte`.
  std::chrono::milliseconds first_byte{1000};
  std::chrono::milliseconds connection{5000};
  /// The same for an admitted request: a targets file comes over a slow network, and an answer of
  /// the core may wait for a plan.
  std::size_t body_bytes = std::size_t{16} << 20;
  std::chrono::milliseconds admitted{60'000};
  /// Answers that go on (HttpAnswer::stream) have places of their own, and each of their pieces is
  /// taken by the client within `stall`. Whether the request is still admitted is asked each
  /// `recheck`.
  std::size_t streams = 0;
  std::chrono::milliseconds stall{5000};
  std::chrono::milliseconds recheck{1000};
};

class HttpServer {
 public:
  struct Options {
    std::string address;             // numeric, IPv4 or IPv6
    std::uint16_t port = 0;          // 0: any that is free
    std::vector<std::string> names;  // under which it may be asked, beside the loopback names
    /// Pages by their path. A page is made on a thread of the server, by several at once.
    std::map<std::string, std::function<HttpAnswer()>> pages;
    /// Takes the place of `pages` where there is one.
    std::shared_ptr<const HttpRouter> router = nullptr;
    std::shared_ptr<TlsContext> tls = nullptr;  // none: plain HTTP
    /// Receives each new reason why it does not listen, and an empty text when it listens again.
    std::function<void(const std::string& trouble)> tell = [](const std::string&) {};
    HttpLimits limits;
    std::chrono::milliseconds retry_period{5000};
  };

  /// The server listens, or tries to.
  explicit HttpServer(Options options);
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;
  /// All connections are closed. Waits for pages that are being made.
  ~HttpServer();

  /// The port on which it listens; 0: it does not.
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  class Listener;
  void Run(const std::stop_token& stop);

  Options options_;
  std::atomic<std::uint16_t> port_{0};
  std::unique_ptr<Listener> listener_;
  std::jthread thread_;
};

}  // namespace focalfleet
