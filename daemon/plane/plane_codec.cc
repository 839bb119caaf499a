#include "daemon/plane/plane_codec.h"

#include <algorithm>
#include <cmath>

#include "daemon/journal/fields.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

// Instants and spans of a host's clock stay below 73 years, so that sums of four do not overflow.
constexpr std::int64_t kClockMost_ns = INT64_MAX / 4;
bool IsWithin(std::int64_t value, std::int64_t most) { return -most <= value && value <= most; }
bool IsClock(HostInstant at) { return IsWithin(at.ns, kClockMost_ns); }
bool IsClock(DurationNs time) { return IsWithin(time.ns, kClockMost_ns); }
/// Also the two ends of time.
bool IsTime(HostInstant at) { return IsClock(at) || at == kNever || at.ns == INT64_MIN; }

bool AreSectors(const std::vector<std::uint32_t>& sectors) {
  return sectors.size() <= limits::kSectors &&
         std::ranges::all_of(sectors, [](auto sector) { return sector < limits::kSectors; });
}

bool IsGood(const ApplyCommand& apply) {
  if (apply.targets.size() > limits::kUnits || apply.target_ids.size() > limits::kUnits ||
      apply.source.size() > limits::kTextBytes || !apply.offsets.empty() ||
      (apply.measure && !(apply.measure->tolerance_um > 0 && apply.measure->tolerance_um <= 1e6)))
    return false;
  return std::ranges::all_of(apply.targets, [](const std::optional<Pose>& target) {
    return !target || std::ranges::all_of(*target, [](std::int64_t vectors) {
      return IsWithin(vectors, limits::kPositionMax);
    });
  });
}

bool IsGood(const ExposureFindings& findings) {
  return findings.measurements.size() <= limits::kUnits &&
         findings.camera_trouble.size() <= limits::kTextBytes &&
         std::ranges::all_of(findings.measurements, [](const Measurement& measurement) {
           const auto& covariance = measurement.covariance;
           return static_cast<std::size_t>(measurement.status) < kMeasurementStatusCount &&
                  measurement.source <= MeasurementSource::kSensors &&
                  std::isfinite(measurement.x_mm) && std::isfinite(measurement.y_mm) &&
                  std::isfinite(covariance.xx) && std::isfinite(covariance.xy) &&
                  std::isfinite(covariance.yy) && !measurement.carrier;
         });
}

bool IsGood(const SectorTask& task) {
  if (std::holds_alternative<MeasureCommand>(task.what)) return true;
  if (const auto* home = std::get_if<HomeCommand>(&task.what))
    return home->units.size() <= limits::kUnits;
  return IsGood(std::get<ApplyCommand>(task.what));
}

bool IsGood(const PlaneOrder& order) {
  return order.sector < limits::kSectors && order.kind <= kLastOrderKind &&
         IsClock(order.start_at) && IsClock(order.sent) &&
         (!order.ahead || IsClock(*order.ahead)) && AreSectors(order.together) &&
         order.retargets.size() <= limits::kUnits &&
         std::ranges::all_of(order.retargets,
                             [](const SectorRetarget& retarget) {
                               return std::ranges::all_of(
                                   retarget.target.pose, [](std::int64_t vectors) {
                                     return IsWithin(vectors, limits::kPositionMax);
                                   });
                             }) &&
         (order.findings == nullptr || !*order.findings || IsGood(**order.findings)) &&
         (order.task == nullptr || IsGood(*order.task));
}

bool IsGood(const SectorReport& report) {
  return report.sector < limits::kSectors && report.incarnation != 0 &&
         static_cast<std::uint8_t>(report.stage) < kSectorStageCount &&
         report.last_state <= ConfigurationState::kFailed && IsClock(report.unordered) &&
         std::isfinite(report.start_delay_s) && report.start_delay_s >= 0 &&
         report.start_delay_s <= 60 && report.door.size() <= limits::kTextBytes &&
         (!report.echo || (IsClock(report.echo->sent) && IsClock(report.echo->received) &&
                           IsClock(report.echo->returned)));
}

bool IsGood(const BorderNews& news) {
  return news.sector < limits::kSectors && news.incarnation != 0 &&
         news.stage <= BorderStage::kOver && IsClock(news.start_at) && AreSectors(news.heard) &&
         news.ends.size() <= limits::kBorderEnds &&
         std::ranges::all_of(
             news.ends, [](const BorderEnd& end) { return IsTime(end.from) && IsTime(end.until); });
}

template <class Message>
Result<Message> Decode(std::string_view bytes, const char* what) {
  Message message;
  journal::ByteReader reader{bytes};
  journal::ReadFields(&reader, &message);
  if (reader.good && reader.left.empty() && IsGood(message)) return message;
  return Fail(ErrorCode::kInvalid, std::string("bytes that are no ") + what);
}

template <class Message>
std::string BytesOf(const Message& message) {
  std::string bytes;
  journal::WriteFields(message, &bytes);
  return bytes;
}

}  // namespace

std::string Encode(const PlaneOrder& order) { return BytesOf(order); }
std::string Encode(const SectorReport& report) { return BytesOf(report); }
std::string Encode(const BorderNews& news) { return BytesOf(news); }

Result<PlaneOrder> DecodePlaneOrder(std::string_view bytes) {
  return Decode<PlaneOrder>(bytes, "order of a plane");
}
Result<SectorReport> DecodeSectorReport(std::string_view bytes) {
  return Decode<SectorReport>(bytes, "report of a sector");
}
Result<BorderNews> DecodeBorderNews(std::string_view bytes) {
  return Decode<BorderNews>(bytes, "news of a border");
}

}  // namespace focalfleet
