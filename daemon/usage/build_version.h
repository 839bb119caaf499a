// The version of this build, from one place for all programs: that of CMakeLists.txt with the
// commit.
#pragma once

namespace focalfleet {

/// "0.1.0+g1a2b3c4d"; with "-changed" where the tree had changes that are in no commit, and "0.1.0"
/// where the build knew no commit. Two builds of changed trees on one commit have the same.
const char* BuildVersion();

}  // namespace focalfleet
