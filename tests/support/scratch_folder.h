// The scratch folder is one test's place for files and sockets. The folder goes with the test.
// Where the test failed, the folder stays, so that its files can be read.
#pragma once

#include <string>
#include <vector>

namespace focalfleet::test {

class ScratchFolder {
 public:
  /// An empty folder exists. The path is short, because that of a UNIX socket ends at 107 bytes.
  ScratchFolder();
  /// The folder is made in `parent` instead of the system's folder for temporary files.
  explicit ScratchFolder(const std::string& parent);
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  /// The folder is gone with all that is in it. Where the running test has failed, the folder is
  /// kept, and its path is printed to stderr.
  ~ScratchFolder();

  /// The folder will stay in any case.
  void Keep() { kept_ = true; }
  [[nodiscard]] const std::string& path() const { return path_; }
  /// The path of a file in the folder, whether or not the file exists.
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  /// The file holds `text`; returns its path.
  std::string Put(const std::string& name, const std::string& text) const;
  /// Names of all that is in the folder, sorted.
  [[nodiscard]] std::vector<std::string> List() const;

 private:
  std::string path_;
  bool kept_ = false;
};

}  // namespace focalfleet::test
