// The text of deploy/cyclonedds.xml, which is in force where dds.config names no other file.
#pragma once

namespace focalfleet {

extern const char* const kLoopbackConfig;

}  // namespace focalfleet
