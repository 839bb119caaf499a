#include "protocol/wire/candump_line.h"

#include <algorithm>
#include <charconv>

namespace focalfleet {
namespace {

using Broken = tl::unexpected<const char*>;

// candump writes 11-bit identifiers with 3 digits, and all others with 8.
constexpr std::size_t kShortDigits = 3;
constexpr std::size_t kExtendedDigits = 8;
constexpr std::uint32_t kErrorFlag = 0x20000000;
constexpr unsigned kFdBytesMax = 64;

constexpr const char* kNoFrame = "it ends before the frame";
constexpr const char* kNoIdentifier = "the identifier is neither 3 nor 8 hexadecimal digits";
constexpr const char* kNoData = "the data are not pairs of hexadecimal digits";
constexpr const char* kNoLength = "the length is no number of bytes";
constexpr const char* kTooMuch = "more bytes than a frame has";

/// Cuts off the next word; the result is empty at the end.
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

bool TakePrefix(std::string_view* text, std::string_view prefix) {
  if (!text->starts_with(prefix)) return false;
  text->remove_prefix(prefix.size());
  return true;
}

/// Takes "(...)" from the front; a date has blanks inside.
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

/// Reads data bytes that stand without blanks.
template <class Frame>
tl::expected<void, const char*> ReadPairs(std::string_view data, Frame* frame) {
  for (; !data.empty(); data = data.substr(data.size() < 2 ? data.size() : 2)) {
    if (frame->length == frame->data.size()) return Broken(kTooMuch);
    if (!AddByte(data.substr(0, 2), frame)) return Broken(kNoData);
  }
  return {};
}

/// Reads data bytes as candump prints them after the length: two hexadecimal digits a byte, or
/// eight bits. They ascend after blanks and descend after a '`'.
template <class Frame>
bool ReadPrinted(std::string_view* rest, unsigned count, Frame* frame) {
  bool descends = false;
  for (unsigned i = 0; i < count; ++i) {
    const std::size_t begin = rest->find_first_not_of(" \t`");
    if (begin == std::string_view::npos) return false;
    descends |= i > 0 && begin > 0 && (*rest)[begin - 1] == '`';
    *rest = rest->substr(begin);
    const std::string_view digits = rest->substr(0, rest->find_first_of(" \t\r`"));
    *rest = rest->substr(digits.size());
    std::uint8_t byte = 0;
    const bool is_binary = digits.size() == 8;
    if (!(is_binary || digits.size() == 2) || !Parse(digits, is_binary ? 2 : 16, &byte))
      return false;
    frame->data[frame->length++] = byte;
  }
  if (descends) std::reverse(frame->data.begin(), frame->data.begin() + frame->length);
  return true;
}

/// The length as printed: "[5]", "[05]" for CAN FD, "[0005]" for CAN XL. "{B}" means eight bytes
/// with the length code B.
struct PrintedLength {
  unsigned bytes = 0;
  std::size_t digits = 0;
};
std::optional<PrintedLength> TakeLength(std::string_view* rest) {
  std::string_view word = NextWord(rest);
  if (word == "[") word = NextWord(rest);  // "[ 5]"
  unsigned code = 0;
  if (word.size() == 3 && word.front() == '{' && word.back() == '}')
    return Parse(word.substr(1, 1), 16, &code) ? std::optional(PrintedLength{8, 1}) : std::nullopt;
  TakePrefix(&word, "[");
  if (word.empty() || word.back() != ']') return std::nullopt;
  word.remove_suffix(1);
  PrintedLength length{.digits = word.size()};
  if (!Parse(word, 10, &length.bytes)) return std::nullopt;
  return length;
}

/// CAN XL has two digits of the virtual network and three of the priority, then
/// "81:00:12345678#...".
bool IsXl(std::string_view identifier, std::string_view data) {
  std::uint32_t digits = 0;
  return identifier.size() == 5 && Parse(identifier, 16, &digits) && data.size() > 2 &&
         data[2] == ':';
}

tl::expected<CandumpLine, const char*> ParseLogged(std::string_view word, CandumpLine line) {
  const std::size_t hash = word.find('#');
  std::string_view data = word.substr(hash + 1);
  if (IsXl(word.substr(0, hash), data)) {
    line.foreign = "CAN XL";
    return line;
  }
  if (!TakeIdentifier(word.substr(0, hash), &line)) return Broken(kNoIdentifier);
  // A length code of eight bytes other than 8 stands behind the data.
  if (data.size() == 18 && data[16] == '_') data.remove_suffix(2);
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
  if (word == "TX" || word == "RX") {  // two columns of flags follow
    NextWord(&rest);
    NextWord(&rest);
    word = NextWord(&rest);
  }
  if (!TakeIdentifier(word, &line)) return Broken(kNoIdentifier);
  const std::size_t begin = rest.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return Broken(kNoFrame);
  const auto length = TakeLength(&rest);
  constexpr std::size_t kFdDigits = 2;
  constexpr std::size_t kXlDigits = 4;
  if (length && length->digits == kXlDigits) {
    line.foreign = "CAN XL";
    return line;
  }
  const bool fd = length && length->digits == kFdDigits;
  if (!length || length->digits > kFdDigits || length->bytes > (fd ? kFdBytesMax : 8u))
    return Broken(kNoLength);
  if (fd && MayBeGroup(line)) {
    line.group = FdFrame{.id = line.frame.id};
    line.frame = {};
    if (!ReadPrinted(&rest, length->bytes, &*line.group)) return Broken(kNoData);
    return line;
  }
  if (fd) {
    if (line.foreign == nullptr) line.foreign = "CAN FD";
    return line;
  }
  std::string_view after = rest;
  if (NextWord(&after) == "remote") {
    if (line.foreign == nullptr) line.foreign = "a remote frame";
    return line;
  }
  if (!ReadPrinted(&rest, length->bytes, &line.frame)) return Broken(kNoData);
  return line;
}

constexpr std::string_view kWarning = "Warning: console output active while logging!";

// candump writes lines with these openings besides its frames, where both go into one file.
constexpr std::string_view kSayings[] = {kWarning,
                                         "Enabling Logfile ",
                                         "Disabled standard output while logging.",
                                         "The socket receive buffer size was adjusted",
                                         "Error class ",
                                         "read: "};
constexpr std::string_view kInterfaceDown = ": interface down";

}  // namespace

std::optional<CandumpNote> ParseCandumpNote(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  const auto is_lower = [](char c) { return c >= 'a' && c <= 'z'; };
  if (line.size() > 1 && line[0] == '\t' && is_lower(line[1]))
    return CandumpNote{.kind = CandumpNote::Kind::kErrorWords, .text = line.substr(1)};
  if (line.ends_with(kInterfaceDown) ||
      std::any_of(std::begin(kSayings), std::end(kSayings),
                  [&](std::string_view saying) { return line.starts_with(saying); }))
    return CandumpNote{.text = line};
  std::string_view rest = line;
  if (!TakePrefix(&rest, "DROPCOUNT: dropped ")) return std::nullopt;
  CandumpNote note{.kind = CandumpNote::Kind::kDropped, .text = line};
  if (!Parse(NextWord(&rest), 10, &note.dropped)) return std::nullopt;
  const std::size_t open = rest.find('\'');
  const std::size_t close = rest.find("' socket (total drops ");
  if (open == std::string_view::npos || close == std::string_view::npos || close <= open)
    return std::nullopt;
  note.interface = rest.substr(open + 1, close - open - 1);
  std::string_view total = rest.substr(rest.rfind(' ') + 1);
  if (!total.ends_with(')')) return std::nullopt;
  total.remove_suffix(1);
  if (!Parse(total, 10, &note.dropped_total)) return std::nullopt;
  return note;
}

std::string WithoutDecoration(std::string_view line) {
  std::string plain;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\b' && !plain.empty()) {
      plain.pop_back();
      continue;
    }
    if (line.substr(i, 2) != "\033[") {
      plain += line[i];
      continue;
    }
    const std::size_t end = line.find_first_not_of("0123456789;", i + 2);
    i = std::min(end, line.size() - 1);  // the letter that ends the colour
  }
  std::string_view rest = plain;
  if (TakePrefix(&rest, kWarning) && rest.find_first_not_of(" \r") != std::string_view::npos)
    return std::string(rest);
  return plain;
}

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
