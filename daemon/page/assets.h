// The page's own files, as CMake builds them in (assets.cc.in).
#pragma once

#include <span>
#include <string_view>

namespace focalfleet {

struct PageAsset {
  std::string_view path;  // under which it is served
  std::string_view type;
  std::string_view text;
};

std::span<const PageAsset> PageAssets();

}  // namespace focalfleet
