#include "daemon/doctor/examine.h"

#include "daemon/doctor/judge.h"

namespace focalfleet::doctor {

std::vector<Check> Examine(const Facts& facts) {
  Checks checks;
  for (const auto judge :
       {&JudgeConfig, &JudgeDaemon, &JudgeBuses, &JudgeFiles, &JudgeStore, &JudgeDds, &JudgeHost})
    judge(facts, &checks);
  return checks;
}

}  // namespace focalfleet::doctor
