// The model that blind commands go through, and those before it. A model.toml is read and checked
// whole before anything changes; then it is in force at once, and its text goes to the store with
// the change, so that it is in force after a restart and an earlier one can be taken back out.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
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

  /// `layout` outlives the registry.
  explicit ModelRegistry(const Layout* layout) : layout_(layout) {}

  /// All changes that the store has are known; none is in force yet. Changes are numbered after
  /// them, so none may be made before this.
  void TakeChanges(std::vector<ModelHistory> newest_first);
  [[nodiscard]] bool changes_known() const { return changes_known_; }
  /// The sha256 of the model that the newest change put in force; empty: it ended one, or there is
  /// no change.
  [[nodiscard]] std::string newest_sha256() const {
    return changes_.empty() ? "" : changes_.back().row.sha256;
  }
  /// The newest change's model is in force again. Errors: as Load; then none is. Pre:
  /// newest_sha256() is not empty and is that of `text`.
  Status Restore(const std::string& text);

  // ---- changes: the row that makes it last; nothing has changed where there is an error

  /// Errors: kInvalid with file and line: no model, or not one of this fleet; kRefused: it is in
  /// force already.
  Result<ModelRow> Load(const std::string& text, const std::string& file);
  /// Errors: kRefused: none is in force.
  Result<ModelRow> Unload();
  /// To what was in force before. `text_of` finds a text by its sha256.
  /// Errors: kRefused: there is nothing before; those of `text_of`.
  Result<ModelRow> Rollback(const std::function<Result<std::string>(const std::string&)>& text_of);

  [[nodiscard]] const Layout& layout() const { return *layout_; }
  /// When the model in force was first put in force; units homed later are none of its own. Pre:
  /// there is one.
  [[nodiscard]] WallTime since() const;

  /// None: commands go as they are.
  [[nodiscard]] const Compensation* compensation() const {
    return compensation_ ? &*compensation_ : nullptr;
  }
  [[nodiscard]] Compensation* compensation() { return compensation_ ? &*compensation_ : nullptr; }

  /// In force now, with its effects and their uncertainty; then the changes, newest first.
  [[nodiscard]] Json Show(std::size_t changes_max) const;
  /// The name, for one line of a status; empty: none.
  [[nodiscard]] std::string name() const { return file_ ? file_->model.name : ""; }

 private:
  void Take(ModelInForce model);
  ModelRow Append(ModelRow row);
  /// Of changes_: itself, or the one that it restores.
  [[nodiscard]] std::size_t Origin(std::size_t index) const;

  const Layout* layout_;
  std::optional<ModelFile> file_;
  std::optional<Compensation> compensation_;
  std::vector<ModelHistory> changes_;  // oldest first
  bool changes_known_ = false;
};

}  // namespace focalfleet
