// A test's own DDS domain with credentials of deploy/dds-security/make-keys.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "tests/daemon/dds/own_domain.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::test {

class SecuredDomain : public ::testing::Test {
 protected:
  /// Makes credentials in the folder `keys`. MAKE_KEYS is the script's path.
  void MakeKeys(const std::string& options, const std::string& environment = "") {
    const std::string command = environment + " " MAKE_KEYS " " + (folder_ / "keys") +
                                " --domain " + std::to_string(OwnDomain()) + " " + options +
                                " > /dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
  }
  [[nodiscard]] std::string Keys(const std::string& who) const { return folder_ / ("keys/" + who); }

  ScratchFolder folder_;
};

}  // namespace focalfleet::test
