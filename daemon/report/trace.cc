#include "daemon/report/trace.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

namespace focalfleet::report {
namespace {

constexpr std::size_t kPointsPerColumn = 4;

// Viewers compute in single precision. A point outside only gives the direction of a line that
// leaves the area.
constexpr double kPixelMax = 1e5;

// The value is never "-0.0": the same point must have the same bytes.
double Written(double pixel) {
  const double clamped = std::clamp(pixel, -kPixelMax, kPixelMax);
  return std::abs(clamped) < 0.005 ? 0.0 : clamped;
}

}  // namespace

Trace::Trace(const Options& options)
    : options_(options),
      reduces_(static_cast<double>(options.points_expected) >
               static_cast<double>(kPointsPerColumn) * options.width_px) {
  if (options_.style != Style::kDots) return;
  dots_.resize(static_cast<std::size_t>(std::ceil(options.width_px) + 1) *
               static_cast<std::size_t>(std::ceil(options.height_px) + 1));
}

void Trace::Add(Pixel pixel) {
  const bool gap = !std::isfinite(pixel.x) || !std::isfinite(pixel.y);
  if (options_.style == Style::kDots) {
    if (!gap) AddDot(pixel);
    return;
  }
  if (gap) {
    EmitRun();
    EndPiece();
    return;
  }
  if (!reduces_) {
    Emit(pixel);
    return;
  }
  // All points outside on one side form one column.
  const double column = std::clamp(std::floor(pixel.x), -1.0, std::ceil(options_.width_px));
  if (run_length_ > 0 && column != run_column_) EmitRun();
  run_column_ = column;
  const Kept kept{pixel, run_length_};
  if (run_length_ == 0) first_ = lowest_ = highest_ = kept;
  if (pixel.y > lowest_.pixel.y) lowest_ = kept;
  if (pixel.y < highest_.pixel.y) highest_ = kept;
  last_ = kept;
  ++run_length_;
}

void Trace::AddDot(Pixel pixel) {
  const double columns = std::ceil(options_.width_px) + 1;
  const double column = std::floor(pixel.x);
  const double row = std::floor(pixel.y);
  if (column < 0 || column >= columns || row < 0 || row > std::ceil(options_.height_px)) return;
  const auto cell = static_cast<std::size_t>(row * columns + column);
  if (dots_[cell]) return;
  dots_[cell] = true;
  fmt::format_to(std::back_inserter(path_), "M{:.2f},{:.2f}h0", Written(pixel.x), Written(pixel.y));
}

void Trace::EmitRun() {
  if (run_length_ == 0) return;
  const bool low_first = lowest_.index < highest_.index;
  const std::array<Kept, kPointsPerColumn> kept{first_, low_first ? lowest_ : highest_,
                                                low_first ? highest_ : lowest_, last_};
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (i == 0 || kept[i].index != kept[i - 1].index) Emit(kept[i].pixel);
  }
  run_length_ = 0;
}

void Trace::Emit(Pixel pixel) {
  const double x = Written(pixel.x);
  const double y = Written(pixel.y);
  const auto out = std::back_inserter(path_);
  if (piece_length_ == 0) {
    fmt::format_to(out, "M{:.2f},{:.2f}", x, y);
  } else if (options_.style == Style::kSteps) {
    fmt::format_to(out, "H{:.2f}V{:.2f}", x, y);
  } else {
    fmt::format_to(out, "L{:.2f},{:.2f}", x, y);
  }
  ++piece_length_;
}

void Trace::EndPiece() {
  if (piece_length_ == 1) path_ += "h0";
  piece_length_ = 0;
}

std::string Trace::Finish() {
  EmitRun();
  EndPiece();
  return std::move(path_);
}

}  // namespace focalfleet::report
