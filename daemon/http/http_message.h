// A request over HTTP and its answer, without anything of the library that reads them.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace focalfleet {

struct HttpRequest {
  std::string method;
  std::string path;                          // decoded, without query
  std::map<std::string, std::string> query;  // decoded; of equal names the first
  std::string host;                          // header Host, which names this server
  std::string origin;                        // header Origin; empty: none
  std::string fetch_site;                    // header Sec-Fetch-Site; empty: none
  std::string authorization;
  std::string content_type;
  std::string content_encoding;
  std::string address;     // of the peer
  bool forwarded = false;  // a proxy names somebody else as the sender
  std::string body;        // empty until the request was admitted
};

/// The next bytes of an answer that goes on while its client reads. Null: nothing came within
/// `patience`. None: the answer is over. Called by one thread at a time.
using HttpStream = std::function<std::optional<std::shared_ptr<const std::string>>(
    std::chrono::milliseconds patience)>;

struct HttpAnswer {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers = {};
  HttpStream stream = {};  // takes the place of `body` where there is one
};

}  // namespace focalfleet
