#include "daemon/camera/spots_fits.h"

#include "daemon/files/fits_table.h"
#include "fleet/files/spots_file.h"

namespace focalfleet {
namespace {

Result<std::string> TextKey(const FitsTable& table, const std::string& path, const char* name) {
  const FitsKey* key = table.FindKey(name);
  const auto* text = key == nullptr ? nullptr : std::get_if<std::string>(&key->value);
  if (text == nullptr || text->empty())
    return Fail(ErrorCode::kInvalid, path + ": key " + name + " is missing");
  return *text;
}

/// Numbers of a column, whatever it holds them as. Errors: kInvalid: it is missing, or text.
Result<std::vector<double>> Numbers(const FitsTable& table, const std::string& path,
                                    const char* name) {
  const FitsColumn* column = table.Find(name);
  if (column == nullptr)
    return Fail(ErrorCode::kInvalid, path + ": column " + name + " is missing");
  if (const auto* numbers = std::get_if<std::vector<double>>(&column->values)) return *numbers;
  if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&column->values))
    return std::vector<double>(whole->begin(), whole->end());
  return Fail(ErrorCode::kInvalid, path + ": column " + name + " holds text");
}

}  // namespace

Result<Exposure> ReadSpotsFits(const std::string& path, const SensorLimits& sensor) {
  FOCALFLEET_TRY_ASSIGN(const FitsTable table, ReadFitsTable(path));
  Exposure exposure;
  FOCALFLEET_TRY_ASSIGN(exposure.id, TextKey(table, path, "EXPID"));
  FOCALFLEET_TRY_ASSIGN(const std::string taken, TextKey(table, path, "DATE-OBS"));
  const auto at = UnixNsOf(taken);
  if (!at) return Fail(ErrorCode::kInvalid, path + ": DATE-OBS '" + taken + "' is no time in UTC");
  exposure.taken_unix_ns = *at;
  FOCALFLEET_TRY_ASSIGN(const auto x, Numbers(table, path, "X_PX"));
  FOCALFLEET_TRY_ASSIGN(const auto y, Numbers(table, path, "Y_PX"));
  FOCALFLEET_TRY_ASSIGN(const auto flux, Numbers(table, path, "FLUX"));
  const FitsColumn* ids = table.Find("SPOT_ID");
  const auto* numbers =
      ids == nullptr ? nullptr : std::get_if<std::vector<std::int64_t>>(&ids->values);
  if (numbers == nullptr)
    return Fail(ErrorCode::kInvalid, path + ": column SPOT_ID of whole numbers is missing");
  std::vector<double> fwhm(x.size(), 0);
  if (table.Find("FWHM_PX") != nullptr) {
    FOCALFLEET_TRY_ASSIGN(fwhm, Numbers(table, path, "FWHM_PX"));
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    const std::int64_t id = (*numbers)[i];
    if (id < 0 || id > UINT32_MAX)
      return Fail(ErrorCode::kInvalid, path + ": row " + std::to_string(i + 1) + ": SPOT_ID " +
                                           std::to_string(id) + " is out of range");
    exposure.spots.push_back({static_cast<std::uint32_t>(id), x[i], y[i], flux[i], fwhm[i]});
  }
  if (const Status good = CheckSpots(exposure, sensor); !good)
    return Fail(good.error().code, path + ": " + good.error().text);
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
