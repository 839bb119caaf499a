// The lines that one client has sent and the server has not handed out yet. An urgent line may be
// taken from behind others; the lines that it overtook bear a mark when their turn comes.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace focalfleet {

class LineBuffer {
 public:
  using Urgent = std::function<bool(std::string_view)>;
  struct Line {
    std::string text;        // without its newline
    bool overtaken = false;  // an urgent line that came later was taken before it
  };

  /// Limit of the bytes of lines that one call of TakeUrgent looks at. Each line that only looks
  /// urgent costs some microseconds; 4 KiB hold a hundred of them, a fifth of a millisecond a
  /// client. Twice the limit doubles what a hostile client costs a turn. With half of it, a stop
  /// behind a full buffer of short lines takes two turns.
  static constexpr std::size_t kLookBytes = 4096;

  void Append(std::string_view bytes);
  /// The first line, if it is complete.
  std::optional<Line> Take();
  /// The first complete line for which `urgent` is true, wherever it stands. The lines before it
  /// are overtaken.
  std::optional<std::string> TakeUrgent(const Urgent& urgent);
  /// All complete lines are overtaken: an urgent line of another client went ahead of them.
  void Overtake();
  void Clear() { *this = {}; }

  [[nodiscard]] bool has_line() const { return line_end_ != std::string::npos; }
  /// Length of the first line, complete or not, without its newline.
  [[nodiscard]] std::size_t first_bytes() const { return has_line() ? line_end_ : bytes_.size(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  /// Whether TakeUrgent has not looked at all complete lines yet.
  [[nodiscard]] bool unseen() const { return unseen_; }

 private:
  void Erase(std::size_t from, std::size_t count);

  std::string bytes_;
  std::size_t line_end_ = std::string::npos;  // place of the first newline
  std::size_t looked_ = 0;                    // begin of the first unseen line
  std::size_t searched_ = 0;                  // there is no newline from looked_ to here
  std::size_t overtaken_ = 0;                 // lines that begin before this are overtaken
  bool unseen_ = false;
};

}  // namespace focalfleet
