#include "daemon/loop/row_bytes.h"

#include <variant>

namespace focalfleet {
namespace {

template <class... Texts>
std::size_t Sizes(const Texts&... texts) {
  return (std::size_t{0} + ... + texts.size());
}

/// Rows without a text.
template <class AnyRow>
std::size_t TextBytes(const AnyRow&) {
  return 0;
}
std::size_t TextBytes(const MeasurementRow& row) {
  return Sizes(row.target_id) + (row.carrier ? Sizes(row.carrier->verdict) : 0);
}
std::size_t TextBytes(const EnableRow& row) { return Sizes(row.reason); }
std::size_t TextBytes(const ConfigurationRow& row) { return Sizes(row.source); }
std::size_t TextBytes(const AlarmRow& row) { return Sizes(row.text); }
std::size_t TextBytes(const AlarmEndRow& row) { return Sizes(row.reason); }
std::size_t TextBytes(const OpenAlarmRow& row) { return Sizes(row.text, row.acknowledged_by); }
std::size_t TextBytes(const MuteRow& row) { return Sizes(row.reason, row.by); }
std::size_t TextBytes(const ModelRow& row) {
  return Sizes(row.sha256, row.name, row.campaign, row.campaign_sha256) +
         (row.text != nullptr ? row.text->size() : 0);
}
std::size_t TextBytes(const AuditRow& row) {
  return Sizes(row.door, row.name, row.role, row.address, row.boot_id, row.verb, row.request,
               row.request_sha256, row.code, row.reason) +
         (row.process ? Sizes(row.process->program) : 0);
}

}  // namespace

std::size_t BytesOf(const Row& row) {
  return sizeof row + std::visit([](const auto& what) { return TextBytes(what); }, row);
}

std::size_t BytesOf(std::span<const Row> rows) {
  std::size_t bytes = 0;
  for (const Row& row : rows) bytes += BytesOf(row);
  return bytes;
}

}  // namespace focalfleet
