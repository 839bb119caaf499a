#include "protocol/wire/message_rows.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "protocol/wire/layout.h"

namespace focalfleet {
namespace {

using layout::HasConstantDetail;
using layout::Layout;

template <class Message>
struct RowsOf {
  static constexpr std::size_t kCount = std::tuple_size_v<decltype(Layout<Message>::kFields)>;
  static constexpr std::array<FieldRow, kCount> kRows =
      std::apply([](const auto&... field) { return std::array<FieldRow, kCount>{field.row...}; },
                 Layout<Message>::kFields);
};

template <class Message>
constexpr MessageRow RowOf(bool from_unit) {
  std::uint8_t detail = 0;
  if constexpr (HasConstantDetail<Message>) detail = Layout<Message>::kDetail;
  return {Layout<Message>::kName,   Layout<Message>::kFunction, from_unit, detail,
          Layout<Message>::kLength, RowsOf<Message>::kRows};
}

constexpr std::size_t kHostRows = std::variant_size_v<HostMessage>;
constexpr std::size_t kUnitRows = std::variant_size_v<UnitMessage> + 1;

constexpr std::array<MessageRow, kHostRows + kUnitRows> kRows = [] {
  std::array<MessageRow, kHostRows + kUnitRows> rows{};
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    ((rows[i] = RowOf<std::variant_alternative_t<i, HostMessage>>(false)), ...);
  }
  (std::make_index_sequence<kHostRows>{});
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    ((rows[kHostRows + i] = RowOf<std::variant_alternative_t<i, UnitMessage>>(true)), ...);
  }
  (std::make_index_sequence<kUnitRows - 1>{});
  rows.back() = RowOf<ParameterReply>(true);
  rows.back().name = "parameter_write_reply";
  rows.back().function = Function::kParameterWrite;
  const auto place = [](const MessageRow& row) {
    return (row.from_unit ? 256u : 0u) + 8u * static_cast<unsigned>(row.function) + row.detail;
  };
  std::sort(rows.begin(), rows.end(),
            [&](const MessageRow& a, const MessageRow& b) { return place(a) < place(b); });
  return rows;
}();

}  // namespace

std::span<const MessageRow> MessageRows() { return kRows; }

const MessageRow* RowOf(const CanFrame& frame) {
  for (const MessageRow& row : kRows) {
    const bool here =
        frame.id >> 20 == (static_cast<std::uint32_t>(InfoOf(row.function).priority) << 6 |
                           static_cast<std::uint32_t>(row.function)) &&
        (frame.id >> 19 & 1) == (row.from_unit ? 1u : 0u);
    const bool detailed = row.detail_field() != nullptr || (frame.id & 7) == row.detail;
    if (here && detailed && frame.length == row.length) return &row;
  }
  return nullptr;
}

}  // namespace focalfleet
