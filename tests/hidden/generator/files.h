// The files of a planted campaign are those of every campaign, moves.csv and units.csv, without a
// trace of what was planted.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "tests/hidden/generator/measure.h"

namespace focalfleet::hidden {

struct CampaignText {
  std::string moves;  // moves.csv
  std::string units;  // units.csv
};

CampaignText Write(const Spec& spec, const Campaign& campaign, const Measurement& measured);

/// The optional columns that this campaign has.
std::vector<std::string> OptionalColumns(const Spec& spec);

/// Writes the text to the file.
/// Errors: kUnavailable with the path.
Status Save(const std::string& path, const std::string& text);

}  // namespace focalfleet::hidden
