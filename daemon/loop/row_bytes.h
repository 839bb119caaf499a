// The memory that a row takes while it waits for the store: its own bytes and those of its texts.
// Capacity of texts that is not used, and what an allocator adds, are not counted: some 30 bytes a
// text that is longer than 15.
#pragma once

#include <cstddef>
#include <span>

#include "fleet/records.h"

namespace focalfleet {

/// Units: bytes.
std::size_t BytesOf(const Row& row);
std::size_t BytesOf(std::span<const Row> rows);

}  // namespace focalfleet
