// The registry of models: the model that blind commands go through, and those before it. A
// model.toml is read and checked whole before anything changes; then it is in force at once. Its
// text goes to the store with the change. After a restart it is in force again, and an earlier
// model can be restored.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/campaign/compensation.h"
#include "daemon/control/messages.h"
#include "daemon/store/history.h"
#include "fleet/layout.h"
#include "fleet/records.h"

namespace focalfleet {

class ModelRegistry {
 public:
  /// Limit of the changes that are taken from the store and shown.
  static constexpr std::uint32_t kChangesMax = 1000;

  /// `layout` outlives the registry. `now` gives the time of day.
  explicit ModelRegistry(const Layout* layout, std::function<WallTime()> now = &WallTime::Now)
      : layout_(layout), now_(std::move(now)) {}

  /// All changes of the store are known; no model is in force yet. Pre: no change was made: later
  /// ones are numbered after those of the store.
  void TakeChanges(std::vector<ModelHistory> newest_first);
  [[nodiscard]] bool changes_known() const { return changes_known_; }
  /// The sha256 of the model that the newest change put in force; empty: the change ended a model,
  /// or there is no change.
  [[nodiscard]] std::string newest_sha256() const {
    return changes_.empty() ? "" : changes_.back().row.sha256;
  }
  /// The model of the newest change is in force again. Errors: as Load; then no model is in force.
  /// Pre: newest_sha256() is not empty and is that of `text`.
  Status Restore(const std::string& text);

  // ---- changes: the result is the row that makes the change durable; an error changes nothing

  /// The model is in force. Errors: kInvalid with file and line: no model, or not one of this
  /// fleet; kRefused: it is in force already.
  Result<ModelRow> Load(const std::string& text, const std::string& file);
  /// No model is in force. Errors: kRefused: none was.
  Result<ModelRow> Unload();
  /// The model before the present one is in force, or none where there was none. `text_of` finds a
  /// text by its sha256. Errors: kRefused: there is nothing before; those of `text_of`.
  Result<ModelRow> Rollback(const std::function<Result<std::string>(const std::string&)>& text_of);

  [[nodiscard]] const Layout& layout() const { return *layout_; }
  /// The change that first put the model in force. Units homed later go without it. Pre: a model is
  /// in force.
  [[nodiscard]] std::uint64_t since() const;

  /// The model in force; none: commands go as they are.
  [[nodiscard]] const Compensation* compensation() const {
    return compensation_ ? &*compensation_ : nullptr;
  }
  [[nodiscard]] Compensation* compensation() { return compensation_ ? &*compensation_ : nullptr; }

  /// The model in force with its effects and their uncertainty; then the changes, newest first.
  [[nodiscard]] Json Show(std::size_t changes_max) const;
  /// The name of the model in force; empty: none.
  [[nodiscard]] std::string name() const { return file_ ? file_->model.name : ""; }

 private:
  void Take(ModelInForce model);
  ModelRow Append(ModelRow row);
  /// Index in changes_ of the change itself, or of the change that it restores.
  [[nodiscard]] std::size_t Origin(std::size_t index) const;

  const Layout* layout_;
  std::function<WallTime()> now_;
  std::optional<ModelFile> file_;
  std::optional<Compensation> compensation_;
  std::vector<ModelHistory> changes_;  // oldest first
  bool changes_known_ = false;
};

}  // namespace focalfleet
