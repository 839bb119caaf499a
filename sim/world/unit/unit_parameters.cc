#include "sim/world/unit/unit_parameters.h"

#include <algorithm>

#include "protocol/base/limits.h"
#include "sim/world/unit/places.h"

namespace focalfleet::sim {
namespace {

constexpr std::int32_t kCounter1Min = 50;
constexpr std::int32_t kCounter1Max = 20'000;
constexpr std::int32_t kSubdivisionMax = 1536;
constexpr std::int32_t kHostTimeoutMinMs = 100;
constexpr std::int32_t kHostTimeoutMaxMs = 3'600'000;

bool IsPosition(std::int64_t value) {
  return value >= -limits::kPositionMax && value <= limits::kPositionMax;
}

// The quotient to the nearest whole number, halves away from zero. Pre: divisor > 0.
std::int64_t RoundedQuotient(std::int64_t number, std::int64_t divisor) {
  const std::int64_t doubled = 2 * (number < 0 ? -number : number) + divisor;
  const std::int64_t quotient = doubled / (2 * divisor);
  return number < 0 ? -quotient : quotient;
}

// The rotor agrees with the vector that is applied, so only whole turns can be wrong. The place
// taken is the one nearest to the value that shows this vector.
Answer WritePosition(const Board& board, Flash* flash, Axis axis, std::int32_t value) {
  AxisFlash& stored = flash->axis[Index(axis)];
  if (value < -limits::kPositionMax || value > limits::kPositionMax) return Answer::kBadValue;
  const std::int32_t place = NearestCongruent(value, stored.position(), stored.subdivision);
  if (!IsPosition(place)) return Answer::kBadValue;
  board.recount(board.context, axis, place);
  stored.set_position(place);
  flash->lost_axes = static_cast<std::uint8_t>(flash->lost_axes & ~Bit(axis));
  if (flash->lost_axes == 0) flash->moving = false;
  return Answer::kOk;
}

// All places keep their angle; the field goes to the nearest vector of the new division.
Answer WriteSubdivision(const Board& board, Flash* flash, Axis axis, std::int32_t value) {
  AxisFlash& stored = flash->axis[Index(axis)];
  if (value < 6 || value > kSubdivisionMax || value % 6 != 0) return Answer::kBadValue;
  const auto rescaled = [&](std::int32_t old) {
    return RoundedQuotient(std::int64_t{old} * value, stored.subdivision);
  };
  for (const std::int32_t old :
       {stored.position(), stored.min_position, stored.max_position, stored.home_position})
    if (!IsPosition(rescaled(old))) return Answer::kBadValue;
  const auto position = static_cast<std::int32_t>(rescaled(stored.position()));
  stored.min_position = static_cast<std::int32_t>(rescaled(stored.min_position));
  stored.max_position = static_cast<std::int32_t>(rescaled(stored.max_position));
  stored.home_position = static_cast<std::int32_t>(rescaled(stored.home_position));
  stored.subdivision = static_cast<std::uint16_t>(value);
  stored.set_position(position);
  board.energise(board.context, axis, {position, stored.subdivision});
  return Answer::kOk;
}

}  // namespace

std::int32_t AppliedPosition(const Board& board, Axis axis, BoardInstant now) {
  return std::clamp(board.applied(board.context, axis, now), -limits::kPositionMax,
                    limits::kPositionMax);
}

std::int32_t ReadParameter(const Board& board, const Flash& flash, const ParameterRead& m,
                           BoardInstant now) {
  const AxisFlash& stored = flash.axis[Index(m.axis)];
  switch (m.parameter) {
    case Parameter::kCounter1:
      return stored.counter1;
    case Parameter::kRepeat:
      return stored.repeat;
    case Parameter::kSubdivision:
      return stored.subdivision;
    case Parameter::kMode:
      return static_cast<std::int32_t>(stored.mode);
    case Parameter::kPosition:
      return AppliedPosition(board, m.axis, now);
    case Parameter::kMinPosition:
      return stored.min_position;
    case Parameter::kMaxPosition:
      return stored.max_position;
    case Parameter::kHomePosition:
      return stored.home_position;
    case Parameter::kHostTimeoutMs:
      return flash.host_timeout_ms;
  }
  return 0;
}

Answer WriteParameter(const Board& board, Flash* flash, const ParameterWrite& m) {
  AxisFlash& stored = flash->axis[Index(m.axis)];
  const auto within = [&](std::int32_t low, std::int32_t high) {
    return m.value >= low && m.value <= high;
  };
  const bool place = within(-limits::kPositionMax, limits::kPositionMax);
  switch (m.parameter) {
    case Parameter::kCounter1:
      if (!within(kCounter1Min, kCounter1Max)) break;
      stored.counter1 = static_cast<std::uint16_t>(m.value);
      return Answer::kOk;
    case Parameter::kRepeat:
      if (!within(1, 255)) break;
      stored.repeat = static_cast<std::uint8_t>(m.value);
      return Answer::kOk;
    case Parameter::kSubdivision:
      return WriteSubdivision(board, flash, m.axis, m.value);
    case Parameter::kMode:
      if (!within(0, 2)) break;
      stored.mode = static_cast<WaveMode>(m.value);
      return Answer::kOk;
    case Parameter::kPosition:
      return WritePosition(board, flash, m.axis, m.value);
    case Parameter::kMinPosition:
      if (!place || m.value > stored.max_position) break;
      stored.min_position = m.value;
      return Answer::kOk;
    case Parameter::kMaxPosition:
      if (!place || m.value < stored.min_position) break;
      stored.max_position = m.value;
      return Answer::kOk;
    case Parameter::kHomePosition:
      if (!within(stored.min_position, stored.max_position)) break;
      stored.home_position = m.value;
      return Answer::kOk;
    case Parameter::kHostTimeoutMs:
      if (!within(kHostTimeoutMinMs, kHostTimeoutMaxMs)) break;
      flash->host_timeout_ms = m.value;
      return Answer::kOk;
  }
  return Answer::kBadValue;
}

}  // namespace focalfleet::sim
