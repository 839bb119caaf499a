#include "daemon/page/kept_plans.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

#include "daemon/files/text_file.h"
#include "daemon/page/plan_motion.h"

namespace focalfleet {
namespace {

namespace fs = std::filesystem;

/// The numbers in the name of a motion's file.
struct FileName {
  std::uint64_t configuration = 0;
  std::uint64_t number = 0;
  auto operator<=>(const FileName&) const = default;
};

std::optional<FileName> NameIn(const fs::path& path) {
  const std::string name = path.filename();
  FileName found;
  const char* const end = name.data() + name.size();
  const auto first = std::from_chars(name.data(), end, found.configuration);
  if (first.ec != std::errc() || first.ptr == end || *first.ptr != '.') return std::nullopt;
  const auto second = std::from_chars(first.ptr + 1, end, found.number);
  if (second.ec != std::errc() || std::string_view(second.ptr, end) != ".motion")
    return std::nullopt;
  return found;
}

/// Writes beside the place and renames; nothing is made durable.
bool WriteLazily(const std::string& path, const std::string& bytes) {
  const std::string beside = path + ".new";
  std::error_code failed;
  {
    std::ofstream file(beside, std::ios::binary | std::ios::trunc);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (file) fs::rename(beside, path, failed);
    if (file && !failed) return true;
  }
  fs::remove(beside, failed);
  return false;
}

}  // namespace

void KeptPlans::KeepIn(const std::string& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  std::vector<std::pair<FileName, fs::path>> files;
  for (auto entry = fs::directory_iterator(folder, failed); !failed && entry != fs::end(entry);
       entry.increment(failed))
    if (const auto name = NameIn(entry->path())) files.emplace_back(*name, entry->path());
  std::ranges::sort(files);
  const std::lock_guard lock(mutex_);
  folder_ = folder;
  for (const auto& [name, path] : files) {
    const std::uintmax_t bytes = fs::file_size(path, failed);
    if (failed) continue;
    plans_.push_back({name.configuration, static_cast<std::size_t>(bytes), nullptr, path});
    bytes_ += plans_.back().bytes;
  }
  DropBeyondBound();
}

void KeptPlans::PutPreview(std::uint64_t plan, std::string motion) {
  auto kept =
      motion.size() > bytes_max_ ? nullptr : std::make_shared<const std::string>(std::move(motion));
  const std::lock_guard lock(mutex_);
  preview_plan_ = plan;
  preview_ = std::move(kept);
}

/// A name that no kept plan has. Pre: the mutex is held.
std::string KeptPlans::PathOf(std::uint64_t configuration) const {
  for (std::uint64_t number = 1;; ++number) {
    std::string path = fs::path(folder_) /
                       (std::to_string(configuration) + "." + std::to_string(number) + ".motion");
    if (std::ranges::find(plans_, path, &Kept::path) == plans_.end()) return path;
  }
}

void KeptPlans::Put(std::uint64_t configuration, std::string motion) {
  if (motion.size() > bytes_max_) return;
  auto kept = std::make_shared<const std::string>(std::move(motion));
  std::string path;
  {
    const std::lock_guard lock(mutex_);
    if (!folder_.empty()) path = PathOf(configuration);
    bytes_ += kept->size();
    plans_.push_back({configuration, kept->size(), kept, path});
    DropBeyondBound();
  }
  // A page that asks meanwhile is answered from memory.
  if (!path.empty()) WriteLazily(path, *kept);
}

/// Pre: the mutex is held.
void KeptPlans::DropBeyondBound() {
  while (bytes_ > bytes_max_) {
    std::error_code failed;
    if (!plans_.front().path.empty()) fs::remove(plans_.front().path, failed);
    bytes_ -= plans_.front().bytes;
    plans_.pop_front();
  }
}

KeptPlans::Motion KeptPlans::Preview(std::uint64_t plan) const {
  const std::lock_guard lock(mutex_);
  return plan == preview_plan_ ? preview_ : nullptr;
}

std::vector<KeptPlans::Motion> KeptPlans::Of(std::uint64_t configuration) const {
  std::vector<Kept> found;
  {
    const std::lock_guard lock(mutex_);
    for (const Kept& kept : plans_)
      if (kept.configuration == configuration) found.push_back(kept);
  }
  std::vector<Motion> motions;
  for (Kept& kept : found) {
    if (kept.motion == nullptr)
      if (auto bytes = ReadFile(kept.path); bytes && IsMotion(*bytes))
        kept.motion = std::make_shared<const std::string>(std::move(*bytes));
    if (kept.motion != nullptr) motions.push_back(std::move(kept.motion));
  }
  return motions;
}

}  // namespace focalfleet
