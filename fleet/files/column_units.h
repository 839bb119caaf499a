// Units of columns. In this project a column's name ends in its unit (`x_mm`, `theta_deg`, `t_s`).
// Other writers declare a unit beside the name: ECSV in its header, FITS in TUNIT. Where the two
// differ, numbers are converted; a unit of another kind is refused when the column is read.
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace focalfleet {

/// value in the unit of the name = factor * value as it stands + offset.
struct UnitConversion {
  double factor = 1;
  double offset = 0;
  std::string problem;  // not empty: the declared unit cannot be converted
  [[nodiscard]] bool IsNeeded() const { return factor != 1 || offset != 0 || !problem.empty(); }
};

/// The conversion for a column with this name and declared unit. Names without a unit need none.
UnitConversion ConversionOf(std::string_view column, std::string_view declared);

/// The units in the header of an ECSV table, taken line by line.
class EcsvUnits {
 public:
  /// Takes one comment line without its `#`.
  void Take(std::string_view comment);
  /// The units by the columns' names, once the header has been taken.
  [[nodiscard]] std::map<std::string, std::string> Units();

 private:
  void EndItem();
  bool in_columns_ = false;
  std::string item_;  // of the list `datatype`, without line breaks
  std::map<std::string, std::string> units_;
};

}  // namespace focalfleet
