// The HTTP door from outside: requests as bytes on a socket, plain and by TLS, with a control
// socket behind it that repeats what it is asked.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/access/token.h"
#include "daemon/control/line_server.h"
#include "daemon/http/api_routes.h"
#include "daemon/http/http_server.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::WaitUntil;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr int kPatienceMs = 30'000;  // limit for a hang; nothing is timed

/// A control socket that answers each request with what it was.
class EchoDaemon {
 public:
  explicit EchoDaemon(const std::string& path)
      : server_(LineServer::Create(path).value()), thread_([this] { Run(); }) {}
  ~EchoDaemon() {
    ending_ = true;
    thread_.join();
  }
  [[nodiscard]] int asked() const { return asked_; }

 private:
  void Run() {
    while (!ending_) {
      pollfd watched{.fd = server_.fd(), .events = POLLIN, .revents = 0};
      ::poll(&watched, 1, 20);
      std::vector<IncomingLine> urgent;
      server_.Service(&urgent);
      while (const auto line = server_.Next()) {
        const auto request = DecodeRequest(line->text);
        ++asked_;
        if (!request || !request->caller) continue;
        const std::string answer =
            request->verb == "measure"
                ? EncodeError(request->id, {ErrorCode::kRefused, "busy"})
                : EncodeResult(request->id, {{"verb", request->verb},
                                             {"args", request->args},
                                             {"token", request->caller->token},
                                             {"role", Name(request->caller->role)}});
        server_.Answer(line->client, answer);
      }
    }
  }
  LineServer server_;
  std::atomic<bool> ending_{false};
  std::atomic<int> asked_{0};
  std::thread thread_;
};

class HttpApiTest : public ::testing::Test {
 protected:
  HttpApiTest() : daemon_(folder_ / "s") {
    const std::int64_t now_s = WallTime::Now().ns / 1'000'000'000;
    std::vector<Token> tokens;
    viewer_ = *AddToken("look", Role::kViewer, now_s, now_s + 3600, &tokens);
    operator_ = *AddToken("move", Role::kOperator, now_s, now_s + 3600, &tokens);
    std::ofstream(folder_ / "tokens.csv") << FormatTokens(tokens);
    ::chmod((folder_ / "tokens.csv").c_str(), 0640);
  }

  std::unique_ptr<HttpServer> Serve(std::shared_ptr<TlsContext> tls = nullptr,
                                    HttpLimits limits = {}) {
    auto router = std::make_shared<HttpRouter>(HttpRouter::Options{
        .tokens =
            std::make_shared<TokenRegister>(TokenRegister::Options{.path = folder_ / "tokens.csv"}),
        .tls = tls != nullptr});
    AddApiRoutes(folder_ / "s", router.get());
    router->Add({.path = "/", .verb = "", .answer = [](const HttpRequest&, const Caller&) {
                   return HttpAnswer{.body = "page"};
                 }});
    auto server = std::make_unique<HttpServer>(HttpServer::Options{.address = "127.0.0.1",
                                                                   .router = std::move(router),
                                                                   .tls = std::move(tls),
                                                                   .limits = limits});
    EXPECT_TRUE(WaitUntil([&] { return server->port() != 0; }, kPatienceMs));
    return server;
  }
  static int ConnectTo(const HttpServer& server) {
    const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(server.port());
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    return fd;
  }
  static std::string Ask(const HttpServer& server, const std::string& request) {
    const int fd = ConnectTo(server);
    EXPECT_GE(::send(fd, request.data(), request.size(), MSG_NOSIGNAL), 0);
    std::string answer;
    std::array<char, 4096> chunk{};
    pollfd watched{.fd = fd, .events = POLLIN, .revents = 0};
    while (::poll(&watched, 1, kPatienceMs) > 0) {
      const ssize_t got = ::recv(fd, chunk.data(), chunk.size(), 0);
      if (got <= 0) break;
      answer.append(chunk.data(), static_cast<std::size_t>(got));
    }
    ::close(fd);
    return answer;
  }
  static std::string Post(const std::string& verb, const std::string& token,
                          const std::string& body, const std::string& more = "") {
    return "POST /api/" + verb + " HTTP/1.1\r\nHost: localhost\r\n" +
           (token.empty() ? "" : "Authorization: Bearer " + token + "\r\n") +
           "Content-Type: application/json\r\n" + more +
           "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
  }

  test::ScratchFolder folder_;
  EchoDaemon daemon_;
  std::string viewer_;
  std::string operator_;
};

TEST_F(HttpApiTest, ARequestReachesTheDaemonOnBehalfOfItsToken) {
  const auto server = Serve();
  EXPECT_THAT(Ask(*server, Post("retarget", operator_, R"({"unit_id":7})")),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr(R"("verb":"retarget")"),
                    HasSubstr(R"({"unit_id":7})"), HasSubstr(R"("token":"move")"),
                    HasSubstr(R"("role":"operator")")));
  EXPECT_THAT(Ask(*server, Post("status", viewer_, "")), StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpApiTest, TheDaemonsRefusalIsAnAnswer) {
  const auto server = Serve();
  EXPECT_THAT(Ask(*server, Post("measure", operator_, "{}")),
              AllOf(StartsWith("HTTP/1.1 409"), HasSubstr("busy")));
}

TEST_F(HttpApiTest, NothingReachesTheDaemonWithoutTheRight) {
  const auto server = Serve();
  EXPECT_THAT(Ask(*server, Post("retarget", viewer_, "{}")), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Ask(*server, Post("stop", "", "{}")), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Ask(*server, Post("home", operator_, R"({"unproven":true})")),
              StartsWith("HTTP/1.1 403"));
  for (const char* body : {"[", "[]", "7", "{\"wait\":true}", "{}{}", "{},\"verb\":\"stop\""})
    EXPECT_THAT(Ask(*server, Post("home", operator_, body)), StartsWith("HTTP/1.1 400")) << body;
  EXPECT_THAT(Ask(*server, Post("stop", operator_, "{}", "Origin: http://evil.example\r\n")),
              StartsWith("HTTP/1.1 403"));
  std::string rebound = Post("stop", operator_, "{}");
  rebound.replace(rebound.find("localhost"), 9, "evil.example");
  EXPECT_THAT(Ask(*server, rebound), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Ask(*server, Post("stop", operator_, "{}", "Content-Encoding: gzip\r\n")),
              StartsWith("HTTP/1.1 415"));
  EXPECT_EQ(daemon_.asked(), 0);
}

TEST_F(HttpApiTest, ABodyIsReadOnlyWhereItsRequestWasAdmitted) {
  const auto server = Serve();
  const std::string large = "{\"targets_csv\":\"" + std::string(1'000'000, 'x') + "\"}";
  EXPECT_THAT(Ask(*server, Post("apply", operator_, large)), StartsWith("HTTP/1.1 200"));
  // The refusal comes before its body has come; the rest is thrown away.
  EXPECT_THAT(Ask(*server, Post("apply", viewer_, large)), AnyOf(StartsWith("HTTP/1.1 403"), ""));
  HttpLimits limits;
  limits.body_bytes = 1000;
  const auto small = Serve(nullptr, limits);
  EXPECT_THAT(Ask(*small, Post("apply", operator_, large)),
              AnyOf(StartsWith("HTTP/1.1 413"), StartsWith("HTTP/1.1 431"), ""));
  EXPECT_EQ(daemon_.asked(), 1);
}

TEST_F(HttpApiTest, EveryAnswerForbidsWhatItDoesNotNeed) {
  const auto server = Serve();
  for (const std::string& request :
       {std::string("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"), Post("status", viewer_, "{}"),
        Post("status", "", "{}"), std::string("GET /x HTTP/1.1\r\nHost: localhost\r\n\r\n")}) {
    const std::string answer = Ask(*server, request);
    EXPECT_THAT(answer, HasSubstr("Content-Security-Policy: default-src 'none'")) << request;
    EXPECT_THAT(answer, HasSubstr("X-Frame-Options: DENY")) << request;
    EXPECT_THAT(answer, HasSubstr("Cache-Control: no-store")) << request;
    EXPECT_THAT(answer, Not(HasSubstr("Access-Control"))) << request;
  }
}

// ---- TLS

struct Free {
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  void operator()(SSL* tls) const { SSL_free(tls); }
};

/// A certificate for localhost and its key, in two files.
TlsFiles MakeCertificate(const test::ScratchFolder& folder, const std::string& name) {
  const std::unique_ptr<EVP_PKEY, Free> key(EVP_EC_gen("P-256"));
  const std::unique_ptr<X509, Free> certificate(X509_new());
  X509_set_version(certificate.get(), 2);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), 1);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), 0);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), 3600);
  X509_set_pubkey(certificate.get(), key.get());
  X509_NAME* const subject = X509_get_subject_name(certificate.get());
  X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
  X509_set_issuer_name(certificate.get(), subject);
  EXPECT_GT(X509_sign(certificate.get(), key.get(), EVP_sha256()), 0);
  const TlsFiles files{folder / (name + ".crt"), folder / (name + ".key")};
  FILE* file = std::fopen(files.certificate.c_str(), "w");
  PEM_write_X509(file, certificate.get());
  std::fclose(file);
  file = std::fopen(files.key.c_str(), "w");
  PEM_write_PrivateKey(file, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
  std::fclose(file);
  return files;
}

class HttpTlsTest : public HttpApiTest {
 protected:
  /// The answer by TLS, with the certificate's name before it.
  static std::string AskByTls(const HttpServer& server, const std::string& request,
                              int version_max = TLS1_3_VERSION) {
    return AskByTls(ConnectTo(server), request, version_max);
  }
  static std::string AskByTls(int fd, const std::string& request, int version_max) {
    const std::unique_ptr<SSL_CTX, Free> context(SSL_CTX_new(TLS_client_method()));
    SSL_CTX_set_min_proto_version(context.get(), TLS1_VERSION);
    SSL_CTX_set_max_proto_version(context.get(), version_max);
    SSL_CTX_set_cipher_list(context.get(), "ALL:@SECLEVEL=0");
    std::string answer;
    {
      const std::unique_ptr<SSL, Free> tls(SSL_new(context.get()));
      SSL_set_fd(tls.get(), fd);
      if (SSL_connect(tls.get()) == 1) {
        const std::unique_ptr<X509, Free> peer(SSL_get1_peer_certificate(tls.get()));
        std::array<char, 100> name{};
        X509_NAME_oneline(X509_get_subject_name(peer.get()), name.data(),
                          static_cast<int>(name.size()));
        answer = std::string(name.data()) + " ";
        SSL_write(tls.get(), request.data(), static_cast<int>(request.size()));
        std::array<char, 4096> chunk{};
        for (int got = 1; got > 0;) {
          got = SSL_read(tls.get(), chunk.data(), static_cast<int>(chunk.size()));
          if (got > 0) answer.append(chunk.data(), static_cast<std::size_t>(got));
        }
      }
    }
    ::close(fd);
    return answer;
  }
  /// Passes bytes on in both directions until one end closes, closes both, and returns what came
  /// from the client.
  static std::string Relay(int client, int server) {
    std::string heard;
    std::array<pollfd, 2> ends{{{.fd = client, .events = POLLIN, .revents = 0},
                                {.fd = server, .events = POLLIN, .revents = 0}}};
    std::array<char, 4096> chunk{};
    for (bool open = true; open && ::poll(ends.data(), ends.size(), kPatienceMs) > 0;)
      for (std::size_t from = 0; from < 2; ++from) {
        if (ends[from].revents == 0) continue;
        const ssize_t got = ::recv(ends[from].fd, chunk.data(), chunk.size(), 0);
        open = got > 0;
        if (!open) break;
        const auto bytes = static_cast<std::size_t>(got);
        if (from == 0) heard.append(chunk.data(), bytes);
        EXPECT_EQ(::send(ends[1 - from].fd, chunk.data(), bytes, MSG_NOSIGNAL), got);
      }
    ::close(client);
    ::close(server);
    return heard;
  }
  std::shared_ptr<TlsContext> Context(const TlsFiles& files) {
    auto context = TlsContext::Open(files);
    EXPECT_TRUE(context) << context.error().text;
    return context ? std::shared_ptr<TlsContext>(std::move(*context)) : nullptr;
  }
};

TEST_F(HttpTlsTest, TheSameDoorByTls) {
  const auto server = Serve(Context(MakeCertificate(folder_, "plate")));
  EXPECT_THAT(AskByTls(*server, Post("status", viewer_, "{}")),
              AllOf(StartsWith("/CN=plate HTTP/1.1 200"), HasSubstr(R"("token":"look")"),
                    HasSubstr("Strict-Transport-Security")));
  EXPECT_THAT(AskByTls(*server, Post("status", "", "{}")), HasSubstr("HTTP/1.1 401"));
  EXPECT_THAT(AskByTls(*server, Post("stop", operator_, "{}", "Origin: https://localhost\r\n")),
              HasSubstr("HTTP/1.1 200"));
  EXPECT_THAT(AskByTls(*server, Post("stop", operator_, "{}", "Origin: http://localhost\r\n")),
              HasSubstr("HTTP/1.1 403"))
      << "a page without TLS is another site";
}

TEST_F(HttpTlsTest, OldVersionsAndPlainTextGetNothing) {
  const auto server = Serve(Context(MakeCertificate(folder_, "plate")));
  EXPECT_EQ(AskByTls(*server, Post("status", viewer_, "{}"), TLS1_1_VERSION), "");
  EXPECT_THAT(AskByTls(*server, Post("status", viewer_, "{}"), TLS1_2_VERSION), Not(""));
  EXPECT_THAT(Ask(*server, Post("status", viewer_, "{}")), Not(HasSubstr("HTTP/1.1 200")));
}

TEST_F(HttpTlsTest, ARecordedRequestSentAgainReachesNobody) {
  const auto server = Serve(Context(MakeCertificate(folder_, "plate")));
  const std::string request = Post("disable", operator_, R"({"unit_ids":[1]})");
  for (const int version : {TLS1_2_VERSION, TLS1_3_VERSION}) {
    int ends[2];
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
    std::string recorded;
    std::thread listener([&, end = ends[1]] { recorded = Relay(end, ConnectTo(*server)); });
    EXPECT_THAT(AskByTls(ends[0], request, version), HasSubstr("HTTP/1.1 200"));
    listener.join();
    EXPECT_GT(recorded.size(), request.size());
    const int asked = daemon_.asked();
    EXPECT_THAT(Ask(*server, recorded), Not(HasSubstr("HTTP/1.1")));
    EXPECT_EQ(daemon_.asked(), asked) << "TLS version " << version;
  }
}

TEST_F(HttpTlsTest, AHandshakeThatGoesNowhereEnds) {
  HttpLimits limits;
  limits.served = 1;
  limits.waiting = 1;
  limits.first_byte = std::chrono::milliseconds(100);
  limits.connection = std::chrono::milliseconds(200);
  const auto server = Serve(Context(MakeCertificate(folder_, "plate")), limits);
  const int silent = ConnectTo(*server);
  EXPECT_TRUE(WaitUntil(
      [&] {
        return AskByTls(*server, Post("status", viewer_, "{}")).find(" 200") != std::string::npos;
      },
      kPatienceMs));
  ::close(silent);
}

TEST_F(HttpTlsTest, ARenewedCertificateIsTaken) {
  const TlsFiles files = MakeCertificate(folder_, "plate");
  const auto server = Serve(Context(files));
  EXPECT_THAT(AskByTls(*server, Post("status", viewer_, "")), StartsWith("/CN=plate "));
  const TlsFiles renewed = MakeCertificate(folder_, "renewed");
  ASSERT_EQ(::rename(renewed.certificate.c_str(), files.certificate.c_str()), 0);
  EXPECT_THAT(AskByTls(*server, Post("status", viewer_, "")), StartsWith("/CN=plate "))
      << "its key is not there yet";
  ASSERT_EQ(::rename(renewed.key.c_str(), files.key.c_str()), 0);
  EXPECT_THAT(AskByTls(*server, Post("status", viewer_, "")), StartsWith("/CN=renewed "));
}

TEST_F(HttpTlsTest, FilesThatAreNoneAreNamed) {
  const TlsFiles good = MakeCertificate(folder_, "plate");
  const TlsFiles other = MakeCertificate(folder_, "other");
  EXPECT_THAT(TlsContext::Open({folder_ / "none", good.key}).error().text, HasSubstr("none"));
  EXPECT_THAT(TlsContext::Open({good.key, good.key}).error().text, HasSubstr("plate.key"));
  EXPECT_THAT(TlsContext::Open({good.certificate, other.key}).error().text, HasSubstr("other.key"));
}

}  // namespace
}  // namespace focalfleet
