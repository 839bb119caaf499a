// The tokens of the file, as the HTTP door looks them up: read anew when the file changes, so that
// a revoked token is refused from the next request on. A file that cannot be read is a file without
// tokens.
//
// A comparison takes as long whatever the token: it goes over the hashes of all. Attempts without a
// valid token have a budget for each address, and requests one for each token.
//
// Any thread may call any function.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/access/token.h"
#include "daemon/clock/wall_time.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// A bucket that holds so many requests, and gets some anew each second.
struct Budget {
  double burst = 1;
  double per_second = 1;
};

class TokenRegister {
 public:
  struct Options {
    std::string path;
    Budget attempts{.burst = 20, .per_second = 1};    // that failed, of an address
    Budget requests{.burst = 200, .per_second = 50};  // of a token; a page asks 10 times a second
  };
  explicit TokenRegister(Options options) : options_(std::move(options)) {}

  struct Found {
    std::string name;
    Role role = Role::kNone;
  };
  /// The token of this secret. Errors: kRefused: none has it, or it is expired or revoked;
  /// kUnavailable, kInvalid: the file cannot be read. The text is for the log.
  Result<Found> Find(std::string_view secret, WallTime now);

  /// An attempt of the address has failed. True: it had attempts left; one of them is used.
  bool MayTry(const std::string& address, WallTime now);
  /// The token has requests left; one of them is used.
  bool MayAsk(const std::string& name, WallTime now);

 private:
  struct Bucket {
    double left = 0;
    std::int64_t at_ns = 0;
  };
  using Buckets = std::map<std::string, Bucket>;
  struct Identity {
    std::uint64_t inode = 0;
    std::int64_t bytes = 0;
    std::int64_t changed_ns = 0;
    bool operator==(const Identity&) const = default;
  };

  void Refresh();
  static bool Use(const Budget& budget, const std::string& name, WallTime now, Buckets* in);

  Options options_;
  std::mutex mutex_;
  Identity identity_;
  std::vector<Token> tokens_;
  Status readable_;
  Buckets attempts_;
  Buckets requests_;
};

}  // namespace focalfleet
