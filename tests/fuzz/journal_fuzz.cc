// The input is any bytes as a file of the journal, and as what a block of it holds, with checksums
// that are right. The first must give blocks or a reason, and what is taken packs to a block again.
// The second must give the record of a life or a reason: nothing is read past the end (the
// sanitizers check that), and no length that the bytes claim asks for memory that they do not fill.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/journal/journal_block.h"
#include "daemon/journal/life_record.h"
#include "protocol/base/check.h"

namespace focalfleet::journal {
namespace {

void TryFile(std::string_view bytes) {
  for (;;) {
    const std::size_t before = bytes.size();
    const auto block = TakeBlock(&bytes);
    if (!block) {
      FOCALFLEET_CHECK(!block.error().text.empty() && bytes.size() == before);
      return;
    }
    FOCALFLEET_CHECK(bytes.size() < before && block->bytes.size() <= kBlockBytesMax);
  }
}

void TryBlock(std::string_view bytes) {
  const std::string packed = Packed({.kind = BlockKind::kLife, .bytes = std::string(bytes)});
  std::string_view left = packed;
  const auto block = TakeBlock(&left);
  FOCALFLEET_CHECK(block && left.empty() && block->bytes == bytes);
  const auto life = LifeFrom(block->bytes);
  if (!life) {
    FOCALFLEET_CHECK(!life.error().text.empty());
    return;
  }
  // A bool may be any byte, so that the bytes may differ from the first ones, and only once.
  const std::string again = BytesOf(*life);
  const auto same = LifeFrom(again);
  FOCALFLEET_CHECK(same && BytesOf(*same) == again && again.size() == bytes.size());
  const auto layout = Layout::Create(
      life->units, {.clearance_mm = life->clearance_mm, .obstacles = life->obstacles});
  FOCALFLEET_CHECK(layout || !layout.error().text.empty());
}

}  // namespace
}  // namespace focalfleet::journal

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  focalfleet::journal::TryFile(bytes);
  focalfleet::journal::TryBlock(bytes);
  return 0;
}
