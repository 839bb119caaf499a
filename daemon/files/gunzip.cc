#include "daemon/files/gunzip.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <limits>

namespace focalfleet {
namespace {

constexpr std::size_t kChunk = 1u << 20;
constexpr int kGzipOnly = 16 + MAX_WBITS;

class Inflater {
 public:
  Inflater() { ready_ = inflateInit2(&stream_, kGzipOnly) == Z_OK; }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  ~Inflater() {
    if (ready_) inflateEnd(&stream_);
  }

  /// Takes one member off the front of `bytes` and appends its content to `out`. Null: done, else
  /// the reason.
  const char* TakeMember(std::string_view* bytes, std::size_t bytes_max, std::string* out) {
    if (!ready_ || inflateReset(&stream_) != Z_OK) return "there is no memory to unpack it";
    for (;;) {
      const auto given =
          static_cast<uInt>(std::min<std::size_t>(bytes->size(), std::numeric_limits<uInt>::max()));
      stream_.next_in = static_cast<Bytef*>(
          const_cast<void*>(static_cast<const void*>(bytes->data())));  // zlib only reads it
      stream_.avail_in = given;
      const std::size_t had = out->size();
      out->resize(had + kChunk);
      stream_.next_out = static_cast<Bytef*>(static_cast<void*>(out->data() + had));
      stream_.avail_out = kChunk;
      const int state = inflate(&stream_, Z_NO_FLUSH);
      out->resize(had + kChunk - stream_.avail_out);
      bytes->remove_prefix(given - stream_.avail_in);
      if (out->size() > bytes_max) return "unpacked it is too large";
      if (state == Z_STREAM_END) return nullptr;
      if (state == Z_BUF_ERROR || (state == Z_OK && bytes->empty() && stream_.avail_out > 0))
        return "its gzip stream is cut short";
      if (state != Z_OK) return "its gzip stream is damaged";
    }
  }

 private:
  z_stream stream_{};
  bool ready_ = false;
};

}  // namespace

bool IsGzip(std::string_view bytes) { return bytes.starts_with("\x1f\x8b"); }

Result<std::string> Gunzip(std::string_view bytes, const std::string& name, std::size_t bytes_max) {
  std::string out;
  Inflater inflater;
  // Bytes behind the last member are padding of a tape or a block.
  do {
    if (const char* wrong = inflater.TakeMember(&bytes, bytes_max, &out))
      return Fail(ErrorCode::kInvalid, fmt::format("{}: {}", name, wrong));
  } while (IsGzip(bytes));
  return out;
}

}  // namespace focalfleet
