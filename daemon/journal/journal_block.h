// A block of a journal's file; journal_file.h has the format.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet::journal {

enum class BlockKind : std::uint32_t { kHead = 1, kLife, kSteps, kEnd };

/// No block is larger. The life of 5000 units takes 0.7 MB, so that a file's length that is damaged
/// asks for no more memory than this. Units: bytes.
inline constexpr std::uint32_t kBlockBytesMax = 1u << 28;

struct Block {
  BlockKind kind = BlockKind::kHead;
  std::uint64_t first_step = 0;  // of the first record
  std::uint32_t records = 0;
  std::string bytes;  // unpacked
};

/// The block as it stands in a file.
std::string Packed(const Block& block);

/// Takes the block at the front of `bytes` off. Errors: kFull: `bytes` ends within it; kInvalid: it
/// is damaged.
Result<Block> TakeBlock(std::string_view* bytes);

}  // namespace focalfleet::journal
