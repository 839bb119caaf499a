#include "daemon/hall/field_model_file.h"

#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

using sim::kRadPerDeg;

constexpr std::size_t kTermsMax = 4000;

// A text in TOML's quotes, which cannot hold control characters.
std::string Quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + "\"";
}

void Line(std::string* text, std::string_view key, double value) {
  *text += fmt::format("{} = {}\n", key, NumberText(value));
}

std::string FieldText(const sim::FieldParameters& field) {
  std::string text;
  if (const auto* harmonic = std::get_if<sim::HarmonicParameters>(&field)) {
    text += "kind = \"harmonic\"\n";
    Line(&text, "amplitude_T", harmonic->amplitude_T);
    Line(&text, "phase_deg", harmonic->phase_rad / kRadPerDeg);
    Line(&text, "sd_amplitude_T", harmonic->sd_amplitude_T);
    Line(&text, "sd_phase_deg", harmonic->sd_phase_rad / kRadPerDeg);
  } else if (const auto* surface = std::get_if<sim::SurfaceParameters>(&field)) {
    text += "kind = \"surface\"\n";
    Line(&text, "amplitude_T", surface->amplitude_T);
    Line(&text, "width_deg", surface->width_rad / kRadPerDeg);
    Line(&text, "phase_deg", surface->phase_rad / kRadPerDeg);
    Line(&text, "sd_amplitude_T", surface->sd_amplitude_T);
    Line(&text, "sd_width_deg", surface->sd_width_rad / kRadPerDeg);
    Line(&text, "sd_phase_deg", surface->sd_phase_rad / kRadPerDeg);
  } else {
    text += "kind = \"spherical\"\n# degree, order, cosine_T, sine_T, sd of both\nterms = [\n";
    for (const sim::SphericalTerm& term : std::get<std::vector<sim::SphericalTerm>>(field))
      text += fmt::format("  [{}, {}, {}, {}, {}, {}],\n", term.degree, term.order,
                          NumberText(term.cosine_T), NumberText(term.sine_T),
                          NumberText(term.sd_cosine_T), NumberText(term.sd_sine_T));
    text += "]\n";
  }
  return text;
}

class Reader {
 public:
  explicit Reader(std::string file) : file_(std::move(file)) {}

  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

  void Wrong(const toml::node& node, const std::string& what) {
    if (!error_)
      error_ = Error{ErrorCode::kInvalid,
                     fmt::format("{}:{}: {}", file_, node.source().begin.line, what)};
  }

  std::string Text(const toml::table& table, const char* key) {
    const toml::node* node = Find(table, key);
    if (node == nullptr) return {};
    const auto value = node->value_exact<std::string>();
    if (!value) Wrong(*node, fmt::format("{} must be a text in quotes", key));
    return value.value_or("");
  }

  struct Bounds {
    double low = -1e9;
    double high = 1e9;
  };
  double Number(const toml::table& table, const char* key, Bounds bounds, bool required = true,
                double otherwise = 0) {
    const toml::node* node = Find(table, key);
    if (node == nullptr) {
      if (required) Wrong(table, fmt::format("{} is missing", key));
      return otherwise;
    }
    return NumberOf(*node, key, bounds);
  }

  double NumberOf(const toml::node& node, const char* key, Bounds bounds) {
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value) {
      Wrong(node, fmt::format("{} must be a number", key));
      return 0;
    }
    if (!(*value >= bounds.low && *value <= bounds.high))
      Wrong(node, fmt::format("{} must be between {:g} and {:g}", key, bounds.low, bounds.high));
    return *value;
  }

  const toml::table* Section(const toml::table& table, const char* key) {
    const toml::node* node = Find(table, key);
    if (node == nullptr) return nullptr;
    if (node->as_table() == nullptr) Wrong(*node, fmt::format("[{}] must be a table", key));
    return node->as_table();
  }
  const toml::array* List(const toml::table& table, const char* key) {
    const toml::node* node = Find(table, key);
    if (node == nullptr) return nullptr;
    if (node->as_array() == nullptr) Wrong(*node, fmt::format("{} must be a list", key));
    return node->as_array();
  }

  // An unread key is a mistake that would pass without a message, so it is an error.
  void NothingElse(const toml::table& table) {
    for (const auto& [key, node] : table)
      if (read_.find(&node) == read_.end())
        Wrong(node, fmt::format("nobody reads the key '{}'", key.str()));
  }

 private:
  const toml::node* Find(const toml::table& table, const char* key) {
    const toml::node* node = table.get(key);
    if (node != nullptr) read_.insert(node);
    return node;
  }

  std::string file_;
  std::optional<Error> error_;
  std::set<const toml::node*> read_;
};

std::vector<sim::SphericalTerm> ReadTerms(Reader* reader, const toml::table& field) {
  std::vector<sim::SphericalTerm> terms;
  const toml::array* list = reader->List(field, "terms");
  if (list == nullptr) {
    reader->Wrong(field, "terms are missing");
    return terms;
  }
  if (list->size() > kTermsMax) reader->Wrong(*list, "more terms than any fit makes");
  std::set<std::pair<int, int>> known;
  for (const toml::node& node : *list) {
    const toml::array* row = node.as_array();
    if (row == nullptr || row->size() != 6) {
      reader->Wrong(node, "a term has six numbers: degree, order, cosine_T, sine_T, sd of both");
      return terms;
    }
    const auto at = [&](std::size_t k, const char* name, Reader::Bounds bounds) {
      return reader->NumberOf((*row)[k], name, bounds);
    };
    const double degree = at(0, "degree", {0, sim::kDegreeMax});
    const double order = at(1, "order", {0, degree});
    sim::SphericalTerm term{static_cast<int>(degree),       static_cast<int>(order),
                            at(2, "cosine_T", {-100, 100}), at(3, "sine_T", {-100, 100}),
                            at(4, "sd_cosine_T", {0, 100}), at(5, "sd_sine_T", {0, 100})};
    if (degree != std::floor(degree) || order != std::floor(order))
      reader->Wrong(node, "degree and order must be whole");
    if (!known.insert({term.degree, term.order}).second)
      reader->Wrong(node, fmt::format("degree {}, order {} is there twice", degree, order));
    if (reader->error()) return terms;
    terms.push_back(term);
  }
  return terms;
}

void ReadField(Reader* reader, const toml::table& field, HallModelFile* model) {
  const std::string kind = reader->Text(field, "kind");
  if (kind == "harmonic") {
    model->field = sim::HarmonicParameters{
        reader->Number(field, "amplitude_T", {-100, 100}),
        reader->Number(field, "phase_deg", {-360, 360}) * kRadPerDeg,
        reader->Number(field, "sd_amplitude_T", {0, 1e6}, false),
        reader->Number(field, "sd_phase_deg", {0, 1e6}, false) * kRadPerDeg};
  } else if (kind == "surface") {
    model->field =
        sim::SurfaceParameters{reader->Number(field, "amplitude_T", {-100, 100}),
                               reader->Number(field, "width_deg", {1, 180}) * kRadPerDeg,
                               reader->Number(field, "phase_deg", {-360, 360}) * kRadPerDeg,
                               reader->Number(field, "sd_amplitude_T", {0, 1e6}, false),
                               reader->Number(field, "sd_width_deg", {0, 1e6}, false) * kRadPerDeg,
                               reader->Number(field, "sd_phase_deg", {0, 1e6}, false) * kRadPerDeg};
  } else if (kind == "spherical") {
    model->field = ReadTerms(reader, field);
  } else {
    reader->Wrong(field, "kind must be 'harmonic', 'surface' or 'spherical'");
  }
  model->radius_mm = reader->Number(field, "radius_mm", {1, 1e4}, false, sim::kSensorRadius_mm);
  model->peak_T = reader->Number(field, "peak_T", {0, 100}, false);
  model->rms_T = reader->Number(field, "rms_T", {0, 100}, false);
  model->noise_T = reader->Number(field, "noise_T", {0, 100}, false);
  model->decay_known = field.contains("decay");
  model->decay = reader->Number(field, "decay", {-100, 100}, false);
  reader->NothingElse(field);
}

void ReadRig(Reader* reader, const toml::table& rig, HallModelFile* model) {
  if (const toml::array* centre = reader->List(rig, "centre_mm")) {
    if (centre->size() != 3) {
      reader->Wrong(*centre, "centre_mm has three numbers");
      return;
    }
    double* parts[] = {&model->centre_mm.x, &model->centre_mm.y, &model->centre_mm.z};
    for (std::size_t k = 0; k < 3; ++k)
      *parts[k] = reader->NumberOf((*centre)[k], "centre_mm", {-30, 30});
  }
  model->temperature_per_K = reader->Number(rig, "temperature_per_K", {-0.5, 0.5}, false);
  model->temperature_reference_C =
      reader->Number(rig, "temperature_reference_C", {-273.15, 1000}, false, 20);
  reader->NothingElse(rig);
}

void ReadSensorList(Reader* reader, const toml::array& list, HallModelFile* model) {
  for (const toml::node& node : list) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return reader->Wrong(node, "[[sensor]] must be a table");
    SensorCalibration sensor;
    const double number =
        reader->Number(*table, "sensor", {1, static_cast<double>(sim::kSensorsMax)});
    sensor.sensor = number >= 1 ? static_cast<std::size_t>(number) - 1 : 0;
    sensor.gain = reader->Number(*table, "gain", {-100, 100}, false, 1);
    if (sensor.gain == 0) reader->Wrong(*table, "a gain of 0 measures nothing");
    sensor.offset_V = reader->Number(*table, "offset_V", {-100, 100}, false);
    sensor.shift_east_rad = reader->Number(*table, "shift_east_deg", {-45, 45}, false) * kRadPerDeg;
    sensor.shift_north_rad =
        reader->Number(*table, "shift_north_deg", {-45, 45}, false) * kRadPerDeg;
    reader->NothingElse(*table);
    model->sensors.push_back(sensor);
  }
}

}  // namespace

std::string WriteHallModel(const HallModelFile& model) {
  std::string text = "# The field of a rotor and the rig around it, by focalfleet hall.\n";
  for (const std::string& note : model.notes) text += "# " + note + "\n";
  text += fmt::format("name = {}\norigin = {}\nsha256 = {}\n\n[field]\n", Quoted(model.name),
                      Quoted(model.origin), Quoted(model.sha256));
  text += FieldText(model.field);
  Line(&text, "radius_mm", model.radius_mm);
  Line(&text, "peak_T", model.peak_T);
  Line(&text, "rms_T", model.rms_T);
  Line(&text, "noise_T", model.noise_T);
  if (model.decay_known) Line(&text, "decay", model.decay);
  const sim::Vector3& centre = model.centre_mm;
  if (Length(centre) > 0 || model.temperature_per_K != 0) {
    text += "\n[rig]\n";
    text += fmt::format("centre_mm = [{}, {}, {}]\n", NumberText(centre.x), NumberText(centre.y),
                        NumberText(centre.z));
    Line(&text, "temperature_per_K", model.temperature_per_K);
    Line(&text, "temperature_reference_C", model.temperature_reference_C);
  }
  for (const SensorCalibration& sensor : model.sensors) {
    text += fmt::format("\n[[sensor]]\nsensor = {}\n", sensor.sensor + 1);
    Line(&text, "gain", sensor.gain);
    Line(&text, "offset_V", sensor.offset_V);
    Line(&text, "shift_east_deg", sensor.shift_east_rad / kRadPerDeg);
    Line(&text, "shift_north_deg", sensor.shift_north_rad / kRadPerDeg);
  }
  return text;
}

Result<HallModelFile> ReadHallModel(std::string_view text, const std::string& file) {
  const toml::parse_result parsed = toml::parse(text, file);
  if (!parsed) {
    const toml::parse_error& error = parsed.error();
    return Fail(ErrorCode::kInvalid,
                fmt::format("{}:{}: {}", file, error.source().begin.line, error.description()));
  }
  const toml::table& root = parsed.table();
  Reader reader(file);
  HallModelFile model;
  model.name = reader.Text(root, "name");
  model.origin = reader.Text(root, "origin");
  model.sha256 = reader.Text(root, "sha256");
  if (const toml::table* field = reader.Section(root, "field"))
    ReadField(&reader, *field, &model);
  else if (!reader.error())
    return Fail(ErrorCode::kInvalid, file + ": [field] is missing: not a model of a Hall rig");
  if (const toml::table* rig = reader.Section(root, "rig")) ReadRig(&reader, *rig, &model);
  if (const toml::array* list = reader.List(root, "sensor")) ReadSensorList(&reader, *list, &model);
  reader.NothingElse(root);
  if (reader.error()) return tl::unexpected<Error>(*reader.error());
  return model;
}

Result<sim::HallRig> RigOf(const HallModelFile& model, std::vector<sim::HallSensor> sensors) {
  sim::HallRig rig;
  rig.sensors = std::move(sensors);
  rig.radius_mm = model.radius_mm;
  rig.decay = model.decay;
  rig.centre_mm = model.centre_mm;
  rig.temperature_per_K = model.temperature_per_K;
  rig.temperature_reference_C = model.temperature_reference_C;
  for (const SensorCalibration& known : model.sensors) {
    if (known.sensor >= rig.sensors.size())
      return Fail(ErrorCode::kInvalid,
                  fmt::format("the model knows sensor {}, there are {} sensors", known.sensor + 1,
                              rig.sensors.size()));
    sim::HallSensor& sensor = rig.sensors[known.sensor];
    sensor.gain *= known.gain;
    sensor.offset_V += known.offset_V;
    sensor.direction =
        sim::Shifted(sensor.direction, {known.shift_east_rad, known.shift_north_rad});
  }
  return rig;
}

}  // namespace focalfleet
