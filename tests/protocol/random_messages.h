// Random messages of both directions, with every field over its whole range on the wire. Each
// message's fields can be had as one comparable text. The draws follow docs/protocol.md; nothing is
// taken from the codec.
#pragma once

#include <string>
#include <tuple>

#include "protocol/base/rng.h"
#include "protocol/wire/messages.h"

namespace focalfleet::test {

HostMessage RandomHost(Rng& rng);
HostMessage RandomHost(std::size_t alternative, Rng& rng);
UnitMessage RandomUnit(Rng& rng);
UnitMessage RandomUnit(std::size_t alternative, Rng& rng);

/// Every field of a message as text, with its type's place in the variant first. Equal texts mean
/// equal messages.
std::string Show(const HostMessage& message);
std::string Show(const UnitMessage& message);

}  // namespace focalfleet::test
