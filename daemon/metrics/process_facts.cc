#include "daemon/metrics/process_facts.h"

#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

namespace focalfleet {
namespace {

std::string Read(const char* path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// The n-th field of /proc/self/stat, from 1 as proc(5) counts. Pre: n > 2.
std::uint64_t StatField(const std::string& stat, int n) {
  // The second field is a name in parentheses, which may have blanks and parentheses itself.
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos) return 0;
  std::istringstream rest(stat.substr(name_end + 1));
  std::string field;
  for (int i = 2; i < n && rest >> field; ++i) {
  }
  return std::strtoull(field.c_str(), nullptr, 10);
}

}  // namespace

ProcessFacts ReadProcessFacts() {
  ProcessFacts facts;
  const std::string stat = Read("/proc/self/stat");
  const double ticks_per_s = static_cast<double>(::sysconf(_SC_CLK_TCK));
  const auto seconds = [&](int n) { return static_cast<double>(StatField(stat, n)) / ticks_per_s; };
  facts.cpu_s = seconds(14) + seconds(15);
  facts.threads = StatField(stat, 20);
  facts.virtual_bytes = StatField(stat, 23);
  facts.resident_bytes = StatField(stat, 24) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  std::error_code failed;
  const std::filesystem::directory_iterator descriptors("/proc/self/fd", failed);
  facts.open_descriptors =
      static_cast<std::uint64_t>(std::distance(begin(descriptors), end(descriptors)));
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) facts.descriptors_max = limit.rlim_cur;
  return facts;
}

std::uint64_t StoreBytes(const std::string& path) {
  std::uint64_t bytes = 0;
  for (const char* ending : {"", "-wal"}) {
    std::error_code failed;
    const auto size = std::filesystem::file_size(path + ending, failed);
    if (!failed) bytes += size;
  }
  return bytes;
}

}  // namespace focalfleet
