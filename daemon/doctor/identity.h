// Whether a user may use a file, by the file's owner, group and mode. Access control lists are not
// looked at.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace focalfleet::doctor {

struct Identity {
  std::uint32_t uid = 0;
  std::vector<std::uint32_t> groups;  // the primary one, too
  std::string name;                   // for people
};

struct FileFacts {
  std::string path;
  std::string trouble;  // why the file cannot be looked at; empty: the other members hold
  std::uint32_t uid = 0;
  std::uint32_t gid = 0;
  std::uint32_t mode = 0;  // as st_mode
  std::string owner;       // name of the user; its number where it has none
  std::string group;
};

/// The bits of a mode, of one class of users.
enum class Access : std::uint32_t { kRead = 4, kWrite = 2, kUse = 1 };

bool May(const Identity& user, const FileFacts& file, Access access);

}  // namespace focalfleet::doctor
