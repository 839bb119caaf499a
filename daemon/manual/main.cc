// focalfleet-manual writes the man pages of all programs into a folder, out of their trees of
// commands and the list of configuration keys. Pages that are written by hand are copied. The build
// runs this program; it is not installed.
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/files/text_file.h"
#include "daemon/process/command_line.h"
#include "daemon/process/config_manual.h"
#include "daemon/simulator/command_line.h"
#include "daemon/study/study.h"

namespace {

namespace fs = std::filesystem;
using focalfleet::usage::ManualPage;

std::vector<ManualPage> AllPages() {
  std::vector<ManualPage> pages = focalfleet::cli::Manual(focalfleet::cli::AddStudyCommands);
  for (const auto& more : {focalfleet::DaemonManual(), focalfleet::simulator::Manual()})
    pages.insert(pages.end(), more.begin(), more.end());
  pages.push_back(focalfleet::ConfigManual());
  return pages;
}

int Fail(const std::string& text) {
  std::fprintf(stderr, "focalfleet-manual: %s\n", text.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return Fail("usage: focalfleet-manual OUT_DIR FOLDER_OF_PAGES_BY_HAND");
  const fs::path folder = argv[1];
  std::error_code failed;
  fs::create_directories(folder, failed);
  for (const ManualPage& page : AllPages()) {
    const auto written = focalfleet::WriteFileAtomically((folder / page.file).string(), page.roff);
    if (!written) return Fail(written.error().text);
  }
  for (const auto& entry : fs::directory_iterator(argv[2], failed))
    fs::copy_file(entry.path(), folder / entry.path().filename(),
                  fs::copy_options::overwrite_existing, failed);
  return failed ? Fail(failed.message()) : 0;
}
