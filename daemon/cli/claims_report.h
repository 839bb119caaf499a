// Claims of a paper as JSON, as lines and as a page; reproduce and hall reproduce share it.
#pragma once

#include <string>
#include <vector>

#include "daemon/cli/context.h"
#include "daemon/report/page.h"
#include "sim/drive/reproduction/claim.h"

namespace focalfleet::cli {

/// One number stands alone, more are a list; what is not finite is null.
Json ClaimsJson(const std::vector<sim::Claim>& claims);

void AddStatusTable(const std::vector<sim::Claim>& claims, report::Page* page);
void AddClaimTable(const std::vector<sim::Claim>& claims, report::Page* page);

/// Writes claims.json and report.html into a folder that is made if missing, and tells: with --json
/// the claims, otherwise a table and how many have which status.
ExitCode DeliverClaims(const Context& context, const std::vector<sim::Claim>& claims,
                       const std::string& html, const std::string& out);

/// Before the work: the folder can be made.
Status MakeClaimsFolder(const std::string& out);

}  // namespace focalfleet::cli
