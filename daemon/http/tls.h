// TLS for a server: certificate and key, and one connection's bytes. The versions are TLS 1.2 and
// 1.3. The files are read anew when they change, so that a renewed certificate needs no restart.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <string>

#include "protocol/base/result.h"

struct ssl_st;
struct ssl_ctx_st;

namespace focalfleet {

struct TlsFiles {
  std::string certificate;  // PEM, with the chain behind it
  std::string key;          // PEM
};

/// The bytes of one connection, plain or by TLS, on a socket that does not block.
class ByteStream {
 public:
  /// Outcomes of a step that moved no bytes.
  enum class Wants : std::uint8_t { kRead, kWrite, kClosed };
  struct Moved {
    std::size_t bytes = 0;  // 0: see `wants`
    Wants wants = Wants::kClosed;
  };

  explicit ByteStream(int socket) : socket_(socket) {}  // plain
  ByteStream(int socket, ssl_ctx_st* context);          // TLS
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;
  ~ByteStream();

  Moved Receive(char* out, std::size_t size);
  Moved Send(const char* data, std::size_t size);
  /// The client learns that nothing more comes.
  void EndOutput();

 private:
  [[nodiscard]] Moved OfTls(int done) const;
  int socket_;
  ssl_st* tls_ = nullptr;
};

class TlsContext {
 public:
  /// Errors: kInvalid names the file that is no certificate, or no key of it; kUnavailable.
  static Result<std::unique_ptr<TlsContext>> Open(const TlsFiles& files);
  ~TlsContext();
  TlsContext(const TlsContext&) = delete;
  TlsContext& operator=(const TlsContext&) = delete;

  /// A stream on the socket, by the newest files that are good.
  std::unique_ptr<ByteStream> Accept(int socket);

 private:
  explicit TlsContext(TlsFiles files) : files_(std::move(files)) {}
  Status Read();

  TlsFiles files_;
  std::mutex mutex_;
  ssl_ctx_st* context_ = nullptr;
  std::int64_t changed_ns_ = 0;  // of the files
};

}  // namespace focalfleet
