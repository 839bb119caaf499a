#include "daemon/campaign/diagnosis_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/campaign/cause_words.h"
#include "daemon/campaign/class_table.h"
#include "daemon/campaign/diagnosis_figures.h"
#include "daemon/campaign/verdict_sentence.h"
#include "daemon/report/page.h"
#include "sim/campaigns/diagnosis/decide/decide.h"
#include "sim/campaigns/diagnosis/design/next_moves.h"

namespace focalfleet {
namespace {

using report::Align;
using sim::Campaign;
using sim::Diagnosis;

constexpr std::size_t kWorstUnits = 10;

std::string PercentOf(double share) {
  return share < 0.001 ? "below 0.1 %" : fmt::format("{:.1f} %", 100 * share);
}

std::string UnitsOf(const sim::CauseFound& cause) {
  constexpr std::size_t kNamed = 12;
  if (cause.all_units) return "all";
  if (cause.units.size() <= kNamed) return fmt::format("{}", fmt::join(cause.units, ", "));
  return fmt::format("{} of them, as {}...", cause.units.size(),
                     fmt::join(cause.units.begin(), cause.units.begin() + 6, ", "));
}

/// How far the name is to be trusted: its probability, those of its rivals, and what is excluded.
std::string ReliabilityOf(const sim::CauseFound& cause) {
  const std::vector<double> posterior = sim::PosteriorOf(cause);
  if (cause.candidates.size() < 2) {
    const std::string alone = "no other cause of the library does this";
    return cause.doubt > 0
               ? alone + "; such names are right in " + PercentOf(posterior.front()) + " of cases"
               : alone;
  }
  std::string text = PercentOf(posterior.front());
  for (std::size_t k = 1; k < cause.candidates.size(); ++k)
    text += fmt::format("; {} {}", WordsFor(cause.candidates[k]).name, PercentOf(posterior[k]));
  return text;
}

report::Card CardOf(const sim::CauseFound& cause) {
  const bool of_axis = cause.axis == "theta" || cause.axis == "phi" || cause.axis == "both";
  report::Card card{
      .heading = std::string(WordsFor(cause.cause).name) + (cause.axis == "both" ? " of both axes"
                                                            : of_axis ? " of " + cause.axis
                                                                      : ""),
      .paragraphs = {cause.paragraph},
      .facts = {{"amplitude", fmt::format("{} {} (95 %: {} to {})", Significant(cause.amplitude, 3),
                                          cause.amplitude_unit, Significant(cause.ci95[0], 3),
                                          Significant(cause.ci95[1], 3))},
                {"at the fibre", Decimals(cause.size_um, 1) + " um rms"},
                {"units", UnitsOf(cause)},
                {"this name", ReliabilityOf(cause)}}};
  if (!cause.cannot_be.empty())
    card.facts.emplace_back("cannot be", fmt::format("{}", fmt::join(cause.cannot_be, ", ")));
  if (!cause.shape.empty()) card.facts.emplace_back("shape", cause.shape);
  if (cause.at_bound) card.facts.emplace_back("note", "as large as physics allows");
  card.facts.emplace_back("evidence", "2 d ln L = " + Decimals(2 * cause.delta_log_likelihood, 0));
  card.facts.emplace_back("in report.json", cause.cause + ", scope " + cause.scope);
  return card;
}

report::Card GainCard(const Diagnosis& diagnosis) {
  const sim::HeldOutGain& gain = diagnosis.gain;
  report::Card card{.heading = "Gain on moves that no fit has seen", .paragraphs = {}, .facts = {}};
  if (!std::isfinite(gain.rms_before_um) || !std::isfinite(gain.rms_after_um)) {
    card.paragraphs = {"No move could be held out."};
    return card;
  }
  const bool exchanged = std::ranges::any_of(diagnosis.causes, [](const sim::CauseFound& cause) {
    return cause.cause == "identity_swap";
  });
  card.paragraphs = {gain.held_out + ".",
                     exchanged ? "Before is static geometry with the exchanged names."
                               : "Before is static geometry alone."};
  const auto both = [](double before_um, double after_um) {
    return fmt::format("{} um before, {} um after", Decimals(before_um, 1), Decimals(after_um, 1));
  };
  card.facts = {{"rms", both(gain.rms_before_um, gain.rms_after_um)},
                {"median", both(gain.mad_before_um, gain.mad_after_um)},
                {"noise", Decimals(gain.noise_floor_um, 1) + " um rms"}};
  return card;
}

void AddCauses(const Diagnosis& diagnosis, report::Page* page) {
  page->Heading("Causes");
  if (diagnosis.causes.empty()) page->Paragraph("No misfit that chance does not explain.");
  std::vector<report::Card> cards;
  for (const sim::CauseFound& cause : diagnosis.causes) cards.push_back(CardOf(cause));
  cards.push_back(GainCard(diagnosis));
  page->Cards(cards);
}

void AddClasses(const Diagnosis& diagnosis, report::Page* page) {
  if (diagnosis.axes.empty()) return;
  page->Heading("Axes by class");
  page->Table(kClassColumns, ClassRows(diagnosis.axes),
              {Align::kLeft, Align::kRight, Align::kLeft});
}

void AddWorstUnits(const Campaign& campaign, const Diagnosis& diagnosis,
                   const sim::UnitResiduals& units, report::Page* page) {
  std::vector<std::size_t> order;
  for (std::size_t u = 0; u < units.after_um.size(); ++u)
    if (std::isfinite(units.after_um[u])) order.push_back(u);
  const std::size_t shown = std::min(kWorstUnits, order.size());
  std::ranges::partial_sort(
      order, order.begin() + static_cast<std::ptrdiff_t>(shown),
      [&](std::size_t a, std::size_t b) { return units.after_um[a] > units.after_um[b]; });
  std::vector<std::vector<std::string>> rows;
  for (std::size_t k = 0; k < shown; ++k) {
    const std::uint32_t id = campaign.units[order[k]].id;
    std::string classes[2];
    for (const sim::AxisReport& axis : diagnosis.axes)
      if (axis.unit_id == id) classes[axis.axis] = sim::Name(axis.is);
    rows.push_back({std::to_string(id), Decimals(units.before_um[order[k]], 1),
                    Decimals(units.after_um[order[k]], 1), classes[0], classes[1]});
  }
  page->Heading("Units farthest from the model");
  page->Table({"unit", "before (um rms)", "after (um rms)", "theta", "phi"}, rows,
              {Align::kRight, Align::kRight, Align::kRight});
}

void AddResiduals(const Campaign& campaign, const Diagnosis& diagnosis, report::Page* page) {
  const DiagnosisFigures figures(campaign, diagnosis);
  if (figures.empty()) return;
  page->Heading("Where on the plate");
  page->Figures(figures.Maps());
  page->Hint(
      "Before is static geometry alone, after is the extended model. Amplitudes are sizes; a "
      "hollow "
      "unit does not have the effect.");
  page->Figures(figures.Arrows());
  page->Hint(
      "Arrows go from the predicted place to the measured one, in the move whose errors were "
      "largest.");
  for (const std::size_t axis : {sim::kTheta, sim::kPhi}) {
    page->Heading(axis == sim::kTheta ? "Errors of theta" : "Errors of phi");
    page->Figures(figures.Against(axis));
    page->Plot(figures.Spectrum(axis));
  }
  page->Hint(
      "Signed, measured less predicted, where the pose of the arms separates the two axes. Lines "
      "are "
      "medians, the clearest structure first; the outermost hundredths of the errors may be beyond "
      "the axes. A spectrum is the root mean square over units, each with its own phase.");
  AddWorstUnits(campaign, diagnosis, figures.units(), page);
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
  const VerdictText verdict = TextOf(diagnosis);
  page.Wide();
  for (const std::string& line : verdict.lines) page.Lead(line);
  if (!verdict.numbers.empty()) page.Paragraph(verdict.numbers);
  page.Hint(fmt::format("{} rows of {} units, {} moves; SHA-256 of the tables {}.", diagnosis.rows,
                        diagnosis.units, diagnosis.moves, names.sha256));
  for (const std::string& remark : diagnosis.remarks) page.Paragraph("Note: " + remark + ".");
  if (diagnosis.verdict == sim::Verdict::kInsufficient) return page.Html();
  AddCauses(diagnosis, &page);
  AddClasses(diagnosis, &page);
  AddResiduals(campaign, diagnosis, &page);
  AddRest(diagnosis, &page);
  return page.Html();
}

}  // namespace focalfleet
