#include "daemon/http/tls.h"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>

namespace focalfleet {
namespace {

std::int64_t ChangedNs(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return 0;
  return std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec;
}

std::string Reason() {
  const unsigned long code = ERR_get_error();
  ERR_clear_error();
  const char* const text = code == 0 ? nullptr : ERR_reason_error_string(code);
  return text == nullptr ? "no reason given" : text;
}

}  // namespace

ByteStream::ByteStream(int socket, ssl_ctx_st* context) : socket_(socket), tls_(SSL_new(context)) {
  if (tls_ == nullptr) return;
  SSL_set_fd(tls_, socket);
  SSL_set_accept_state(tls_);  // the first read shakes hands
}

ByteStream::~ByteStream() { SSL_free(tls_); }

ByteStream::Moved ByteStream::OfTls(int done) const {
  switch (SSL_get_error(tls_, done)) {
    case SSL_ERROR_WANT_READ:
      return {.wants = Wants::kRead};
    case SSL_ERROR_WANT_WRITE:
      return {.wants = Wants::kWrite};
    default:
      ERR_clear_error();
      return {.wants = Wants::kClosed};
  }
}

ByteStream::Moved ByteStream::Receive(char* out, std::size_t size) {
  if (tls_ != nullptr) {
    std::size_t got = 0;
    const int done = SSL_read_ex(tls_, out, size, &got);
    return done == 1 ? Moved{.bytes = got} : OfTls(done);
  }
  const ssize_t got = ::recv(socket_, out, size, MSG_DONTWAIT);
  if (got > 0) return {.bytes = static_cast<std::size_t>(got)};
  const bool later = got < 0 && (errno == EAGAIN || errno == EINTR);
  return {.wants = later ? Wants::kRead : Wants::kClosed};
}

ByteStream::Moved ByteStream::Send(const char* data, std::size_t size) {
  if (tls_ != nullptr) {
    std::size_t sent = 0;
    const int done = SSL_write_ex(tls_, data, size, &sent);
    return done == 1 ? Moved{.bytes = sent} : OfTls(done);
  }
  const ssize_t sent = ::send(socket_, data, size, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent > 0) return {.bytes = static_cast<std::size_t>(sent)};
  const bool later = sent < 0 && (errno == EAGAIN || errno == EINTR);
  return {.wants = later ? Wants::kWrite : Wants::kClosed};
}

void ByteStream::EndOutput() {
  if (tls_ != nullptr && SSL_is_init_finished(tls_) == 1) SSL_shutdown(tls_);
  ERR_clear_error();
  ::shutdown(socket_, SHUT_WR);
}

Result<std::unique_ptr<TlsContext>> TlsContext::Open(const TlsFiles& files) {
  std::unique_ptr<TlsContext> context(new TlsContext(files));
  FOCALFLEET_TRY(context->Read());
  return context;
}

TlsContext::~TlsContext() { SSL_CTX_free(context_); }

Status TlsContext::Read() {
  SSL_CTX* const context = SSL_CTX_new(TLS_server_method());
  if (context == nullptr) return Fail(ErrorCode::kUnavailable, "TLS: " + Reason());
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  SSL_CTX_set_options(context, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION |
                                   SSL_OP_CIPHER_SERVER_PREFERENCE | SSL_OP_NO_TICKET);
  SSL_CTX_set_mode(context, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF);
  const auto fail = [&](const std::string& file, const char* what) {
    auto error = Fail(ErrorCode::kInvalid, file + ": " + what + ": " + Reason());
    SSL_CTX_free(context);
    return error;
  };
  if (SSL_CTX_use_certificate_chain_file(context, files_.certificate.c_str()) != 1)
    return fail(files_.certificate, "no certificate in PEM");
  if (SSL_CTX_use_PrivateKey_file(context, files_.key.c_str(), SSL_FILETYPE_PEM) != 1)
    return fail(files_.key, "no key in PEM, or not the certificate's");
  if (SSL_CTX_check_private_key(context) != 1)
    return fail(files_.key, "not the key of the certificate");
  changed_ns_ = std::max(ChangedNs(files_.certificate), ChangedNs(files_.key));
  SSL_CTX_free(context_);
  context_ = context;
  return {};
}

std::unique_ptr<ByteStream> TlsContext::Accept(int socket) {
  const std::lock_guard lock(mutex_);
  // Files in the middle of a change may not fit each other: the old ones then hold.
  if (std::max(ChangedNs(files_.certificate), ChangedNs(files_.key)) != changed_ns_)
    static_cast<void>(Read());
  return std::make_unique<ByteStream>(socket, context_);
}

}  // namespace focalfleet
