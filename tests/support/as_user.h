// A test as another user. No permission forbids root anything, so a test of root proves nothing of
// other users, nor the other way round.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>
#include <vector>

namespace focalfleet::test {

/// The users that tests can be: root and nobody where root runs them, else the user who runs them.
inline std::vector<uid_t> UsersOfTests() {
  constexpr uid_t kNobody = 65'534;
  return geteuid() == 0 ? std::vector<uid_t>{0, kNobody} : std::vector<uid_t>{geteuid()};
}

inline std::string NameOfUser(const ::testing::TestParamInfo<uid_t>& info) {
  return info.param == 0 ? "AsRoot" : "AsAUser";
}

/// The whole process acts as that user until the end of the scope.
class AsUser {
 public:
  explicit AsUser(uid_t user) : before_(geteuid()) {
    if (user != before_) {
      EXPECT_EQ(seteuid(user), 0);
    }
  }
  AsUser(const AsUser&) = delete;
  AsUser& operator=(const AsUser&) = delete;
  ~AsUser() {
    if (geteuid() != before_) {
      EXPECT_EQ(seteuid(before_), 0);
    }
  }

 private:
  uid_t before_;
};

}  // namespace focalfleet::test
