#include "daemon/loop/thread_name.h"

#include <sys/prctl.h>

namespace focalfleet {

void NameThisThread(const char* name) { ::prctl(PR_SET_NAME, name); }

}  // namespace focalfleet
