// A directory for one test, removed afterwards. Its path is short, as UNIX sockets need.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

namespace focalfleet {

class Scratch {
 public:
  Scratch() {
    char name[] = "/tmp/focalfleet_test_XXXXXX";
    if (const char* made = ::mkdtemp(name)) directory_ = made;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(directory_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  [[nodiscard]] std::string operator/(const std::string& name) const {
    return directory_ + "/" + name;
  }
  [[nodiscard]] const std::string& path() const { return directory_; }

 private:
  std::string directory_;
};

}  // namespace focalfleet
