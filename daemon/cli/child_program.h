// Another program as a child of this one, which waits for it.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet::cli {

/// Runs a program, looked for in PATH, with its output in the new file `output`; its errors are
/// appended to `errors`. Returns its exit code. Errors: kUnavailable: it cannot be started, or a
/// signal ended it.
Result<int> RunChild(const std::vector<std::string>& arguments, const std::string& output,
                     const std::string& errors);

}  // namespace focalfleet::cli
