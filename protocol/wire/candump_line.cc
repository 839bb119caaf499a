#include "protocol/wire/candump_line.h"

#include <charconv>

namespace focalfleet {
namespace {

using Broken = tl::unexpected<const char*>;

constexpr std::size_t kShortDigits = 3;     // candump writes 11-bit identifiers with 3 digits,
constexpr std::size_t kExtendedDigits = 8;  // and all others with 8
constexpr std::uint32_t kErrorFlag = 0x20000000;
constexpr unsigned kFdBytesMax = 64;

constexpr const char* kNoFrame = "it ends before the frame";
constexpr const char* kNoIdentifier = "the identifier is neither 3 nor 8 hexadecimal digits";
constexpr const char* kNoData = "the data are not pairs of hexadecimal digits";
constexpr const char* kNoLength = "the length is no number of bytes";
constexpr const char* kTooMuch = "more bytes than a frame has";

/// Cuts the next word off; empty at the end.
std::string_view NextWord(std::string_view* rest) {
  const std::size_t begin = rest->find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return *rest = {};
  const std::size_t end = rest->find_first_of(" \t\r", begin);
  const std::string_view word = rest->substr(begin, end - begin);
  *rest = end == std::string_view::npos ? std::string_view{} : rest->substr(end);
  return word;
}

template <class Number>
bool Parse(std::string_view text, int base, Number* out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *out, base);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

/// "(...)" at the front, with the blanks that a date has inside.
bool TakeTime(std::string_view* rest, std::string_view* time) {
  const std::size_t begin = rest->find_first_not_of(" \t");
  if (begin == std::string_view::npos || (*rest)[begin] != '(') return true;
  const std::size_t end = rest->find(')', begin);
  if (end == std::string_view::npos) return false;
  *time = rest->substr(begin + 1, end - begin - 1);
  *rest = rest->substr(end + 1);
  return !time->empty();
}

bool TakeIdentifier(std::string_view digits, CandumpLine* line) {
  if (digits.size() != kShortDigits && digits.size() != kExtendedDigits) return false;
  if (!Parse(digits, 16, &line->frame.id)) return false;
  if (digits.size() == kShortDigits) {
    line->foreign = "an 11-bit identifier";
  } else if ((line->frame.id & kErrorFlag) != 0) {
    line->foreign = "an error frame";
    line->frame.id &= kCanIdMax;
  }
  return line->frame.id <= kCanIdMax;
}

template <class Frame>
bool AddByte(std::string_view digits, Frame* frame) {
  std::uint8_t byte = 0;
  if (digits.size() != 2 || !Parse(digits, 16, &byte)) return false;
  frame->data[frame->length++] = byte;
  return true;
}

bool MayBeGroup(const CandumpLine& line) {
  return line.foreign == nullptr && line.frame.id == kGroupId;
}

/// Data without blanks.
template <class Frame>
tl::expected<void, const char*> ReadPairs(std::string_view data, Frame* frame) {
  for (; !data.empty(); data = data.substr(data.size() < 2 ? data.size() : 2)) {
    if (frame->length == frame->data.size()) return Broken(kTooMuch);
    if (!AddByte(data.substr(0, 2), frame)) return Broken(kNoData);
  }
  return {};
}

tl::expected<CandumpLine, const char*> ParseLogged(std::string_view word, CandumpLine line) {
  const std::size_t hash = word.find('#');
  if (!TakeIdentifier(word.substr(0, hash), &line)) return Broken(kNoIdentifier);
  std::string_view data = word.substr(hash + 1);
  if (MayBeGroup(line) && data.size() >= 2 && data[0] == '#') {
    line.group = FdFrame{.id = line.frame.id};
    line.frame = {};
    return ReadPairs(data.substr(2), &*line.group).map([&] { return line; });
  }
  if (!data.empty() && (data[0] == '#' || data[0] == 'R')) {
    if (line.foreign == nullptr) line.foreign = data[0] == '#' ? "CAN FD" : "a remote frame";
    return line;
  }
  return ReadPairs(data, &line.frame).map([&] { return line; });
}

tl::expected<CandumpLine, const char*> ParsePlain(std::string_view word, std::string_view rest,
                                                  CandumpLine line) {
  if (word == "TX" || word == "RX") {  // and two columns of flags
    NextWord(&rest);
    NextWord(&rest);
    word = NextWord(&rest);
  }
  if (!TakeIdentifier(word, &line)) return Broken(kNoIdentifier);
  std::string_view length = NextWord(&rest);
  if (length == "[") length = NextWord(&rest);  // "[ 5]"
  if (length.empty()) return Broken(kNoFrame);
  if (length.front() == '[') length.remove_prefix(1);
  unsigned bytes = 0;
  const bool fd = length.size() == 3;  // "05]": candump writes the length of CAN FD in two digits
  if (length.empty() || length.back() != ']' ||
      !Parse(length.substr(0, length.size() - 1), 10, &bytes) || bytes > (fd ? kFdBytesMax : 8u))
    return Broken(kNoLength);
  if (fd && MayBeGroup(line)) {
    line.group = FdFrame{.id = line.frame.id};
    line.frame = {};
    for (unsigned i = 0; i < bytes; ++i)
      if (!AddByte(NextWord(&rest), &*line.group)) return Broken(kNoData);
    return line;
  }
  if (fd) {
    if (line.foreign == nullptr) line.foreign = "CAN FD";
    return line;
  }
  std::string_view data = NextWord(&rest);
  if (data == "remote") {
    if (line.foreign == nullptr) line.foreign = "a remote frame";
    return line;
  }
  for (unsigned i = 0; i < bytes; ++i, data = NextWord(&rest))
    if (!AddByte(data, &line.frame)) return Broken(kNoData);
  return line;
}

}  // namespace

tl::expected<CandumpLine, const char*> ParseCandumpLine(std::string_view line) {
  CandumpLine parsed;
  std::string_view rest = line;
  if (!TakeTime(&rest, &parsed.time)) return Broken("the time has no end");
  parsed.interface = NextWord(&rest);
  const std::string_view word = NextWord(&rest);
  if (word.empty()) return Broken(kNoFrame);
  if (word.find('#') != std::string_view::npos) return ParseLogged(word, parsed);
  return ParsePlain(word, rest, parsed);
}

}  // namespace focalfleet
