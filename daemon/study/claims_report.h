// These functions write the claims of a paper as JSON, as lines and as a page. The commands
// reproduce and hall reproduce share them.
#pragma once

#include <string>
#include <vector>

#include "daemon/cli/context.h"
#include "daemon/report/page.h"
#include "sim/drive/reproduction/claim.h"

namespace focalfleet::cli {

/// The claims as JSON. A single number stands alone, more are a list; a number that is not finite
/// is null.
Json ClaimsJson(const std::vector<sim::Claim>& claims);

void AddStatusTable(const std::vector<sim::Claim>& claims, report::Page* page);
void AddClaimTable(const std::vector<sim::Claim>& claims, report::Page* page);

/// Writes claims.json and report.html into a folder, which is made if missing, and prints a
/// summary. With --json the summary is the claims, otherwise a table and the number of claims of
/// each status.
ExitCode DeliverClaims(const Context& context, const std::vector<sim::Claim>& claims,
                       const std::string& html, const std::string& out);

/// Makes the folder before the work begins, so that a failure is found early.
Status MakeClaimsFolder(const std::string& out);

}  // namespace focalfleet::cli
