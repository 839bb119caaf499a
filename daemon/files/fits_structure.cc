#include "daemon/files/fits_structure.h"

#include <algorithm>
#include <charconv>
#include <system_error>

namespace focalfleet {
namespace {

constexpr std::size_t kCardBytes = 80;
constexpr std::size_t kKeyBytes = 8;
constexpr std::size_t kValueAt = 10;
constexpr std::int64_t kAxesMax = 999;
constexpr std::int64_t kFieldsMax = 999;

std::string_view TrimmedRight(std::string_view text) {
  return text.substr(0, text.find_last_not_of(' ') + 1);
}

/// A header of the file, with the size of the data that follow it.
class Unit {
 public:
  /// Pre: `bytes` begins with the header.
  explicit Unit(std::string_view bytes) : bytes_(bytes) {}

  /// Checks the header. Null: it is in order; else the reason.
  const char* Check() {
    if (!FindEnd()) return "its header does not end";
    const bool primary = Key() == "SIMPLE";
    const std::string_view extension = primary ? "" : Text();
    ++card_;
    std::int64_t bits = 0;
    std::int64_t axes = 0;
    if (!Take("BITPIX", &bits) || !IsBitpix(bits)) return "BITPIX is not in its place";
    if (!Take("NAXIS", &axes) || axes < 0 || axes > kAxesMax) return "NAXIS is not in its place";
    std::int64_t values = axes > 0 ? 1 : 0;
    for (std::int64_t k = 1; k <= axes; ++k) {
      std::int64_t length = 0;
      if (!Take("NAXIS" + std::to_string(k), &length) || length < 0)
        return "the length of an axis is not in its place";
      if (__builtin_mul_overflow(values, length, &values)) return kTooLarge;
    }
    std::int64_t beside = 0;
    std::int64_t groups = 1;
    if (!primary &&
        (!Take("PCOUNT", &beside) || beside < 0 || !Take("GCOUNT", &groups) || groups < 0))
      return "PCOUNT or GCOUNT is not in its place";
    const bool table = extension == "BINTABLE" || extension == "TABLE";
    std::int64_t fields = 0;
    if (table && (!Take("TFIELDS", &fields) || fields < 0 || fields > kFieldsMax || axes != 2))
      return "TFIELDS is not in its place";
    std::int64_t size = 0;
    if (__builtin_add_overflow(values, beside, &size) ||
        __builtin_mul_overflow(size, groups, &size) ||
        __builtin_mul_overflow(size, (bits < 0 ? -bits : bits) / 8, &size))
      return kTooLarge;
    if (static_cast<std::uint64_t>(size) > bytes_.size() - header_bytes_) return kTooLarge;
    data_bytes_ = static_cast<std::size_t>(size);
    return nullptr;
  }

  /// Bytes of the unit in whole blocks, or up to the end of the file.
  [[nodiscard]] std::size_t size() const {
    const std::size_t blocks = (data_bytes_ + kFitsBlockBytes - 1) / kFitsBlockBytes;
    return header_bytes_ + blocks * kFitsBlockBytes;
  }

 private:
  static constexpr const char* kTooLarge = "its data are cut short";

  static bool IsBitpix(std::int64_t bits) {
    for (const std::int64_t known : {8, 16, 32, 64, -32, -64})
      if (bits == known) return true;
    return false;
  }

  bool FindEnd() {
    for (std::size_t at = 0; at + kCardBytes <= bytes_.size(); at += kCardBytes) {
      if (TrimmedRight(bytes_.substr(at, kCardBytes)) != "END") continue;
      header_bytes_ = (at / kFitsBlockBytes + 1) * kFitsBlockBytes;
      return header_bytes_ <= bytes_.size();
    }
    return false;
  }

  [[nodiscard]] std::string_view Card() const {
    return bytes_.substr(card_ * kCardBytes, kCardBytes);
  }
  [[nodiscard]] std::string_view Key() const { return TrimmedRight(Card().substr(0, kKeyBytes)); }
  /// The text between the quotes of a card.
  [[nodiscard]] std::string_view Text() const {
    const std::string_view value = Card().substr(kValueAt);
    const std::size_t begin = value.find('\'');
    if (begin == std::string_view::npos) return {};
    return TrimmedRight(value.substr(begin + 1, value.find('\'', begin + 1) - begin - 1));
  }

  /// True if the next card is `key` with a whole number, which goes to `value`.
  bool Take(std::string_view key, std::int64_t* value) {
    if (Key() != key || Card().substr(kKeyBytes, 2) != "= ") return false;
    std::string_view text = Card().substr(kValueAt);
    text = text.substr(0, text.find('/'));
    const std::size_t begin = text.find_first_not_of(' ');
    if (begin == std::string_view::npos) return false;
    text = TrimmedRight(text.substr(begin));
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), *value);
    ++card_;  // END is behind, so another card always follows
    return problem == std::errc() && end == text.data() + text.size();
  }

  std::string_view bytes_;
  std::size_t card_ = 0;
  std::size_t header_bytes_ = 0;
  std::size_t data_bytes_ = 0;
};

}  // namespace

Status CheckFitsStructure(std::string_view bytes, const std::string& name) {
  if (!bytes.starts_with("SIMPLE  = "))
    return Fail(ErrorCode::kInvalid, name + ": this is no FITS file");
  for (std::size_t k = 0; k == 0 || bytes.starts_with("XTENSION= "); ++k) {
    Unit unit(bytes);
    if (const char* wrong = unit.Check())
      return Fail(ErrorCode::kInvalid, name + ": unit " + std::to_string(k) + ": " + wrong);
    bytes.remove_prefix(std::min(unit.size(), bytes.size()));
  }
  return {};
}

}  // namespace focalfleet
