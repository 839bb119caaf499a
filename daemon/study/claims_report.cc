#include "daemon/study/claims_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"

namespace focalfleet::cli {
namespace {

using sim::Claim;
using sim::ClaimStatus;

constexpr ClaimStatus kStatuses[] = {ClaimStatus::kReproduced, ClaimStatus::kOrdering,
                                     ClaimStatus::kFitted, ClaimStatus::kDisagrees,
                                     ClaimStatus::kNotTestable};

// A number that is not finite becomes null, as JSON has no other form for it.
Json NumbersJson(const std::vector<double>& numbers) {
  const auto one = [](double number) {
    return std::isfinite(number) ? Json(number) : Json(nullptr);
  };
  if (numbers.empty()) return nullptr;
  if (numbers.size() == 1) return one(numbers.front());
  Json list = Json::array();
  for (const double number : numbers) list.push_back(one(number));
  return list;
}

std::string Text(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers)
    text += fmt::format("{}{:.5g}", text.empty() ? "" : ", ", number);
  return text;
}

}  // namespace

Json ClaimsJson(const std::vector<Claim>& claims) {
  Json list = Json::array();
  for (const Claim& claim : claims)
    list.push_back({{"id", claim.id},
                    {"text", claim.text},
                    {"paper", NumbersJson(claim.paper)},
                    {"simulated", NumbersJson(claim.simulated)},
                    {"unit", claim.unit},
                    {"conditions", claim.conditions},
                    {"status", Name(claim.status)},
                    {"reason", claim.reason}});
  return list;
}

void AddStatusTable(const std::vector<Claim>& claims, report::Page* page) {
  std::vector<std::vector<std::string>> counts;
  for (const ClaimStatus status : kStatuses)
    counts.push_back({Name(status), std::to_string(std::count_if(claims.begin(), claims.end(),
                                                                 [&](const Claim& claim) {
                                                                   return claim.status == status;
                                                                 }))});
  page->Table({"status", "claims"}, counts, {report::Align::kLeft, report::Align::kRight});
}

void AddClaimTable(const std::vector<Claim>& claims, report::Page* page) {
  page->Heading("Claims");
  std::vector<std::vector<std::string>> rows;
  for (const Claim& claim : claims)
    rows.push_back(
        {claim.text, Text(claim.paper), Text(claim.simulated), claim.unit, Name(claim.status),
         claim.reason.empty() ? claim.conditions : claim.conditions + ". " + claim.reason});
  page->Table({"claim", "paper", "simulated", "unit", "status", "conditions and reason"}, rows);
}

Status MakeClaimsFolder(const std::string& out) {
  std::error_code failed;
  std::filesystem::create_directories(out, failed);
  if (failed) return Fail(ErrorCode::kUnavailable, fmt::format("{}: {}", out, failed.message()));
  return {};
}

ExitCode DeliverClaims(const Context& context, const std::vector<Claim>& claims,
                       const std::string& html, const std::string& out) {
  const Json list = ClaimsJson(claims);
  const std::filesystem::path folder(out);
  const std::string claims_path = folder / "claims.json";
  const std::string page_path = folder / "report.html";
  for (const auto& [path, text] :
       {std::pair(claims_path, list.dump(2) + "\n"), std::pair(page_path, html)})
    if (const auto written = WriteFileAtomically(path, text); !written)
      return Report(context, written.error());

  std::map<std::string, int> counts;
  for (const Claim& claim : claims) ++counts[Name(claim.status)];
  if (context.json) PrintJson({{"claims", list}, {"statuses", counts}, {"out", out}});
  std::vector<std::vector<std::string>> rows = {{"claim", "status", "paper", "simulated", "unit"}};
  for (const Claim& claim : claims)
    rows.push_back(
        {claim.id, Name(claim.status), Text(claim.paper), Text(claim.simulated), claim.unit});
  Say(context, AlignColumns(rows));
  std::string summary;
  for (const ClaimStatus status : kStatuses)
    summary +=
        fmt::format("{}{} {}", summary.empty() ? "" : ", ", counts[Name(status)], Name(status));
  Say(context, fmt::format("{}: {}", page_path, summary));
  return ExitCode::kOk;
}

}  // namespace focalfleet::cli
