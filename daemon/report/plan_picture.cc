#include "daemon/report/plan_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/report/escape.h"
#include "fleet/files/plan_file.h"
#include "fleet/kinematics.h"

namespace focalfleet::report {
namespace {

constexpr double kStandS = 1.5;       // the picture stands so long before and after the motion
constexpr double kWidthPixels = 640;  // of the whole picture

/// The corners of what the units reach, in mm.
struct Extent {
  double left = 0;
  double right = 0;
  double bottom = 0;
  double top = 0;
};

Extent ExtentOf(const Layout& layout) {
  Extent extent{1e9, -1e9, 1e9, -1e9};
  for (const Unit& unit : layout.units()) {
    extent.left = std::min(extent.left, unit.base_fp.x_mm - unit.reach_mm());
    extent.right = std::max(extent.right, unit.base_fp.x_mm + unit.reach_mm());
    extent.bottom = std::min(extent.bottom, unit.base_fp.y_mm - unit.reach_mm());
    extent.top = std::max(extent.top, unit.base_fp.y_mm + unit.reach_mm());
  }
  return extent;
}

class Picture {
 public:
  Picture(const PlanScene& scene, double speed)
      : scene_(scene),
        speed_(speed),
        rows_(RowsOf(*scene.plan, *scene.layout, scene.drives, scene.motor)) {
    for (const PlanRow& row : rows_) last_s_ = std::max(last_s_, row.t1_s);
    lasts_s_ = 2 * kStandS + last_s_ / speed_;
  }

  std::string Draw() {
    Open();
    for (const Obstacle& obstacle : scene_.layout->obstacles())
      Put("<circle class=\"o\" cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"{:.2f}\"/>\n",
          obstacle.centre_fp.x_mm, obstacle.centre_fp.y_mm, obstacle.radius_mm);
    for (std::uint32_t i = 0; i < scene_.layout->size(); ++i) DrawTarget(i);
    for (std::uint32_t i = 0; i < scene_.layout->size(); ++i) DrawArm(i);
    svg_ += "</g>\n</svg>\n";
    return std::move(svg_);
  }

 private:
  template <class... Arguments>
  void Put(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::format_to(std::back_inserter(svg_), format, std::forward<Arguments>(arguments)...);
  }

  void Open() {
    const Extent extent = ExtentOf(*scene_.layout);
    const double width_mm = extent.right - extent.left;
    const double height_mm = extent.top - extent.bottom;
    Put("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{:.1f} {:.1f} {:.1f} {:.1f}\" "
        "width=\"{:.0f}\" height=\"{:.0f}\" role=\"img\">\n",
        extent.left, -extent.top, width_mm, height_mm, kWidthPixels,
        kWidthPixels * height_mm / width_mm);
    Put("<title>{}</title>\n", EscapeMarkup(scene_.title));
    // The y axis of the plate points up, that of SVG down.
    svg_ +=
        "<style>line{stroke:#0072b2;stroke-width:1.3;stroke-linecap:round}"
        "line.p{stroke:#56b4e9}circle.f{fill:#e69f00}circle.t{fill:none;stroke:#009e73;"
        "stroke-width:.5}circle.o{fill:#999}</style>\n<g transform=\"scale(1,-1)\">\n";
  }

  void DrawTarget(std::uint32_t i) {
    const std::optional<Pose>& target = scene_.targets[i];
    if (!target) return;
    const PointFp at = FibreAt(scene_.layout->unit({i}), scene_.drives[i], *target);
    Put("<circle class=\"t\" cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"1.4\"/>\n", at.x_mm, at.y_mm);
  }

  void DrawArm(std::uint32_t i) {
    const std::optional<Pose>& start = scene_.start[i];
    if (!start) return;
    const Unit& unit = scene_.layout->unit({i});
    const AxisAngles angles = AnglesOf(unit, scene_.drives[i], *start);
    Put("<g transform=\"translate({:.2f},{:.2f})\">", unit.base_fp.x_mm, unit.base_fp.y_mm);
    OpenAxis(i, focalfleet::Axis::kTheta, angles.theta_deg, unit.theta().zero_deg);
    Put("<line x2=\"{0:.2f}\"/><g transform=\"translate({0:.2f})\">", unit.theta().arm_mm);
    OpenAxis(i, focalfleet::Axis::kPhi, angles.phi_deg, unit.phi().zero_deg);
    Put("<line class=\"p\" x2=\"{0:.2f}\"/><circle class=\"f\" cx=\"{0:.2f}\" r=\"1\"/>",
        unit.phi().arm_mm);
    svg_ += "</g></g></g></g>\n";
  }

  /// Opens the group of an axis, which turns as the axis does by its rows.
  void OpenAxis(std::uint32_t i, focalfleet::Axis axis, double start_deg, double zero_deg) {
    Put("<g transform=\"rotate({:.2f})\">", start_deg + zero_deg);
    std::string times = "0";
    std::string values = fmt::format("{:.2f}", start_deg + zero_deg);
    const auto add = [&](double t_s, double angle_deg) {
      times += fmt::format(";{:.4f}", (kStandS + t_s / speed_) / lasts_s_);
      values += fmt::format(";{:.2f}", angle_deg + zero_deg);
    };
    double at_deg = start_deg;
    bool moves = false;
    for (; next_row_ < rows_.size() && rows_[next_row_].unit == scene_.layout->unit({i}).id &&
           rows_[next_row_].axis == axis;
         ++next_row_) {
      add(rows_[next_row_].t0_s, at_deg);
      at_deg = rows_[next_row_].to_deg;
      add(rows_[next_row_].t1_s, at_deg);
      moves = true;
    }
    if (!moves) return;
    times += ";1";
    values += fmt::format(";{:.2f}", at_deg + zero_deg);
    Put("<animateTransform attributeName=\"transform\" type=\"rotate\" dur=\"{:.2f}s\" "
        "repeatCount=\"indefinite\" keyTimes=\"{}\" values=\"{}\"/>",
        lasts_s_, times, values);
  }

  const PlanScene& scene_;
  double speed_;
  std::vector<PlanRow> rows_;  // by unit, then axis, then time
  std::size_t next_row_ = 0;
  double last_s_ = 0;
  double lasts_s_ = 0;
  std::string svg_;
};

}  // namespace

std::string PlanPicture(const PlanScene& scene, double speed) {
  return Picture(scene, speed).Draw();
}

}  // namespace focalfleet::report
