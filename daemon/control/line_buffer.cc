#include "daemon/control/line_buffer.h"

#include <algorithm>
#include <utility>

namespace focalfleet {

void LineBuffer::Append(std::string_view bytes) {
  const std::size_t searched = bytes_.size();
  bytes_.append(bytes);
  if (!has_line()) line_end_ = bytes_.find('\n', searched);
  unseen_ = unseen_ || has_line();
}

std::optional<LineBuffer::Line> LineBuffer::Take() {
  if (!has_line()) return std::nullopt;
  Line line{.text = bytes_.substr(0, line_end_), .overtaken = overtaken_ > 0};
  Erase(0, line_end_ + 1);
  return line;
}

std::optional<std::string> LineBuffer::TakeUrgent(const Urgent& urgent) {
  for (std::size_t cost = 0; unseen_ && cost < kLookBytes;) {
    const std::size_t end = bytes_.find('\n', std::max(looked_, searched_));
    if (end == std::string::npos) {
      searched_ = bytes_.size();
      unseen_ = false;
      break;
    }
    const std::string_view line = std::string_view(bytes_).substr(looked_, end - looked_);
    if (urgent(line)) {
      std::string text(line);
      const std::size_t begin = looked_;
      Erase(begin, end + 1 - begin);
      overtaken_ = std::max(overtaken_, begin);
      return text;
    }
    cost += line.size() + 1;
    looked_ = end + 1;
  }
  return std::nullopt;
}

void LineBuffer::Overtake() {
  if (!has_line()) return;
  overtaken_ = std::max(overtaken_, bytes_.rfind('\n') + 1);
}

void LineBuffer::Erase(std::size_t from, std::size_t count) {
  bytes_.erase(from, count);
  for (std::size_t* mark : {&looked_, &searched_, &overtaken_})
    *mark = *mark >= from + count ? *mark - count : std::min(*mark, from);
  line_end_ = bytes_.find('\n');
}

}  // namespace focalfleet
