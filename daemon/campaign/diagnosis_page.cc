#include "daemon/campaign/diagnosis_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/report/page.h"
#include "sim/campaigns/diagnosis/next_moves.h"

namespace focalfleet {
namespace {

using report::Align;
using sim::Campaign;
using sim::Diagnosis;

constexpr std::size_t kPointsMax = 4000;
constexpr std::size_t kCovariatesMax = 6;

void AddCauses(const Diagnosis& diagnosis, report::Page* page) {
  page->Heading("Causes");
  if (diagnosis.causes.empty()) {
    page->Paragraph("No misfit that chance does not explain.");
    return;
  }
  std::vector<std::vector<std::string>> rows;
  for (const sim::CauseFound& cause : diagnosis.causes) {
    std::string rivals;
    for (std::size_t k = 1; k < cause.candidates.size(); ++k)
      rivals += (rivals.empty() ? "" : ", ") + cause.candidates[k];
    rows.push_back({cause.cause, rivals.empty() ? "none" : rivals, cause.axis, cause.scope,
                    cause.all_units ? "all" : std::to_string(cause.units.size()),
                    fmt::format("{} ({} to {}) {}", Significant(cause.amplitude, 4),
                                Significant(cause.ci95[0], 4), Significant(cause.ci95[1], 4),
                                cause.amplitude_unit),
                    Decimals(cause.size_um, 2), Decimals(2 * cause.delta_log_likelihood, 0),
                    cause.shape});
  }
  page->Table({"cause", "cannot be told from", "axis", "scope", "units", "amplitude (95 %)",
               "rms at the fibre (um)", "2 d ln L", "shape"},
              rows,
              {Align::kLeft, Align::kLeft, Align::kLeft, Align::kLeft, Align::kRight, Align::kLeft,
               Align::kRight, Align::kRight, Align::kLeft});
  for (const sim::CauseFound& cause : diagnosis.causes)
    page->Paragraph(cause.cause + ": " + cause.paragraph);
}

void AddGain(const Diagnosis& diagnosis, report::Page* page) {
  const sim::HeldOutGain& gain = diagnosis.gain;
  page->Heading("Gain on moves that no fit has seen");
  const bool exchanged = std::ranges::any_of(diagnosis.causes, [](const sim::CauseFound& cause) {
    return cause.cause == "identity_swap";
  });
  if (!std::isfinite(gain.rms_before_um) || !std::isfinite(gain.rms_after_um)) {
    page->Paragraph("No move could be held out.");
    return;
  }
  page->Paragraph(gain.held_out + ".");
  page->Plot(report::DrawBars(
      {.title = "2-D residual",
       .categories = {"rms", "median"},
       .y = {.label = "residual", .unit = "um"},
       .groups = {{exchanged ? "static geometry, exchanged names" : "static geometry alone",
                   {gain.rms_before_um, gain.mad_before_um}},
                  {"extended model", {gain.rms_after_um, gain.mad_after_um}}},
       .horizontal = {{gain.noise_floor_um, "noise"}}}));
}

// A scatter plot of x against y, of at most kPointsMax rows.
void AddScatter(const std::vector<double>& x, const std::vector<double>& y, std::size_t stride,
                std::vector<double>* to_x, std::vector<double>* to_y) {
  for (std::size_t row = 0; row < x.size(); row += stride)
    if (std::isfinite(x[row]) && std::isfinite(y[row]))
      to_x->push_back(x[row]), to_y->push_back(y[row]);
}

std::vector<double> Lengths(const std::vector<double>& x, const std::vector<double>& y) {
  std::vector<double> lengths(x.size());
  for (std::size_t row = 0; row < x.size(); ++row) lengths[row] = std::hypot(x[row], y[row]);
  return lengths;
}

void AddAgainst(const std::string& name, const std::vector<double>& column,
                const std::vector<double>& before, const std::vector<double>& after,
                report::Page* page) {
  const std::size_t stride = std::max<std::size_t>(1, column.size() / kPointsMax);
  std::vector<double> bx, by, ax, ay;
  AddScatter(column, before, stride, &bx, &by);
  AddScatter(column, after, stride, &ax, &ay);
  if (bx.empty() ||
      *std::min_element(bx.begin(), bx.end()) == *std::max_element(bx.begin(), bx.end()))
    return;
  page->Plot(report::DrawLines(
      {.title = "residual against " + name,
       .x = {.label = name},
       .y = {.label = "residual", .unit = "um"},
       .series = {{.name = "before", .x = bx, .y = by, .style = report::Style::kDots},
                  {.name = "after", .x = ax, .y = ay, .style = report::Style::kDots}}}));
}

void AddResiduals(const Campaign& campaign, const Diagnosis& diagnosis, report::Page* page) {
  if (diagnosis.x_before_um.empty() || diagnosis.x_after_um.empty()) return;
  page->Heading("Residuals");
  const std::size_t stride = std::max<std::size_t>(1, campaign.rows() / kPointsMax);
  std::vector<double> bx, by, ax, ay;
  AddScatter(diagnosis.x_before_um, diagnosis.y_before_um, stride, &bx, &by);
  AddScatter(diagnosis.x_after_um, diagnosis.y_after_um, stride, &ax, &ay);
  page->Plot(report::DrawLines(
      {.title = "residual vectors",
       .x = {.label = "x", .unit = "um"},
       .y = {.label = "y", .unit = "um"},
       .series = {{.name = "before", .x = bx, .y = by, .style = report::Style::kDots},
                  {.name = "after", .x = ax, .y = ay, .style = report::Style::kDots}},
       .height_px = 480}));
  const std::vector<double> before = Lengths(diagnosis.x_before_um, diagnosis.y_before_um);
  const std::vector<double> after = Lengths(diagnosis.x_after_um, diagnosis.y_after_um);
  AddAgainst("theta_cmd_deg", campaign.cmd_deg[sim::kTheta], before, after, page);
  AddAgainst("phi_cmd_deg", campaign.cmd_deg[sim::kPhi], before, after, page);
  std::size_t shown = 0;
  for (const sim::Covariate& covariate : campaign.covariates)
    if (shown < kCovariatesMax && covariate.name != "sigma_um") {
      AddAgainst(covariate.name, covariate.values, before, after, page);
      ++shown;
    }
}

std::string PercentOf(double share) {
  return share < 0.001 ? "below 0.1 %" : fmt::format("{:.1f} %", 100 * share);
}

// The table of what further moves would decide, pair by pair.
void AddNextMoves(const sim::NextMoves& next, report::Page* page) {
  page->Heading("Moves to make next");
  if (next.prospects.empty() && next.inseparable.empty()) {
    page->Paragraph("Nothing is confusable: no further moves are needed to tell causes apart.");
    return;
  }
  page->Paragraph(next.moves.empty()
                      ? "No moves of the units tell these apart."
                      : fmt::format("next_moves.csv has {} moves; focalfleet campaign run makes "
                                    "them; it tells the conditions that they ask for, and "
                                    "leaves it to you to set them.",
                                    next.moves.size()));
  std::vector<std::vector<std::string>> rows;
  for (const sim::Prospect& one : next.prospects)
    rows.push_back({one.cause, one.rival, Decimals(one.d, 1), PercentOf(sim::ConfusionAt(one.d))});
  for (const auto& [cause, rival] : next.inseparable)
    rows.push_back({cause, rival, "-", "no move tells"});
  page->Table({"cause", "or", "set apart by (chi-square)", "still confused"}, rows,
              {Align::kLeft, Align::kLeft, Align::kRight, Align::kRight});
}

void AddRest(const Diagnosis& diagnosis, report::Page* page) {
  if (!diagnosis.unknown.empty()) {
    page->Heading("What no candidate explains");
    std::vector<std::vector<std::string>> rows;
    for (const sim::UnknownFound& found : diagnosis.unknown)
      rows.push_back({found.covariate, found.channel, Significant(found.p_value, 2),
                      Decimals(found.size_um, 2),
                      found.patched ? fmt::format("{}, {} um", found.patched->term,
                                                  Decimals(found.patched->size_um, 2))
                                    : "no"});
    page->Table({"against", "in", "p", "rms (um)", "patched"}, rows);
    page->Paragraph(
        "A patch is a smooth curve or a ripple that follows the data: it corrects, and explains "
        "nothing.");
  }
  AddNextMoves(diagnosis.next, page);
  if (!diagnosis.outliers.why.empty()) {
    page->Heading("Rows left out or far off");
    std::vector<std::vector<std::string>> rows;
    for (const auto& [why, count] : diagnosis.outliers.why)
      rows.push_back({why, std::to_string(count)});
    page->Table({"why", "rows"}, rows, {Align::kLeft, Align::kRight});
  }
  if (!diagnosis.outliers.units.empty())
    page->Paragraph(fmt::format("Stuck, or off by far more than others and by no cause: unit {}.",
                                fmt::join(diagnosis.outliers.units, ", ")));
  if (!diagnosis.not_testable.empty()) {
    page->Heading("What these data cannot test");
    std::vector<std::vector<std::string>> rows;
    for (const sim::NotTestable& cause : diagnosis.not_testable)
      rows.push_back({cause.cause, cause.why});
    page->Table({"cause", "why"}, rows);
  }
}

}  // namespace

std::string DiagnosisPage(const Campaign& campaign, const Diagnosis& diagnosis,
                          const ReportNames& names) {
  report::Page page("Diagnosis of " + names.campaign);
  page.Paragraph(VerdictSentence(diagnosis));
  page.Paragraph(fmt::format("{} rows of {} units, {} moves; SHA-256 of the tables {}.",
                             diagnosis.rows, diagnosis.units, diagnosis.moves, names.sha256));
  for (const std::string& remark : diagnosis.remarks) page.Paragraph("Note: " + remark + ".");
  if (diagnosis.verdict == sim::Verdict::kInsufficient) return page.Html();
  AddCauses(diagnosis, &page);
  AddGain(diagnosis, &page);
  AddResiduals(campaign, diagnosis, &page);
  AddRest(diagnosis, &page);
  return page.Html();
}

}  // namespace focalfleet
