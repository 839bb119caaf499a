#include "daemon/camera/spots_fits.h"

#include <cmath>
#include <utility>

#include "daemon/files/fits_table.h"
#include "fleet/files/cell.h"
#include "fleet/files/csv.h"
#include "fleet/files/spots_file.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

Result<std::string> TextKey(const FitsTable& table, const std::string& path, const char* name) {
  const FitsKey* key = table.FindKey(name);
  if (key == nullptr) return Fail(ErrorCode::kInvalid, path + ": key " + name + " is missing");
  if (const auto* text = std::get_if<std::string>(&key->value)) return *text;
  if (const auto* whole = std::get_if<std::int64_t>(&key->value)) return std::to_string(*whole);
  return Fail(ErrorCode::kInvalid,
              path + ": key " + name + " is neither a text nor a whole number");
}

/// The numbers of a column of any numeric type; empty where the table has no such column.
/// Errors: kInvalid: the column holds text.
Result<std::vector<double>> Numbers(const FitsTable& table, const std::string& path,
                                    const char* name) {
  const FitsColumn* column = table.Find(name);
  if (column == nullptr) return std::vector<double>();
  if (const auto* numbers = std::get_if<std::vector<double>>(&column->values)) return *numbers;
  if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&column->values))
    return std::vector<double>(whole->begin(), whole->end());
  return Fail(ErrorCode::kInvalid, path + ": column " + name + " holds text");
}

Result<std::vector<std::uint32_t>> SpotIds(const FitsTable& table, const std::string& path) {
  FOCALFLEET_TRY_ASSIGN(const auto numbers, Numbers(table, path, "SPOT_ID"));
  std::vector<std::uint32_t> ids;
  ids.reserve(numbers.size());
  for (const double id : numbers) {
    if (!(id >= 0 && id <= UINT32_MAX && id == std::floor(id)))
      return Fail(ErrorCode::kInvalid,
                  path + ": row " + std::to_string(ids.size() + 1) + ": SPOT_ID " +
                      (std::isnan(id) ? "nan" : NumberText(id)) + " is no whole number from 0 to " +
                      std::to_string(UINT32_MAX));
    ids.push_back(static_cast<std::uint32_t>(id));
  }
  return ids;
}

}  // namespace

Result<Exposure> ParseSpotsFits(std::string bytes, const std::string& name,
                                const SensorLimits& sensor) {
  FOCALFLEET_TRY_ASSIGN(const FitsTable table,
                        ParseFitsTable(std::move(bytes), name,
                                       {.columns = {"SPOT_ID", "X_PX", "Y_PX", "FLUX"},
                                        .optional = {"FWHM_PX"},
                                        .rows_max = limits::kSpotsPerExposure}));
  Exposure exposure;
  FOCALFLEET_TRY_ASSIGN(exposure.id, TextKey(table, name, "EXPID"));
  if (const Status good = CheckExposureId(exposure.id); !good)
    return Fail(ErrorCode::kInvalid, name + ": EXPID: " + good.error().text);
  FOCALFLEET_TRY_ASSIGN(const std::string taken, TextKey(table, name, "DATE-OBS"));
  const auto at = UnixNsOf(taken);
  if (!at)
    return Fail(ErrorCode::kInvalid, name + ": DATE-OBS " + Quoted(taken) + " is no time in UTC");
  exposure.taken_unix_ns = *at;
  FOCALFLEET_TRY_ASSIGN(const auto ids, SpotIds(table, name));
  FOCALFLEET_TRY_ASSIGN(const auto x, Numbers(table, name, "X_PX"));
  FOCALFLEET_TRY_ASSIGN(const auto y, Numbers(table, name, "Y_PX"));
  FOCALFLEET_TRY_ASSIGN(const auto flux, Numbers(table, name, "FLUX"));
  FOCALFLEET_TRY_ASSIGN(auto fwhm, Numbers(table, name, "FWHM_PX"));
  fwhm.resize(ids.size(), 0);
  exposure.spots.reserve(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    // NaN means not measured, as an empty cell of spots.csv does.
    const double width_px = std::isnan(fwhm[i]) ? 0 : fwhm[i];
    exposure.spots.push_back({ids[i], x[i], y[i], flux[i], width_px});
  }
  if (const Status good = CheckSpots(exposure, sensor); !good)
    return Fail(good.error().code, name + ": " + good.error().text);
  return exposure;
}

Status WriteSpotsFits(const std::string& path, const Exposure& exposure) {
  std::vector<std::int64_t> ids;
  std::vector<double> x, y, flux, fwhm;
  for (const Spot& spot : exposure.spots) {
    ids.push_back(spot.id);
    x.push_back(spot.x_px);
    y.push_back(spot.y_px);
    flux.push_back(spot.flux);
    fwhm.push_back(spot.fwhm_px);
  }
  return WriteFitsTable(path, {.name = "SPOTS",
                               .keys = {{"EXPID", exposure.id, "the camera's name of the exposure"},
                                        {"DATE-OBS", UtcOf(exposure.taken_unix_ns), "UTC"}},
                               .columns = {{"SPOT_ID", "", std::move(ids)},
                                           {"X_PX", "pixel", std::move(x)},
                                           {"Y_PX", "pixel", std::move(y)},
                                           {"FLUX", "", std::move(flux)},
                                           {"FWHM_PX", "pixel", std::move(fwhm)}}});
}

}  // namespace focalfleet
