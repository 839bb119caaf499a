#define TOML_EXCEPTIONS 0
#include "daemon/campaign/model_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/check/geometry_check.h"
#include "sim/campaigns/effects/empirical.h"
#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/planting/planted.h"

namespace focalfleet {
namespace {

class ModelReader {
 public:
  ModelReader(const std::string& file, const std::vector<sim::CampaignUnit>& units) : file_(file) {
    model_.units = units;
    read_.left.resize(units.size());
    for (std::size_t u = 0; u < units.size(); ++u) index_[units[u].id] = u;
  }

  Result<ModelFile> Read(const toml::table& table) {
    constexpr double kNotSaid = std::numeric_limits<double>::quiet_NaN();
    model_.name = table["name"].value_or(std::string("unnamed"));
    read_.campaign = table["campaign"].value_or(std::string());
    read_.campaign_sha256 = table["campaign_sha256"].value_or(std::string());
    read_.verdict = table["verdict"].value_or(std::string());
    read_.rms_before_um = table["rms_before_um"].value_or(kNotSaid);
    read_.rms_after_um = table["rms_after_um"].value_or(kNotSaid);
    if (const toml::array* units = table["unit"].as_array())
      for (const toml::node& node : *units) {
        const toml::table* unit = node.as_table();
        if (unit == nullptr) return Wrong(node, "[[unit]] is not a table");
        FOCALFLEET_TRY(ReadUnit(*unit));
      }
    if (const toml::array* effects = table["effect"].as_array())
      for (const toml::node& node : *effects) {
        const toml::table* effect = node.as_table();
        if (effect == nullptr) return Wrong(node, "[[effect]] is not a table");
        FOCALFLEET_TRY(ReadEffect(*effect));
      }
    read_.model = std::move(model_);
    return std::move(read_);
  }

 private:
  [[nodiscard]] tl::unexpected<Error> Wrong(const toml::node& node, const std::string& why) const {
    return Fail(ErrorCode::kInvalid,
                file_ + ":" + std::to_string(node.source().begin.line) + ": " + why);
  }

  Result<double> Number(const toml::table& table, std::string_view key) const {
    const std::optional<double> value = table[key].value<double>();
    if (!value || !std::isfinite(*value))
      return Wrong(table, std::string(key) + " is missing or not a finite number");
    return *value;
  }

  Result<std::vector<double>> Numbers(const toml::table& table, std::string_view key) const {
    const toml::array* array = table[key].as_array();
    if (array == nullptr) return Wrong(table, std::string(key) + " is missing or not a list");
    std::vector<double> values;
    for (const toml::node& node : *array) {
      const std::optional<double> value = node.value<double>();
      if (!value) return Wrong(node, std::string(key) + ": not a number");
      values.push_back(*value);
    }
    return values;
  }

  Result<std::uint32_t> UnitNumber(const toml::node& node, double id) const {
    if (!(id >= 0 && id <= UINT32_MAX) || id != std::floor(id))
      return Wrong(node, "a unit's number is not whole or too large");
    return static_cast<std::uint32_t>(id);
  }

  static std::vector<std::string> Words(const toml::table& table, std::string_view key) {
    std::vector<std::string> words;
    if (const toml::array* array = table[key].as_array())
      for (const toml::node& node : *array) words.push_back(node.value_or(std::string()));
    return words;
  }

  Status ReadUnit(const toml::table& table) {
    FOCALFLEET_TRY_ASSIGN(const double id, Number(table, "unit_id"));
    FOCALFLEET_TRY_ASSIGN(const std::uint32_t unit_id, UnitNumber(table, id));
    const auto at = index_.find(unit_id);
    if (at == index_.end()) return {};
    sim::CampaignUnit& unit = model_.units[at->second];
    const sim::CampaignUnit described = unit;
    unit.serial = 0;
    if (table.contains("serial")) {
      FOCALFLEET_TRY_ASSIGN(const double serial, Number(table, "serial"));
      if (!(serial >= 1 && serial <= UINT32_MAX) || serial != std::floor(serial))
        return Wrong(table, "serial is no serial number (1..4294967295)");
      unit.serial = static_cast<std::uint32_t>(serial);
    }
    FOCALFLEET_TRY_ASSIGN(unit.base_x_mm, Number(table, "base_x_mm"));
    FOCALFLEET_TRY_ASSIGN(unit.base_y_mm, Number(table, "base_y_mm"));
    FOCALFLEET_TRY_ASSIGN(unit.arm_mm[0], Number(table, "arm_theta_mm"));
    FOCALFLEET_TRY_ASSIGN(unit.arm_mm[1], Number(table, "arm_phi_mm"));
    FOCALFLEET_TRY_ASSIGN(unit.zero_deg[0], Number(table, "theta_zero_deg"));
    FOCALFLEET_TRY_ASSIGN(unit.zero_deg[1], Number(table, "phi_zero_deg"));
    if (!(unit.arm_mm[0] > 0) || !(unit.arm_mm[1] > 0))
      return Wrong(table, "an arm is not above 0");
    const sim::GeometryCheck check = sim::CheckGeometry(described, unit);
    const std::string name = "unit " + std::to_string(unit.id);
    if (!check.base)
      return Wrong(table, name + " has its base more than 10 mm from where it is described");
    if (!check.arms)
      return Wrong(table, name + " has an arm that differs by more than half from its description");
    ++read_.units_known;
    return ReadLeft(table, at->second);
  }

  Status ReadLeft(const toml::table& table, std::size_t unit) {
    if (!table.contains("left_theta_deg")) return {};
    sim::UnitLeft left{.moved = true};
    FOCALFLEET_TRY_ASSIGN(left.pose_deg[0], Number(table, "left_theta_deg"));
    FOCALFLEET_TRY_ASSIGN(left.pose_deg[1], Number(table, "left_phi_deg"));
    FOCALFLEET_TRY_ASSIGN(left.added_deg[0], Number(table, "added_theta_deg"));
    FOCALFLEET_TRY_ASSIGN(left.added_deg[1], Number(table, "added_phi_deg"));
    read_.left[unit] = left;
    return {};
  }

  static bool IsPossible(const sim::Effect& effect, double amplitude) {
    constexpr double kDigits = 1e-6;  // relative rounding of numbers in a file
    const auto [low, high] = sim::RangeOfAmplitude(effect);
    return amplitude >= low - kDigits * std::abs(low) &&
           amplitude <= high + kDigits * std::abs(high);
  }

  // True where the library's effect offers this form. An effect lists forms by the columns, units
  // and moves that there are; this test campaign has all of them.
  static bool IsOfTheLibrary(const sim::Template& form) {
    static const Result<sim::Campaign> whole = sim::PlantCampaign({});
    static const sim::CampaignFacts facts = sim::MakeFacts(whole.value());
    return sim::IsOffered(form, facts);
  }

  Result<sim::Template> ReadForm(const toml::table& table) const {
    const std::string cause = table["cause"].value_or(std::string());
    const sim::Effect* empirical = sim::FindEmpirical(cause);
    const sim::Effect* effect = empirical != nullptr ? empirical : sim::FindEffect(cause);
    if (effect == nullptr) return Wrong(table, "there is no effect '" + cause + "'");
    sim::Template form;
    form.effect = effect;
    const std::string axis = table["axis"].value_or(std::string("none"));
    for (const sim::EffectAxis candidate :
         {sim::EffectAxis::kTheta, sim::EffectAxis::kPhi, sim::EffectAxis::kBoth})
      if (sim::Name(candidate) == axis) form.axis = candidate;
    FOCALFLEET_TRY_ASSIGN(const double number, Number(table, "form"));
    FOCALFLEET_TRY_ASSIGN(form.shape, Number(table, "shape"));
    FOCALFLEET_TRY_ASSIGN(const double memory, Number(table, "memory"));
    FOCALFLEET_TRY_ASSIGN(const double columns, Number(table, "columns"));
    if (memory < 0 || memory > 2) return Wrong(table, "memory is not 0, 1 or 2");
    if (columns < 1 || columns > static_cast<double>(sim::kColumnsMax))
      return Wrong(table, "columns is out of bounds");
    form.form = static_cast<int>(number);
    form.memory = static_cast<sim::Memory>(static_cast<int>(memory));
    form.columns = static_cast<std::size_t>(columns);
    form.label = table["shape_text"].value_or(std::string());
    if (empirical != nullptr) {
      FOCALFLEET_TRY(ReadEmpirical(table, &form));
    } else if (!IsOfTheLibrary(form)) {
      return Wrong(table, "the effect has no such axis, form, memory and columns");
    }
    return form;
  }

  Status ReadEmpirical(const toml::table& table, sim::Template* form) const {
    form->covariate = table["covariate"].value_or(std::string());
    if (form->covariate.empty()) return Wrong(table, "covariate is missing");
    if (form->effect == &sim::EmpiricalRipple()) {
      const bool of_one =
          form->axis == sim::EffectAxis::kTheta || form->axis == sim::EffectAxis::kPhi;
      if (!of_one || form->columns != 2 || !(form->shape > 0))
        return Wrong(table, "a ripple is of theta or phi, of an order above 0, in 2 columns");
      return {};
    }
    const std::string name = table["channel"].value_or(std::string());
    const auto channel = sim::ChannelNamed(name);
    if (!channel) return Wrong(table, "there is no channel '" + name + "'");
    form->form = *channel;
    if (form->columns > sim::kEmpiricalCosines)
      return Wrong(table,
                   "a curve has at most " + std::to_string(sim::kEmpiricalCosines) + " columns");
    FOCALFLEET_TRY_ASSIGN(const std::vector<double> values, Numbers(table, "knot_values"));
    FOCALFLEET_TRY_ASSIGN(const std::vector<double> ranks, Numbers(table, "knot_ranks"));
    if (values.empty() || values.size() != ranks.size())
      return Wrong(table, "knot_values and knot_ranks are not of one length");
    for (std::size_t k = 0; k < values.size(); ++k) {
      const bool ascends = k == 0 || values[k] > values[k - 1];
      if (!std::isfinite(values[k]) || !ascends || !(ranks[k] >= 0 && ranks[k] <= 1))
        return Wrong(table, "knots: values that ascend and ranks from 0 to 1 are expected");
      form->knots.push_back({values[k], ranks[k]});
    }
    return {};
  }

  static sim::Sharing SharingOf(const toml::table& table) {
    const std::string word = table["shared_by"].value_or(std::string());
    for (const sim::Sharing sharing :
         {sim::Sharing::kRail, sim::Sharing::kBus, sim::Sharing::kFleet})
      if (sim::Name(sharing) == word) return sharing;
    return sim::Sharing::kUnit;
  }

  using GroupNumbers = std::map<std::vector<double>, std::uint32_t>;

  /// The file repeats a shared amplitude for each unit. Units with equal amplitudes form one group.
  static void AddUnit(std::size_t unit, std::span<const double> amplitude,
                      std::span<const double> sigma, GroupNumbers* groups, sim::ModelTerm* term) {
    std::vector<double> key(amplitude.begin(), amplitude.end());
    key.insert(key.end(), sigma.begin(), sigma.end());
    if (term->sharing == sim::Sharing::kUnit) key = {static_cast<double>(unit)};
    const auto [group, fresh] =
        groups->emplace(std::move(key), static_cast<std::uint32_t>(groups->size()));
    term->group_of_unit[unit] = group->second;
    if (!fresh) return;
    term->amplitude.insert(term->amplitude.end(), amplitude.begin(), amplitude.end());
    term->sigma.insert(term->sigma.end(), sigma.begin(), sigma.end());
  }

  /// Reads the shapes where each unit has a shape of its own.
  Status ReadShapes(const toml::table& table, const std::vector<double>& ids,
                    sim::Template* form) const {
    const bool found = form->form == form->effect->form_of_found_shapes;
    if (!table.contains("shapes"))
      return found ? Wrong(table, "shapes: this form has one for each unit") : Status();
    if (!form->effect->own_shape && !found)
      return Wrong(table, "shapes: units have none of their own of this effect");
    FOCALFLEET_TRY_ASSIGN(const std::vector<double> shapes, Numbers(table, "shapes"));
    if (shapes.size() != ids.size())
      return Wrong(table, "shapes: " + std::to_string(shapes.size()) + " numbers for " +
                              std::to_string(ids.size()) + " units");
    for (std::size_t k = 0; k < ids.size(); ++k) {
      if (!std::isfinite(shapes[k])) return Wrong(table, "shapes: one is no number");
      FOCALFLEET_TRY_ASSIGN(const std::uint32_t unit_id, UnitNumber(table, ids[k]));
      form->shape_of_unit[unit_id] = shapes[k];
    }
    return {};
  }

  Status ReadEffect(const toml::table& table) {
    sim::ModelTerm term;
    FOCALFLEET_TRY_ASSIGN(term.form, ReadForm(table));
    FOCALFLEET_TRY_ASSIGN(const std::vector<double> ids, Numbers(table, "units"));
    FOCALFLEET_TRY_ASSIGN(const std::vector<double> amplitude, Numbers(table, "amplitude"));
    const std::size_t c = term.form.columns;
    if (amplitude.size() != ids.size() * c)
      return Wrong(table, "amplitude: " + std::to_string(amplitude.size()) + " numbers for " +
                              std::to_string(ids.size()) + " units");
    std::vector<double> sigma(amplitude.size(), 0);
    if (table.contains("sigma")) {
      FOCALFLEET_TRY_ASSIGN(sigma, Numbers(table, "sigma"));
      if (sigma.size() != amplitude.size()) return Wrong(table, "sigma: not one an amplitude");
      for (double& one : sigma)
        if (!std::isfinite(one)) one = 0;  // not known
    }
    FOCALFLEET_TRY(ReadShapes(table, ids, &term.form));
    term.sharing = SharingOf(table);
    term.group_of_unit.assign(model_.units.size(), sim::kNoGroup);
    GroupNumbers groups;
    for (std::size_t k = 0; k < ids.size(); ++k) {
      FOCALFLEET_TRY_ASSIGN(const std::uint32_t unit_id, UnitNumber(table, ids[k]));
      const auto at = index_.find(unit_id);
      if (at == index_.end()) continue;
      const std::span<const double> own = std::span(amplitude).subspan(k * c, c);
      for (const double one : own)
        if (!IsPossible(*term.form.effect, one))
          return Wrong(table, "unit " + std::to_string(at->first) + ": an amplitude of " +
                                  std::to_string(one) + " is none that " +
                                  std::string(term.form.effect->cause) + " can have");
      AddUnit(at->second, own, std::span<const double>(sigma).subspan(k * c, c), &groups, &term);
    }
    model_.terms.push_back(std::move(term));
    read_.candidates.push_back(Words(table, "candidates"));
    return {};
  }

  const std::string& file_;
  ModelFile read_;
  sim::CampaignModel model_;
  std::map<std::uint32_t, std::size_t> index_;
};

}  // namespace

Result<ModelFile> ReadModelFile(std::string_view text, const std::string& file,
                                const std::vector<sim::CampaignUnit>& units) {
  const toml::parse_result parsed = toml::parse(text, file);
  if (!parsed)
    return Fail(ErrorCode::kInvalid, file + ":" +
                                         std::to_string(parsed.error().source().begin.line) + ": " +
                                         std::string(parsed.error().description()));
  return ModelReader(file, units).Read(parsed.table());
}

}  // namespace focalfleet
