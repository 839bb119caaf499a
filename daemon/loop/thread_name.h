// The name of a thread, as `top -H` and debuggers show it.
#pragma once

namespace focalfleet {

/// This thread has the name, cut after 15 bytes.
void NameThisThread(const char* name);

}  // namespace focalfleet
