#include "daemon/doctor/check.h"

#include <algorithm>
#include <utility>

namespace focalfleet::doctor {

Check Ok(std::string name, std::string text) {
  return {std::move(name), Verdict::kOk, std::move(text), ""};
}
Check Warn(std::string name, std::string text, std::string todo) {
  return {std::move(name), Verdict::kWarn, std::move(text), std::move(todo)};
}
Check Fail(std::string name, std::string text, std::string todo) {
  return {std::move(name), Verdict::kFail, std::move(text), std::move(todo)};
}

Verdict Worst(std::span<const Check> checks) {
  Verdict worst = Verdict::kOk;
  for (const Check& check : checks) worst = std::max(worst, check.verdict);
  return worst;
}

}  // namespace focalfleet::doctor
